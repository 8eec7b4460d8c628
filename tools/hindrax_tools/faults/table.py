"""All cells of the table of faults: flown, then put together, a row for each fault."""

import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from hindrax_analysis.identification.executor import run_all
from hindrax_tools.faults import device_faults, process_faults
from hindrax_tools.faults.fault_outcome import DISARMED, EVERY_MODE, MODES, MOMENTS, FaultOutcome

TABLES = {"": MODES, "; faults at other moments": MOMENTS}
"""What is printed: end of the title, and the modes."""
GROUPS = {
    "in flight": tuple(mode for mode in MODES if mode != DISARMED),
    "at other moments": MOMENTS,
    "disarmed": (DISARMED,),
}
"""Modes that share a column where the screen is short."""
WHO = tuple(dict.fromkeys([row.who for row in process_faults.ROWS] + [row.who for row in device_faults.ROWS]))


def fly(only: Sequence[str], seeds: Sequence[int], workers: int | None = None) -> list[FaultOutcome]:
    """Fly all cells, or those of some processes and devices; reports progress on stderr."""
    harmed = tuple(row for row in process_faults.ROWS if row.who in only)
    together = [tuple(row for row in harmed if row.by_mock is by_mock) for by_mock in (False, True)]
    jobs = [partial(process_faults.fly, some, seed) for some in together if some for seed in seeds]
    broken = [row for row in device_faults.ROWS if row.who in only]
    jobs += [partial(device_faults.fly, row, mode, seed) for row in broken for mode in EVERY_MODE for seed in seeds]
    # How many flights they take is not known before: a stack serves the cells of its rows until one loses it.
    count = len(seeds) * (len(harmed) * len(MODES) + len(broken) * len(EVERY_MODE))
    found: list[FaultOutcome] = []
    for cells in run_all(_fly, jobs, workers=workers):
        found += cells
        print(f"{len(found)} of {count} cells", file=sys.stderr, flush=True)
    return found


def _fly(job: Callable[[], Iterator[FaultOutcome]]) -> list[FaultOutcome]:
    cells = []
    for one in job():
        cells.append(one)
        came = "; ".join(one.violated) or entry([one])
        print(f"{one.who} {one.what}, {one.mode}, seed {one.seed}: {came}", file=sys.stderr, flush=True)
    return cells


def rows(cells: Sequence[FaultOutcome], modes: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Who, what, an entry for each of these modes, what the vehicle reported, where it is told: the worst of all seeds.

    A fault that was flown in none of them has no row.
    """
    cells = [one for one in cells if one.mode in modes]
    for who, what in dict.fromkeys((one.who, one.what) for one in cells):
        same = [one for one in cells if (one.who, one.what) == (who, what)]
        flown = [one for one in same if one.mode != DISARMED]
        reasons = dict.fromkeys(one.reason.partition(": ")[0] for one in flown if one.reason)
        told = dict.fromkeys(place for one in flown for place in one.told)
        entries = (entry([one for one in same if one.mode == mode]) for mode in modes)
        yield who, what, *entries, "; ".join(reasons), ", ".join(told)


def short_rows(cells: Sequence[FaultOutcome]) -> Iterator[tuple[str, ...]]:
    """Who, how many faults, an entry for each group of modes: the worst of all faults and seeds."""
    for who in dict.fromkeys(one.who for one in cells):
        own = [one for one in cells if one.who == who]
        entries = (entry([one for one in own if one.mode in modes]) for modes in GROUPS.values())
        yield who, str(len({one.what for one in own})), *entries


def entry(cells: Sequence[FaultOutcome]) -> str:
    """What came of one fault in one mode: neutral within so many seconds, or the flight went on."""
    if any(one.violated for one in cells):
        return "VIOLATED"
    wall = " (wall)" if any(one.wall for one in cells) else ""
    times = [one.neutral_s for one in cells if one.neutral_s is not None]
    if not times:
        return f"flies on{wall}" if cells else ""
    if cells[0].mode == DISARMED:
        return "neutral"
    return f"{max(times):.2f} s{' or flies on' if len(times) < len(cells) else ''}{wall}"
