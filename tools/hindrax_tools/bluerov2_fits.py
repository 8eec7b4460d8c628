"""Pool tests of a heavy BlueROV2 behind its ArduSub, with each fit of sensors, against the truth of the mock.

    python -m hindrax_tools.bluerov2_fits --seeds 10 --fit sonar

Flown in lock-step and by bytes: the real drivers, an emulated ArduSub, its link, and the emulated sensors beside it.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import call

from hindrax_analysis.identification.executor import run_all
from hindrax_analysis.identification.montecarlo import Trial, trial_of
from hindrax_analysis.terminal import print_table
from hindrax_bringup.share_files import share_folder
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_sim.conditions.world_table import POOL
from hindrax_sim.flights.pool_flight import fly

AUTOPILOT = {"autopilot": Mount("ardusub")}
FITS: Mapping[str, Mapping[str, Mount]] = {
    "DVL-75": {"dvl75": Mount("dvl75", position_m=(0.0, 0.0, 0.15))},
    "A50": {"a50": Mount("a50", position_m=(0.0, 0.0, 0.15))},
    "none": {},
    "sonar": {"ahead": Mount("ping1d", position_m=(0.25, 0.0, 0.0), rotation_deg=(0.0, 90.0, 0.0))},
}
"""What is carried beside the autopilot with its IMU, compass and Bar30."""
MOTIONS: Mapping[str, tuple[str, ...]] = dict.fromkeys(FITS, ("surge", "heave", "yaw")) | {"none": ("heave", "yaw")}


@dataclass(frozen=True, slots=True)
class FitRow:
    """A motion of a fit over all flights: how often its drag was found, and how far off at the highest speed.

    Errors in calibrated deviations, of each direction of a flight alone; how many calibrated 95 % intervals hold.
    """

    fit: str
    motion: str
    flights: int
    found: int
    rms_percent: float
    worst_z: float
    rms_z: float
    held: float


def vehicle_with(fit: str) -> Vehicle:
    """The BlueROV2 of the box with the sensors of a fit."""
    vehicle = load_vehicle(share_folder("vehicles") / "bluerov2-heavy.yaml")
    return replace(vehicle, sensors={**AUTOPILOT, **FITS[fit]})


def flown(fit: str, seed: int, world: str = POOL, motions: Sequence[str] = ()) -> Trial:
    """Fly one pool test and compare it with the truth."""
    flight = fly(motions or MOTIONS[fit], seed, world, vehicle=vehicle_with(fit), by_bytes=True)
    return trial_of(seed, flight.outcome, flight.truth, flight.drag_N, trouble=str(flight.aborted))


def rows_of(fit: str, trials: Sequence[Trial]) -> Iterator[FitRow]:
    """A row for each motion, by the drag at the highest speed."""
    fastest = [(trial.seed, one) for trial in trials for one in trial.drag if one.share == 1.0]
    for motion in dict.fromkeys(one.motion for _, one in fastest):
        mine = [(seed, one) for seed, one in fastest if one.motion == motion and math.isfinite(one.std_calibrated)]
        z = [one.error / one.std_calibrated for _, one in mine]
        held = [abs(off) <= 1.96 for off in z]
        yield FitRow(
            fit,
            motion,
            len(trials),
            len({seed for seed, _ in mine}),
            100.0 * _rms([one.error for _, one in mine]),
            max(map(abs, z), default=math.nan),
            _rms(z),
            sum(held) / len(held) if held else math.nan,
        )


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(one * one for one in values) / len(values)) if values else math.nan


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, metavar="N")
    parser.add_argument("--seed", type=int, default=1, help="first one")
    parser.add_argument("--fit", nargs="+", default=list(FITS), choices=list(FITS))
    parser.add_argument("--world", default=POOL)
    parser.add_argument("--workers", type=int, default=None, metavar="N", help="processes; default: one per core")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args(arguments)
    rows: list[FitRow] = []
    ended = False
    for fit in asked.fit:
        jobs = [partial(flown, fit, asked.seed + number, asked.world) for number in range(asked.seeds)]
        trials = []
        for trial in run_all(call, jobs, workers=asked.workers):
            trials.append(trial)
            drag = {
                f"{one.motion} {one.error:+.3f} +- {one.std_calibrated:.3f}" for one in trial.drag if one.share == 1
            }
            print(f"{fit}, seed {trial.seed}: {trial.trouble or 'done'} {sorted(drag)}", file=sys.stderr, flush=True)
            ended = ended or bool(trial.trouble)
        rows += rows_of(fit, trials)
    if asked.json:
        print(json.dumps([{name: getattr(row, name) for name in FitRow.__slots__} for row in rows]))
        return int(ended)
    headings = ("flights", "found", "RMS error [%]", "RMS z", "largest z", "in the 95 % interval")
    cells = [
        (
            row.fit,
            row.motion,
            f"{row.flights}",
            f"{row.found}",
            f"{row.rms_percent:.1f}",
            f"{row.rms_z:.2f}",
            f"{row.worst_z:.1f}",
            f"{row.held:.0%}",
        )
        for row in rows
    ]
    print_table("Drag at the highest speed, z in calibrated deviations", ("fit", "motion"), headings, cells)
    return int(ended)


if __name__ == "__main__":
    sys.exit(main())
