"""Hours of a stack in mock at the rates of a vehicle: growth of its memory, pauses of its control cycle.

    python -m hindrax_tools.soak --minutes 120

A vehicle holds its depth and is recorded; the table shows the memory of each process (resident set) ten minutes after
the start and at the end, and the last line the longest pause between two commands to the thrusters.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from hindrax_bag.read.bag_reader import messages, stamp_of
from hindrax_bringup.stack import MockOptions
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import THRUSTER_COMMAND, resolved
from hindrax_tools.benchmarks import family
from hindrax_tools.mock_stack import holding_depth, mock_stack, node_processes

WARM_UP_min = 10.0
GROWTH, PAUSE_S = 0.05, 0.1
"""More than this after the warm-up is a leak, and a pause of the control cycle; then the exit code is 1."""
LOOK_EVERY_S = 60.0


def soak(folder: Path, minutes: float) -> Iterator[dict[str, float]]:
    """Resident memory [MB] of each process with its children, once a minute; HindraxError when it no longer holds."""
    with mock_stack(folder, MockOptions(rate=1.0)) as stack, holding_depth(stack) as operator:
        nodes = node_processes(stack)
        for _ in range(round(minutes * 60.0 / LOOK_EVERY_S)):
            operator.pause(LOOK_EVERY_S)
            if not operator.armed:
                raise HindraxError(f"disarmed: {operator.reason}; {stack.folder.path}")
            yield {name: sum(one.memory_info().rss for one in family(pid)) / 1e6 for name, pid in nodes.items()}


def pauses_s(run: Path) -> list[float]:
    """Time between commands to the thrusters, the longest first [s]. Stamps are those of the control cycle."""
    stamps = [stamp_of(message.data) for message in messages(run, [resolved(THRUSTER_COMMAND)])]
    return sorted(((later - earlier) / NS_PER_S for earlier, later in pairwise(stamps)), reverse=True)


def findings(seen: Sequence[Mapping[str, float]], pauses: Sequence[float]) -> Iterator[tuple[str, bool]]:
    """One line for each process, its memory after the warm-up and at the end, and one for the cycle; which are good."""
    first = seen[min(round(WARM_UP_min * 60.0 / LOOK_EVERY_S), len(seen)) - 1]
    for name, end_MB in seen[-1].items():
        growth = end_MB / first[name] - 1.0
        yield f"{name:16} {first[name]:6.1f} MB {end_MB:6.1f} MB {growth:+6.1%}", growth <= GROWTH
    longest = ", ".join(f"{pause:.3f}" for pause in pauses[:5])
    above = sum(pause > PAUSE_S for pause in pauses)
    good = bool(pauses) and not above
    yield f"{len(pauses)} control cycles, the longest {longest} s; {above} above {PAUSE_S} s", good


def main(words: Sequence[str] | None = None) -> int:
    """Print the table; 1 when something grew or paused."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=120.0, help="default 120")
    minutes, seen, bad = parser.parse_args(words).minutes, list[dict[str, float]](), 0
    with tempfile.TemporaryDirectory() as place:
        for sizes in soak(Path(place), minutes):
            seen.append(sizes)
            print(f"\r{len(seen):4.0f} of {minutes:.0f} min, {sum(sizes.values()):.0f} MB", end="", file=sys.stderr)
        print(file=sys.stderr)
        for line, good in findings(seen, pauses_s(Path(place) / "run")):
            bad += not good
            print(f"{'good' if good else 'BAD '}  {line}")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
