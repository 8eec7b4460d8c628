"""Identification over recorded data of any origin: bags of ours, bags of others, CSV; one record or several pooled."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import yaml

from hindrax_bag.reader import messages
from hindrax_bringup.events import bag_events
from hindrax_bringup.foreign import Wanted, is_ours, read_bag, topics_of
from hindrax_bringup.identification import Identified, identify_bag
from hindrax_bringup.provenance import is_mock
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.state import IdentEvent, Phase, Thrust
from hindrax_core.topics import VEHICLE_FILE, resolved
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle, parse_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.conclude import Conclusion, unidentified
from hindrax_ident.csv_record import read_csv
from hindrax_ident.models import MOTIONS, motions_of
from hindrax_ident.readers import Recording, events, holds, measured, objection, tuned
from hindrax_ident.report import Trace
from hindrax_ident.report.comparison import Spread, spread_of
from hindrax_ident.results import MotionResult, Results, with_truth
from hindrax_ident.session import Outcome, Session
from hindrax_ident.suspicion import blamed, moves_against, suspected
from hindrax_ident.tuning import Tuning

APART_S = 1000.0
"""Records that are pooled are laid behind each other, this far apart: no stretch spans it."""
CSV_ENDINGS = (".csv", ".tsv", ".txt")


@dataclass(frozen=True, slots=True)
class Span:
    """Part of a record that is used, in seconds from its beginning."""

    from_s: float = 0.0
    to_s: float = math.inf

    @property
    def whole(self) -> bool:
        """Whether nothing is cut off."""
        return self.from_s <= 0.0 and math.isinf(self.to_s)


@dataclass(frozen=True, slots=True)
class Source:
    """One record: a bag of ours, or a recording (from a bag of others or from CSV)."""

    path: Path
    recording: Recording | None = None
    mock: bool = False

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What had to be assumed to read it."""
        return self.recording.assumptions if self.recording else ()


@dataclass(frozen=True, slots=True)
class Found:
    """What all records together say, and each by itself where there are several."""

    identified: Identified
    traces: dict[str, Trace] = field(default_factory=dict)
    runs: tuple[Results, ...] = ()
    spreads: dict[str, dict[str, Spread]] = field(default_factory=dict)


# ---- reading


def open_source(path: Path, wanted: Wanted, vehicle: Vehicle | None = None) -> Source:
    """Read a record; UsageError names what is missing or ambiguous. A run folder stands for its bag.

    `vehicle`, where one was named, makes newtons of pulses.
    """
    bag = path / "bag" if (path / "bag").is_dir() else path
    if not bag.exists():
        raise UsageError(f"{path}: does not exist; name a bag, a run folder or a CSV file")
    if bag.suffix.lower() in CSV_ENDINGS:
        return Source(bag, read_csv(_text(bag), str(bag), wanted.frame))
    topics = topics_of(bag)
    if is_ours(topics) and wanted == Wanted():
        return Source(bag, mock=is_mock(bag))
    return Source(bag, read_bag(bag, wanted, topics, vehicle))


