"""A blind benchmark: records of foreign plants, questions about them, and a table of how well answers did.

    PYTHONPATH=tools python -m hindrax_tools.blind_benchmark make FOLDER
    PYTHONPATH=tools python -m hindrax_tools.blind_benchmark answer FOLDER --method joint > joint.json
    PYTHONPATH=tools python -m hindrax_tools.blind_benchmark score FOLDER joint.json theirs.json

`make` writes a record of tables with its vehicle file and questions (speeds of each axis), and the truth apart from
them. An answer of any tool is JSON: by record and axis `drag`, three pairs of force and standard deviation at the
speeds that were asked, and `added_mass`, one pair. An axis that is left out was refused.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hindrax_analysis.identification.executor import HERE, Workers, add_workers, workers_of
from hindrax_analysis.identification.joint_identification import identify_jointly
from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.terminal import print_table
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import DragBand, Number
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_tools.foreign_plants import AS_THE_COMMAND, KINDS, PLANTS, ForeignRecord, fly, read, write

TRUTH = "truth.json"
COVERED = 1.96
STEP_S = 0.1
Answer = Mapping[str, Mapping[str, Any]]
"""By axis: drag at three speeds and added mass, as pairs of value and standard deviation."""


@dataclass(frozen=True, slots=True)
class Row:
    """How well one tool answered: shares of the axes asked, errors at the highest speed, of the true drag [-]."""

    answered: float
    error: float
    band: float
    covered: float
    worst: float


def make(folder: Path, only: str = "", seeds: Sequence[int] = (1, 2), workers: Workers = HERE) -> None:
    """Fly the records; questions without answers, and the truth in its own file."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [(plant, kind, seed) for plant in PLANTS for kind in KINDS for seed in seeds]
    jobs = [partial(fly, *one) for one in wanted if only in f"{one[0].name}-{one[1]}-{one[2]}"]
    truth = {}
    for record in workers.run(jobs):
        truth[record.name] = {"drag": record.drag.tolist(), "added_mass": record.added_mass.tolist()}
        hidden = np.full_like(record.drag, math.nan), np.full(6, math.nan)
        write(ForeignRecord(record.name, record.vehicle, record.recording, record.speeds, *hidden), folder)
    (folder / TRUTH).write_text(json.dumps(truth, indent=1))


def answers(folder: Path, method: str, workers: Workers = HERE) -> dict[str, Answer]:
    """What a method says of all records of a folder; it does not open the truth."""
    records = [read(file) for file in sorted(folder.glob("*.npz"))]
    found = workers.run([partial(METHODS[method], one) for one in records])
    return {record.name: answer for record, answer in zip(records, found, strict=True)}


def _joint(record: ForeignRecord) -> Answer:
    source = RecordSource(Path(record.name), record.recording)
    try:
        found = identify_jointly([source], record.vehicle, IdentificationTask(tuning=AS_THE_COMMAND))
    except UsageError:
        return {}
    known = {name: one for name, one in found.motions.items() if not one.reasons}
    return {AXES[MOTIONS[name].axis]: _pairs(record, name, one.drag, one.coefficients) for name, one in known.items()}


def _by_axis(record: ForeignRecord) -> Answer:
    source = RecordSource(Path(record.name), record.recording)
    found = identify_sources([source], record.vehicle, IdentificationTask(tuning=AS_THE_COMMAND)).results.motions
    known = {name: one for name, one in found.items() if one.identifiable and one.drag}
    return {
        AXES[MOTIONS[name].axis]: _pairs(record, name, one.drag, one.coefficients)
        for name, one in known.items()
        if one.drag
    }


def _pairs(record: ForeignRecord, motion: str, drag: DragBand, coefficients: Mapping[str, Number]) -> dict[str, Any]:
    speeds = record.speeds[MOTIONS[motion].axis]
    rows = zip(*(np.interp(speeds, drag.speed, y).tolist() for y in (drag.force, drag.std_calibrated)), strict=True)
    mass = coefficients.get("added_mass")
    return {"drag": [list(row) for row in rows]} | ({"added_mass": [mass.value, mass.std_calibrated]} if mass else {})


