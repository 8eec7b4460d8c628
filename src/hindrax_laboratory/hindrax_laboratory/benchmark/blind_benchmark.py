"""A blind benchmark: records of foreign plants, questions about them, and how well answers did.

`make` writes a record of tables with questions (speeds of each axis), and the truth apart from them. An answer of any
tool is JSON: by record and axis `drag`, three pairs of force and standard deviation at the speeds that were asked, and
`added_mass`, one pair. An axis that is left out was refused.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from hindrax_analysis.identification.executor import HERE, Workers
from hindrax_analysis.identification.joint_identification import identify_jointly
from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES
from hindrax_ident.assess.results import DragBand, Number
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_laboratory.benchmark.answer import Answer, AxisAnswer, Truth
from hindrax_laboratory.benchmark.foreign_plants import AS_THE_COMMAND, KINDS, PLANTS, ForeignRecord, fly, read, write
from hindrax_laboratory.benchmark.rivals import black_box, by_axis, least_squares, plateaus

TRUTH = "truth.json"
COVERED = 1.96
SPEEDS = 3

ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class Row:
    """How well one tool answered; None where it gave no deviations, or no answer.

    `answered`: share of the axes asked. `error`, `band`: medians of error and deviation of the drag at the highest
    speed, as shares of the truth. `covered`: share of all answers within 1.96 deviations; `worst`: the farthest in
    deviations [-].
    """

    answered: float
    error: float | None = None
    band: float | None = None
    covered: float | None = None
    worst: float | None = None


def make(
    folder: Path,
    only: str = "",
    seeds: Sequence[int] = (1, 2),
    workers: Workers = HERE,
    reached: Callable[[str], object] = lambda _: None,
) -> None:
    """Fly the records: questions without answers, and the truth in its own file.

    Parameters
    ----------
    folder
        For both.
    only
        Part of the names of records; empty: all.
    seeds
        Flights of each.
    workers
        Where the flights are computed.
    reached
        Called with how many are done.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [(plant, kind, seed) for plant in PLANTS for kind in KINDS for seed in seeds]
    jobs = [partial(fly, *one) for one in wanted if only in f"{one[0].name}-{one[1]}-{one[2]}"]
    truth = {}
    for record in _counted(workers.run(jobs), len(jobs), reached):
        truth[record.name] = {"drag": record.drag.tolist(), "added_mass": record.added_mass.tolist()}
        hidden = np.full_like(record.drag, math.nan), np.full(6, math.nan)
        write(ForeignRecord(record.name, record.vehicle, record.recording, record.speeds, *hidden), folder)
    (folder / TRUTH).write_text(json.dumps(truth, indent=1))


def answers(
    folder: Path, method: str, workers: Workers = HERE, reached: Callable[[str], object] = lambda _: None
) -> dict[str, Answer]:
    """Ask a method about all records of a folder; it does not open the truth.

    Parameters
    ----------
    folder
        Of `make`.
    method
        Name of the method.
    workers
        Where it computes.
    reached
        Called with how many are done.

    Returns
    -------
    dict[str, Answer]
        By record.
    """
    records = [read(file) for file in sorted(folder.glob("*.npz"))]
    found = _counted(workers.run([partial(METHODS[method], one) for one in records]), len(records), reached)
    return {record.name: answer for record, answer in zip(records, found, strict=True)}


def _counted(results: Iterable[ResultT], count: int, reached: Callable[[str], object]) -> Iterator[ResultT]:
    """Pass results on, and tell how many of how many have come."""
    for number, result in enumerate(results, start=1):
        reached(f"{number} of {count}")
        yield result


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


def _pairs(record: ForeignRecord, motion: str, drag: DragBand, coefficients: Mapping[str, Number]) -> AxisAnswer:
    speeds = record.speeds[MOTIONS[motion].axis]
    force, std = (np.interp(speeds, drag.speed, y).tolist() for y in (drag.force, drag.std_calibrated))
    out: AxisAnswer = {"drag": [*zip(force, std, strict=True)]}
    if (mass := coefficients.get("added_mass")) is not None:
        out["added_mass"] = mass.value, mass.std_calibrated
    return out


METHODS: dict[str, Callable[[ForeignRecord], Answer]] = {
    "axes": _by_axis,
    "joint": _joint,
    "least-squares": partial(by_axis, method=least_squares),
    "plateaus": partial(by_axis, method=plateaus),
    "sysidentpy": partial(by_axis, method=black_box),
}
"""Ours axis by axis and all axes together; then the rivals."""


def score(truth: Mapping[str, Truth], given: Mapping[str, Answer]) -> Row:
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
            bands += [std / drag[-1] for _, std in answer["drag"][-1:] if std is not None]
            if "added_mass" in answer:
                pairs.append((answer["added_mass"], true["added_mass"][AXES.index(axis)]))
            z += [abs(value - exact) / sigma for (value, sigma), exact in pairs if sigma is not None]
    if not said:
        return Row(0.0)
    error = float(np.median(errors))
    if not z:
        return Row(said / asked, error)
    covered = float(np.mean(np.array(z) < COVERED))
    return Row(said / asked, error, float(np.median(bands)), covered, max(z))


@dataclass(frozen=True, slots=True)
class Common:
    """Two answers over the axes to which both gave one: how many, and the row of each over these alone.

    Medians of two tools say little beside each other where one answers the easy half.
    """

    axes: int
    ours: Row
    theirs: Row


def common(truth: Mapping[str, Truth], ours: Mapping[str, Answer], theirs: Mapping[str, Answer]) -> Common:
    """Compare two answers over the axes that both gave.

    Parameters
    ----------
    truth, ours, theirs
        By record.

    Returns
    -------
    Common
        Errors of both.
    """

    def of_both(one: Mapping[str, Answer], other: Mapping[str, Answer]) -> dict[str, Answer]:
        """Answers of one, where the other has some too."""
        return {
            name: {axis: answer for axis, answer in axes.items() if axis in other.get(name, {})}
            for name, axes in one.items()
            if name in truth
        }

    first, second = of_both(ours, theirs), of_both(theirs, ours)
    return Common(sum(map(len, first.values())), score(truth, first), score(truth, second))


def read_answers(file: Path) -> dict[str, Answer]:
    """Answers of any tool. UsageError says what in them is not as `score` wants it."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{file}: is no JSON document that can be read ({error})") from error
    if not isinstance(found, dict) or not all(isinstance(one, dict) for one in found.values()):
        raise UsageError(f"{file}: wanted an object of records, each an object of axes")
    for name, axes in found.items():
        for axis, answer in axes.items():
            where = f"{file}: {name}, {axis}"
            if axis not in AXES:
                raise UsageError(f"{where}: wanted an axis of {', '.join(AXES)}")
            pairs = answer.get("drag") if isinstance(answer, dict) else None
            mass = answer.get("added_mass", [0.0, None]) if pairs else None
            if not isinstance(pairs, list) or len(pairs) != SPEEDS or not all(map(_is_pair, [*pairs, mass])):
                raise UsageError(
                    f"{where}: found {answer!r}, wanted drag: three pairs of a finite force and a deviation above 0 "
                    "(null where the tool has none), and added_mass: one pair, or nothing"
                )
    return found


def _is_pair(pair: object) -> bool:
    """A finite number, and its deviation or None."""
    if not isinstance(pair, list) or len(pair) != 2:
        return False
    value, std = pair
    numbers = [one for one in (value, std) if one is not None]
    finite = all(isinstance(one, int | float) and math.isfinite(one) for one in numbers)
    return finite and value is not None and (std is None or std > 0.0)
