"""What `identify` makes of the records of foreign plants, in its calibrated deviations.

    python -m hindrax_tools.uncertainty.foreign_verdicts [--only small-pilot] [--seeds 3 4]
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
from hindrax_ident.assess.objections import CAUSES, Objection
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS
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
    given = parser.parse_args(arguments)
    files = sorted(given.read.glob("*.npz")) if given.read else []
    names = [(plant, kind, seed) for plant in PLANTS for kind in KINDS for seed in given.seeds]
    records = (
        (read(file) for file in files if given.only in file.stem)
        if given.read
        else (fly(*one) for one in names if given.only in f"{one[0].name}-{one[1]}-{one[2]}")
    )
    found: list[Score] = []
    for record in records:
        if given.write:
            given.write.mkdir(parents=True, exist_ok=True)
            write(record, given.write)
            continue
        for one in scores(record):
            found.append(one)
            print(_line(one), flush=True)
    if found:
        print(summary(found))
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