def _least_squares(record: ForeignRecord) -> Answer:
    """Plain: accelerations from differences, m v' + k_q |v| v + k_l v + b = thrust, each axis by itself."""
    out: dict[str, dict[str, Any]] = {}
    r = record.recording
    t = np.arange(r.velocity_t[0], r.velocity_t[-1], STEP_S)
    for axis, name in enumerate(AXES):
        has = np.isfinite(r.velocity[:, axis])
        v = np.interp(t, r.velocity_t[has], r.velocity[has, axis])
        thrust = r.wrench[np.searchsorted(r.wrench_t, t, side="right") - 1, axis]
        columns = [np.gradient(v, STEP_S), np.abs(v) * v, v, np.ones_like(v)]
        if axis in (3, 4):
            columns.append(np.sin(np.interp(t, r.attitude_t, r.attitude[:, axis - 3])))
        A = np.stack(columns, axis=1)
        theta, *_ = np.linalg.lstsq(A, thrust, rcond=None)
        C = np.linalg.inv(A.T @ A) * float(np.mean((thrust - A @ theta) ** 2))
        drag = [
            [float(g @ theta), math.sqrt(float(g @ C @ g))] for g in map(_gradient(len(theta)), record.speeds[axis])
        ]
        body = record.vehicle.mass_kg if axis < 3 else record.vehicle.inertia[axis - 3]
        out[name] = {"drag": drag, "added_mass": [float(theta[0]) - body, math.sqrt(float(C[0, 0]))]}
    return out


def _gradient(parameters: int) -> Callable[[float], Array]:
    return lambda speed: array([0.0, speed**2, speed, *[0.0] * (parameters - 3)])


METHODS: dict[str, Callable[[ForeignRecord], Answer]] = {
    "axes": _by_axis, "joint": _joint, "least-squares": _least_squares
}  # fmt: skip


def score(truth: Mapping[str, Any], given: Mapping[str, Answer]) -> Row:
    """One row: drag at three speeds and added mass of all axes of the records that were asked."""
    asked, said = 0, 0
    z, errors, bands = [], [], []
    for name, true in truth.items():
        for axis, drag in zip(AXES, true["drag"], strict=True):
            asked += 1
            answer = given.get(name, {}).get(axis)
            if answer is None:
                continue
            said += 1
            pairs = [*zip(answer["drag"], drag, strict=True)]
            errors.append(abs(answer["drag"][-1][0] / drag[-1] - 1.0))
            bands.append(answer["drag"][-1][1] / drag[-1])
            if "added_mass" in answer:
                pairs.append((answer["added_mass"], true["added_mass"][AXES.index(axis)]))
            z += [abs(value - exact) / sigma for (value, sigma), exact in pairs]
    if not said:
        return Row(0.0, math.nan, math.nan, math.nan, math.nan)
    covered = float(np.mean(np.array(z) < COVERED))
    return Row(said / asked, float(np.median(errors)), float(np.median(bands)), covered, max(z))


def main(arguments: Sequence[str] | None = None) -> int:
    """Make records, answer, or print the table."""
    parser = argparse.ArgumentParser(prog="blind_benchmark", description=__doc__)
    parser.add_argument("what", choices=("make", "answer", "score"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("files", type=Path, nargs="*", help="answers to score")
    parser.add_argument("--method", choices=sorted(METHODS), default="joint")
    parser.add_argument("--only", default="", help="records with this in their name")
    add_workers(parser)
    given = parser.parse_args(arguments)
    if given.what == "make":
        make(given.folder, given.only, workers=workers_of(given))
    elif given.what == "answer":
        print(json.dumps(answers(given.folder, given.method, workers_of(given)), indent=1))
    else:
        truth = json.loads((given.folder / TRUTH).read_text())
        rows = [(file.stem, score(truth, json.loads(file.read_text()))) for file in given.files]
        shown = [
            (name, f"{r.answered:.0%}", f"{r.error:.0%}", f"{r.band:.0%}", f"{r.covered:.0%}", f"{r.worst:.1f}")
            for name, r in rows
        ]
        heads = ("axes answered", "median error", "median band", "within 95 %", "worst deviation")
        print_table("Drag at three speeds and added mass, against the truth", ("answers",), heads, shown)
    return 0


if __name__ == "__main__":
    sys.exit(main())