def _text(file: Path) -> str:
    """Text in UTF-8, or as spreadsheets save it: UTF-16 with its mark, or Latin-1."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise UsageError(f"{file}: cannot be read ({error})") from error
    codes = ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8", "latin-1")
    for code in codes:
        try:
            return data.decode(code)
        except UnicodeDecodeError:
            continue
    raise UsageError(f"{file}: cannot be read as text, wanted UTF-8")


# ---- identification


@dataclass(frozen=True, slots=True)
class Task:
    """What is asked of records: axes (none: all that they hold), a part of each, and knobs for records of others.

    Where the mass is not known, nobody can say how much of the total is added mass.
    """

    axes: tuple[int, ...] = ()
    span: Span = Span()
    mass_known: bool = True
    tuning: Tuning = field(default_factory=Tuning)


def identify_sources(sources: Sequence[Source], vehicle: Vehicle, task: Task) -> Found:
    """Do a task over one record, or over several pooled."""
    whole = _together(sources, vehicle, task)
    if len(sources) == 1:
        return whole
    runs = tuple(_together([one], vehicle, task).identified.results for one in sources)
    results, spreads = _with_spread(whole.identified.results, runs)
    return replace(whole, identified=replace(whole.identified, results=results), runs=runs, spreads=spreads)


def _together(sources: Sequence[Source], vehicle: Vehicle, task: Task) -> Found:
    axes, span = task.axes or tuple(range(6)), task.span
    if len(sources) == 1 and sources[0].recording is None and span.whole:
        found = Found(identify_bag(sources[0].path, vehicle, mock=sources[0].mock))
        return replace(found, identified=_only(found.identified, axes))
    ours = [source for source in sources if source.recording is None]
    if ours and len(ours) < len(sources):
        raise UsageError(
            f"{ours[0].path} is a bag of this stack and others are not: pool records of one kind, "
            "or name topics with --odometry and --wrench for all of them"
        )
    if ours:
        session = Session(vehicle)
        _run(session, _ours(ours, vehicle, span))
        outcome = session.conclude()
        mock = all(source.mock for source in ours)
        results = with_truth(outcome.results, vehicle) if mock else outcome.results
        return Found(_only(Identified(outcome, results, mock), axes))
    recordings = [source.recording.between(span.from_s, span.to_s) for source in sources if source.recording]
    if not any(len(one.velocity_t) or len(one.attitude_t) for one in recordings):
        lasts = max(source.recording.end_s for source in sources if source.recording)
        raise UsageError(
            f"nothing was measured from {span.from_s:g} s to {span.to_s:g} s: the record lasts {lasts:.4g} s"
        )
    return _foreign(recordings, vehicle, task)


def _only(identified: Identified, axes: Sequence[int]) -> Identified:
    kept = {name: one for name, one in identified.results.motions.items() if MOTIONS[name].axis in axes}
    return replace(identified, results=replace(identified.results, motions=kept))


def _ours(sources: Sequence[Source], vehicle: Vehicle, span: Span) -> Iterator[Stamped[IdentEvent]]:
    """Events of bags of ours behind each other."""
    begin = Stamp(0)
    for source in sources:
        last = begin
        for event in _cut(bag_events(source.path, vehicle), span, begin):
            last = max(last, event.stamp)
            yield event
        last = after(last, 1e-3)
        yield Stamped(last, Phase("", ""))
        begin = after(last, APART_S)


def _cut(found: Iterator[Stamped[IdentEvent]], span: Span, begin: Stamp) -> Iterator[Stamped[IdentEvent]]:
    """Events of a span, moved so that the record begins at `begin`; phase and thrust in force there stay known."""
    first: Stamp | None = None
    before: dict[type, Stamped[IdentEvent]] = {}
    for event in found:
        first = event.stamp if first is None else first
        at_s = seconds_between(first, event.stamp)
        if at_s > span.to_s:
            return
        moved = Stamped(after(begin, at_s), event.reading)
        if at_s < span.from_s:
            if isinstance(event.reading, Phase | Thrust):
                before[type(event.reading)] = Stamped(after(begin, span.from_s), event.reading)
            continue
        yield from before.values()
        before = {}
        yield moved


def _foreign(recordings: Sequence[Recording], vehicle: Vehicle, task: Task) -> Found:
    """Every axis by a session of its own: in such a record all of them may move at once."""
    tuning, axes = tuned(recordings, task.tuning), task.axes or tuple(range(6))
    motions: dict[str, MotionResult] = {}
    conclusions: dict[int, Conclusion] = {}
    traces: dict[str, Trace] = {}
    for axis in axes:
        usable = [one for one in recordings if not objection(one, axis)]
        if usable:
            outcome, seen = _axis(usable, vehicle, axis, tuning)
            against = moves_against(usable, axis)
            found = {name: suspected(one, vehicle) for name, one in outcome.results.motions.items()}
            motions |= {name: blamed(one, against) for name, one in found.items()}
            conclusions |= outcome.conclusions
            traces |= seen
        elif task.axes or any(holds(one, axis) for one in recordings):
            motions |= _objected(recordings[0], axis)
    if not motions:
        # Nothing was excited: then the verdict on every axis that was measured is worth telling.
        motions = {
            name: one
            for axis in axes
            for name, one in _objected(recordings[0], axis).items()
            if measured(recordings[0], axis)
        }
    if not motions:
        raise UsageError(f"{recordings[0].source}: holds no axis with both velocities and forces that are numbers")
    if not task.mass_known:
        motions = {name: _without_mass(one) for name, one in motions.items()}
    results = Results(motions, vehicle)
    return Found(Identified(Outcome(results, conclusions), results, mock=False), traces)


def _without_mass(result: MotionResult) -> MotionResult:
    return replace(result, coefficients={key: one for key, one in result.coefficients.items() if key != "added_mass"})


def _objected(recording: Recording, axis: int) -> dict[str, MotionResult]:
    motion = motions_of(axis)[0]
    return {motion.name: unidentified(motion, objection(recording, axis))}


def _axis(
    recordings: Sequence[Recording], vehicle: Vehicle, axis: int, tuning: Tuning
) -> tuple[Outcome, dict[str, Trace]]:
    session = Session(vehicle, tuning)
    seen: dict[str, list[tuple[float, tuple[float, ...], tuple[float, ...]]]] = {}
    names: dict[str, tuple[str, ...]] = {}
    begin_s, first = 0.0, Stamp(0)
    for recording in recordings:
        for event in events(recording, axis, begin_s):
            if not first:
                first = event.stamp
            for estimate in session.step(event):
                told = estimate.reading
                names[told.motion] = told.names
                at_s = seconds_between(first, estimate.stamp)
                seen.setdefault(told.motion, []).append((at_s, told.values, told.sigmas))
        begin_s += recording.duration_s + APART_S
    traces = {motion: _trace(names[motion], rows) for motion, rows in seen.items()}
    return session.conclude(), traces


def _trace(names: tuple[str, ...], rows: list[tuple[float, tuple[float, ...], tuple[float, ...]]]) -> Trace:
    times, values, stds = (np.array(part) for part in zip(*rows, strict=True))
    columns = list(enumerate(names))
    return Trace(times, {name: values[:, i] for i, name in columns}, {name: stds[:, i] for i, name in columns})


def _run(session: Session, found: Iterator[Stamped[IdentEvent]]) -> None:
    for event in found:
        session.step(event)


# ---- several runs


def _with_spread(pooled: Results, runs: Sequence[Results]) -> tuple[Results, dict[str, dict[str, Spread]]]:
    """Widen the deviations of the pooled result where the runs scatter more than it says."""
    spreads: dict[str, dict[str, Spread]] = {}
    motions = {}
    for name, result in pooled.motions.items():
        own = [run.motions[name] for run in runs if name in run.motions]
        found = {key: spread for key in result.coefficients if (spread := _spread(own, key)) is not None}
        spreads[name] = found
        motions[name] = _widened(result, found)
    return replace(pooled, motions=motions), spreads


def _spread(own: Sequence[MotionResult], key: str) -> Spread | None:
    return spread_of([one.coefficients[key] for one in own if key in one.coefficients])


def _widened(result: MotionResult, spreads: Mapping[str, Spread]) -> MotionResult:
    """One factor for all, so that correlations stay: the largest by which a mean of the runs is less sure."""
    known = [(spread.std, result.coefficients[key].std) for key, spread in spreads.items()]
    factor = max([1.0, *(apart / own for apart, own in known if own > 0.0)])
    numbers = {
        key: replace(one, std=factor * one.std, std_calibrated=_hypot(one.std_calibrated, one.std, factor))
        for key, one in result.coefficients.items()
    }
    drag = result.drag
    if drag is not None:
        wide = array(np.sqrt(drag.std_calibrated**2 + drag.std**2 * (factor**2 - 1.0)))
        drag = replace(drag, std=array(factor * drag.std), std_calibrated=wide)
    return replace(result, coefficients=numbers, covariance=array(factor**2 * result.covariance), drag=drag)


def _hypot(calibrated: float, std: float, factor: float) -> float:
    """Deviation with calibration once the statistical part is wider by a factor."""
    return math.sqrt(calibrated**2 + std**2 * (factor**2 - 1.0)) if math.isfinite(calibrated) else calibrated


def axes_named(names: Sequence[str]) -> list[int]:
    """Axes of motions or axes by name, each once."""
    return list(dict.fromkeys(AXES.index(name) if name in AXES else MOTIONS[name].axis for name in names))


def recorded_vehicle(source: Source) -> Vehicle | None:
    """Vehicle that a bag of ours was recorded with: the file beside it, else the text inside it; None for others."""
    if source.recording is not None:
        return None
    beside = source.path.parent / "vehicle.yaml"
    if beside.is_file():
        return load_vehicle(beside)
    for message in messages(source.path, {resolved(VEHICLE_FILE)}):
        return parse_vehicle(yaml.safe_load(message.decoded().data), f"the vehicle file inside {source.path}")
    return None
