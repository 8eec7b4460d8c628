"""What `identify` makes of the records of foreign plants, in its calibrated deviations.

    python -m hindrax_tools.uncertainty.foreign_verdicts [--only small-pilot] [--seeds 3 4] [--live]
        [--write FOLDER | --read FOLDER]

Simulation needs the wheel `mujoco`; records that were written do not.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.recording import events, reason_to_skip
from hindrax_core.signals import Estimate
from hindrax_ident.assess.objections import CAUSES, Objection
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS, rigid_mass
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import Feed
from hindrax_ident.tuning import for_foreign_records
from hindrax_laboratory.benchmark.foreign_plants import AS_THE_COMMAND, KINDS, PLANTS, ForeignRecord, fly, read, write

WANTED_DEVIATIONS = 2.0
"""Deviations within which 95 % are wanted."""


@dataclass(frozen=True, slots=True)
class Score:
    """One motion of one record: errors in calibrated deviations, and the causes named.

    `corrected`: those of the corrected drag, in halves of its 68 % interval.
    """

    record: str
    motion: str
    drag: tuple[float, ...]
    added_mass: float
    identified: bool
    warnings: tuple[Objection, ...]
    reasons: tuple[Objection, ...]
    band: float
    """Calibrated deviation of the drag at the highest speed, as a share of it [-]."""
    corrected: tuple[float, ...] = ()


def scores(record: ForeignRecord, axes: tuple[int, ...] = ()) -> list[Score]:
    """What `identify` makes of a record, against its truth."""
    source = RecordSource(Path(record.name), without_damage(record.recording))
    found = identify_sources([source], record.vehicle, IdentificationTask(axes=axes, tuning=AS_THE_COMMAND))
    return [score(record, one) for one in found.results.motions.values()]


def score(record: ForeignRecord, result: MotionResult) -> Score:
    """One motion; the drag is compared where the record has speeds, and where it is known at all."""
    axis = MOTIONS[result.motion].axis
    off, corrected, band = [], [], math.nan
    if result.drag is not None:
        for speed, true in zip(record.speeds[axis], record.drag[axis], strict=True):
            force, sigma = (
                float(np.interp(speed, result.drag.speed, y)) for y in (result.drag.force, result.drag.std_calibrated)
            )
            off.append((force - true) / sigma)
            if (interval := result.drag.corrected) is not None:
                ends = interval.center, interval.low68, interval.high68
                center, low, high = (float(np.interp(speed, result.drag.speed, y)) for y in ends)
                corrected.append((center - true) / (0.5 * (high - low)))
        band = float(result.drag.std_calibrated[-1] / result.drag.force[-1])
    mass = result.coefficients.get("added_mass")
    far = (mass.value - record.added_mass[axis]) / mass.std_calibrated if mass else math.nan
    return Score(
        record.name,
        result.motion,
        tuple(off),
        far,
        result.identifiable,
        result.warnings,
        result.reasons,
        band,
        tuple(corrected),
    )


def live_distances(record: ForeignRecord, axes: Sequence[int] = range(6)) -> dict[str, tuple[float, ...]]:
    """Distances of the live estimates at the end of a record, per motion: of the drag at its speeds, and added mass.

    In their own deviations, and that of the wrench's gain, which is told after the run alone.
    """
    found: dict[str, tuple[float, ...]] = {}
    recording = without_damage(record.recording)
    tuning = for_foreign_records(AS_THE_COMMAND)
    for axis in axes:
        feed, session = Feed(record.vehicle, tuning), Session(record.vehicle, tuning)
        last: Estimate | None = None
        for event in () if reason_to_skip(recording, axis) else feed.all(events(recording, axis)):
            for estimate in session.step(event):
                last = estimate.reading
        if last is None:
            continue
        at = [last.names.index(name) for name in ("k_q", "k_l", "added_mass")]
        values, covariance = np.array(last.values)[at], np.array(last.covariance)[np.ix_(at, at)]
        rows = [(speed * abs(speed), speed, 0.0) for speed in record.speeds[axis].tolist()] + [(0.0, 0.0, 1.0)]
        wanted = [*record.drag[axis].tolist(), record.added_mass[axis]]
        rigid = [*(0.0 for _ in record.drag[axis]), rigid_mass(record.vehicle, axis)]
        found[last.motion] = tuple(
            (float(np.dot(row, values)) - true)
            / math.hypot(math.sqrt(row @ covariance @ row), (np.dot(row, values) + body) * tuning.wrench_gain_sigma)
            for row, true, body in zip(map(np.array, rows), wanted, rigid, strict=True)
        )
    return found


def summary(found: Sequence[Score]) -> str:
    """How many are identified, and how far those are off: drag and mass of the fit, and the corrected drag."""
    known = [one for one in found if one.identified]
    words = [f"{len(known)} of {len(found)} motions identified"]
    for name, far in (
        ("fit", [off for one in known for off in (*one.drag, one.added_mass) if math.isfinite(off)]),
        ("corrected drag", [off for one in known for off in one.corrected]),
    ):
        if far:
            within = sum(abs(off) <= WANTED_DEVIATIONS for off in far) / len(far)
            words.append(
                f"{name}: {within:.1%} of {len(far)} within {WANTED_DEVIATIONS:g}, {min(far):+.1f} to {max(far):+.1f}"
            )
    return "; ".join(words)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line per motion of 24 records, and how many are how far off."""
    parser = argparse.ArgumentParser(prog="foreign_verdicts", description=__doc__)
    parser.add_argument("--only", default="", help="records with this in their name")
    parser.add_argument(
        "--seeds", type=int, nargs="+", default=[1, 2], metavar="N", help="of the records; default: 1 2"
    )
    parser.add_argument("--write", type=Path, help="write the records to this folder instead of judging them")
    parser.add_argument("--read", type=Path, help="read records from this folder instead of simulating them")
    parser.add_argument("--live", action="store_true", help="judge the live estimates instead of those after the run")
    given = parser.parse_args(arguments)
    files = sorted(given.read.glob("*.npz")) if given.read else []
    names = [(plant, kind, seed) for plant in PLANTS for kind in KINDS for seed in given.seeds]
    records = (
        (read(file) for file in files if given.only in file.stem)
        if given.read
        else (fly(*one) for one in names if given.only in f"{one[0].name}-{one[1]}-{one[2]}")
    )
    found: list[Score] = []
    live: list[float] = []
    for record in records:
        if given.write:
            given.write.mkdir(parents=True, exist_ok=True)
            write(record, given.write)
            continue
        if given.live:
            for motion, far in live_distances(record).items():
                live += far
                print(f"{record.name:18} {motion:11} " + " ".join(f"{off:+5.1f}" for off in far), flush=True)
            continue
        for one in scores(record):
            found.append(one)
            print(_line(one), flush=True)
    if found:
        print(summary(found))
    if live:
        within = (sum(abs(off) <= limit for off in live) / len(live) for limit in (WANTED_DEVIATIONS, 3.0))
        print(f"live: {next(within):.1%} of {len(live)} within 2, {next(within):.1%} within 3")
    return 0


def _line(one: Score) -> str:
    drag = " ".join(f"{off:+5.1f}" for off in one.drag) or "none"
    verdict = "identified" if one.identified else "; ".join(one.reasons)
    causes = " | ".join(warning for warning in one.warnings if warning.code in CAUSES)
    return (
        f"{one.record:18} {one.motion:11} drag {drag:18} mass {one.added_mass:+5.1f} {one.band:6.1%} {verdict} {causes}"
    )


if __name__ == "__main__":
    sys.exit(main())
