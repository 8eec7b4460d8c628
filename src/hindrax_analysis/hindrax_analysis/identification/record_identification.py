"""Identification over records of any origin: bags of this stack, third-party bags, CSV; one, or several pooled."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from hindrax_analysis.identification.bag_identification import Identified, identify_bag
from hindrax_analysis.identification.executor import HERE, Workers
from hindrax_analysis.identification.supply_at_rest import RestVolts, at_rest_volts
from hindrax_analysis.records.autopilot_log import ENDINGS, read_log
from hindrax_analysis.records.blueos_recording import recordings
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.own_bag import bag_events, is_mock, truth_in
from hindrax_analysis.records.recording import (
    Recording,
    are_parts,
    events,
    has_samples,
    has_signal,
    is_complete,
    joined,
    reason_to_skip,
    tuned,
)
from hindrax_analysis.records.third_party_bag import TopicSelection, is_ours, read_bag, topics_of
from hindrax_analysis.records.wrong_thrusters import wrong_thrusters
from hindrax_analysis.report.comparison import RunScatter, pool_runs
from hindrax_analysis.report.figures import Trace
from hindrax_bag.read.bag_reader import KINDS, VEHICLE_FILE, attached_vehicle, attachments
from hindrax_bag.read.mcap_records import Damage
from hindrax_core.errors import UsageError, cause
from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.signals import IdentEvent, Phase, Thrust
from hindrax_core.topics import ALLOCATION, ODOMETRY, resolved
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.assessment import Assessment, unidentified
from hindrax_ident.assess.objections import Objection
from hindrax_ident.assess.plausibility import Planar, planar, turned_by, with_mass_checks, with_plausibility_check
from hindrax_ident.assess.results import MotionResult, Results, with_truth
from hindrax_ident.model.motion_model import MOTIONS, motions_of
from hindrax_ident.online.coupled_masses import FoundMasses, with_found_masses
from hindrax_ident.online.session import Outcome, Session
from hindrax_ident.records.axis_record import Record
from hindrax_ident.records.feed import Feed
from hindrax_ident.records.turned_over import notes_on_turns
from hindrax_ident.tuning import Tuning

APART_S = 1000.0
"""Time between concatenated records: no stretch spans it."""
CSV_ENDINGS = (".csv", ".tsv", ".txt")
TABLES = (".xlsx", ".xls", ".ods", ".mat", ".npz", ".npy", ".parquet", ".feather", ".pkl", ".h5", ".hdf5")
"""Tables of spreadsheets, MATLAB and Python, which their programs save as CSV."""
NO_TEXT, LOOKED_AT = re.compile(r"[\0-\x08\x0e-\x1f]"), 4096
"""Characters of no text, and how many of a file are looked at: what a power cut left unwritten stands at its end."""
GAIN_SIGMA = 0.1
"""Relative uncertainty of a wrench without a thrust curve in the vehicle file [-]."""
AGAIN = ", with the masses that the axes have found"
LONG_S = 90.0
"""Time in records from which the axes are worth a process each."""
TRACE_S, TRACE_POINTS = 0.5, 2000.0
"""Longest time between the online estimates of a report, which takes a longer one for a pause; and how many it wants at
least: a chart draws a third of them."""


@dataclass(frozen=True, slots=True)
class Span:
    """Part of a record to use, in seconds from its beginning."""

    from_s: float = 0.0
    to_s: float = math.inf

    @property
    def whole(self) -> bool:
        """Whether it is the whole record."""
        return self.from_s <= 0.0 and math.isinf(self.to_s)


@dataclass(frozen=True, slots=True)
class RecordSource:
    """One record: a bag of this stack, or a recording (from a third-party bag or CSV)."""

    path: Path
    recording: Recording | None = None
    mock: bool = False
    parts: tuple[Path, ...] = ()
    """Files that were joined to the first."""
    damage: tuple[str, ...] = ()
    """What of a bag of this stack was left out."""
    volts: RestVolts | None = None
    """Supply of a bag of this stack, at rest before and after it, where no sensor measured it."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the record."""
        return (self.path, *self.parts)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Assumptions made to read it."""
        return self.recording.assumptions if self.recording else self.damage


# ---- reading


def open_sources(paths: Sequence[Path], wanted: TopicSelection, vehicle: Vehicle | None = None) -> list[RecordSource]:
    """Read records. A run folder stands for its bag.

    CSV files in sequence that hold different columns of the same time (one file per topic) are one record.

    Parameters
    ----------
    paths
        Bags, run folders, CSV files, logs.
    wanted
        Topics and body axes, where they are not clear.
    vehicle
        Converts pulses to newtons; None: not known.

    Returns
    -------
    list[RecordSource]
        One or more for each path.

    Raises
    ------
    UsageError
        Names what is missing or ambiguous.
    """
    sources: list[RecordSource] = []
    for path in paths:
        for found in _read(path, wanted, vehicle, part=len(paths) > 1):
            before = sources[-1] if sources else None
            if before and before.recording and found.recording and are_parts(before.recording, found.recording):
                parts = (*before.parts, found.path)
                sources[-1] = RecordSource(before.path, joined(before.recording, found.recording), parts=parts)
            else:
                sources.append(found)
    for index, source in enumerate(sources):
        if (recording := source.recording) is not None:
            if not is_complete(recording):
                has, lacks = ("forces", "velocities") if len(recording.wrench_t) else ("velocities", "forces")
                beside = f"name the file with the {lacks} of the same time beside it"
                raise UsageError(f"{source.path}: holds {has} alone; {beside}")
            whole = without_damage(recording)
            notes = notes_on_turns(whole.attitude_t, whole.attitude)
            sources[index] = replace(source, recording=replace(whole, assumptions=(*whole.assumptions, *notes)))
    return sources


def _read(path: Path, wanted: TopicSelection, vehicle: Vehicle | None, *, part: bool) -> list[RecordSource]:
    """Read what a path holds: one record, or several where its time begins again."""
    bag = path / "bag" if (path / "bag").is_dir() else path
    if not bag.exists():
        raise UsageError(f"{path}: does not exist; name a bag, a run folder, a CSV file or a log of ArduPilot or PX4")
    if bag.suffix.lower() in CSV_ENDINGS:
        found = read_records(_text(bag), str(bag), wanted.frame, part=part, vehicle=vehicle)
        return [RecordSource(bag, one) for one in found]
    if logs := [bag] if bag.suffix.lower() in ENDINGS else recordings(bag):
        return [RecordSource(log, one) for log in logs for one in read_log(log, vehicle)]
    if bag.is_file() and bag.suffix.lower() in TABLES:
        remedy = "save it as CSV, with a line of column names above (`./hindrax identify --help` lists them)"
        raise UsageError(f"{path}: is a table in a format that is not read; {remedy}")
    try:
        topics = topics_of(bag, damage := Damage())
    except UsageError as error:
        if bag.is_dir() or bag.suffix.lower() in KINDS:
            raise
        wants = ", ".join((*KINDS, *CSV_ENDINGS, *ENDINGS))
        raise UsageError(f"{error}; wanted a bag, a run folder, or a file that ends in one of {wants}") from error
    if is_ours(topics) and wanted == TopicSelection():
        return [RecordSource(bag, mock=is_mock(bag), damage=tuple(damage.sentences))]
    if resolved(ALLOCATION) in topics and wanted == TopicSelection():
        raise UsageError(
            f"{path}: is a bag of this stack, and no maneuver was flown in it; manual flight can be identified"
            f" with --odometry {resolved(ODOMETRY)}"
        )
    try:
        return [RecordSource(bag, one) for one in read_bag(bag, wanted, topics, vehicle)]
    except UsageError as error:
        # A topic that is not there may be what a damaged file has lost.
        raise UsageError("; ".join([str(error), *damage.sentences])) from error


def _text(file: Path) -> str:
    """Text in UTF-8, or as saved by spreadsheets: UTF-16 with its mark or without it, or Latin-1.

    Zeros at its end are blocks that a power cut left unwritten.
    """
    try:
        data = file.read_bytes()
    except OSError as error:
        raise UsageError(f"{file}: cannot be read ({cause(error)})") from error
    # The first character of a header line is below 256: beside it stands a zero.
    unmarked = {0: "utf-16-be", 1: "utf-16-le"}.get(data[:2].find(b"\0"), "utf-8")
    codes = ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else (unmarked, "latin-1")
    for code in codes:
        try:
            text = data.decode(code).rstrip("\0")
        except UnicodeDecodeError:
            continue
        if NO_TEXT.search(text[:LOOKED_AT]):
            remedy = "unpack it where it is compressed, else save it as CSV, or name it by its kind, such as .bin"
            raise UsageError(f"{file}: holds no text, by its first characters; {remedy}")
        return text
    raise UsageError(f"{file}: cannot be read as text, wanted UTF-8")


# ---- identification


def usual_gain_sigma(vehicle: Vehicle, source: RecordSource) -> float:
    """Relative deviation of a wrench's gain beyond the curves of the vehicle file [-]; none where these made it."""
    return 0.0 if source.recording is None or vehicle.thrusters else GAIN_SIGMA


@dataclass(frozen=True, slots=True)
class IdentificationTask:
    """Options: axes (none: all available), part of each record, and knobs for third-party records.

    Without `mass_known`, the added mass cannot be separated from the total. With `traced`, the online estimates of a
    third-party record are kept for a report: they take a sixth of the time.
    """

    axes: tuple[int, ...] = ()
    span: Span = Span()
    mass_known: bool = True
    tuning: Tuning = field(default_factory=Tuning)
    traced: bool = False


def identify_sources(
    sources: Sequence[RecordSource],
    vehicle: Vehicle,
    task: IdentificationTask,
    progress: Callable[[str], None] = lambda _text: None,
    reached: Callable[[str], None] = lambda _text: None,
    *,
    workers: Workers = HERE,
) -> Identified:
    """Identify over one record, or over several pooled and each by itself.

    Parameters
    ----------
    sources
        Records.
    vehicle
        With its thrusters.
    task
        Which motions, which part of the time, which tuning.
    progress
        Called with records that are done.
    reached
        Called with steps, where they are taken in this process.
    workers
        Several records are one job each; a recording alone has one for each axis.

    Returns
    -------
    Identified
        Of all of them together, with each by itself beside it.
    """
    if len(sources) == 1 and sources[0].recording is not None:
        return _identify(sources, vehicle, task, reached, workers=workers)
    told = (reached,) if workers.here else ()
    groups = [sources, *([one] for one in sources if len(sources) > 1)]
    jobs = [partial(_identify, group, vehicle, task, *told) for group in groups]
    if len(jobs) == 1:
        return next(workers.run(jobs))
    found = workers.run(jobs)
    whole, runs = next(found), []
    progress(f"identified over {len(sources)} records together")
    for index, (one, alone) in enumerate(zip(sources, found, strict=True), start=1):
        progress(f"identified over {one.path} alone, {index} of {len(sources)}")
        runs.append(alone.results)
    results, spreads = _with_spread(whole.results, runs)
    return replace(whole, results=results, runs=tuple(runs), spreads=spreads)


def worthwhile(workers: Workers, sources: Sequence[RecordSource]) -> Workers:
    """Short records stay in this process where nobody asked for others: each of those takes seconds to begin."""
    lasts_s = sum(one.recording.duration_s for one in sources if one.recording)
    return HERE if workers.processes is None and not workers.cluster and lasts_s < LONG_S else workers


def _identify(
    sources: Sequence[RecordSource],
    vehicle: Vehicle,
    task: IdentificationTask,
    progress: Callable[[str], None] = lambda _text: None,
    *,
    workers: Workers = HERE,
) -> Identified:
    axes, span = task.axes or tuple(range(6)), task.span
    if len(sources) == 1 and sources[0].recording is None and span.whole:
        (one,) = sources
        found = identify_bag(one.path, vehicle, mock=one.mock, tuning=task.tuning, progress=progress, volts=one.volts)
        return _with_axes_only(found, axes)
    ours = _own(sources)
    if ours:
        outcome = _session_over(_own_events(ours, vehicle, span), vehicle, task.tuning).finalize(progress)
        if not outcome.results.motions:
            end = "on" if math.isinf(span.to_s) else f"to {span.to_s:g} s"
            found_none = f"no motion was flown from {span.from_s:g} s {end}"
            raise UsageError(f"{found_none}; `./hindrax bag plot` shows when it was")
        mock = all(source.mock for source in ours)
        truths = [truth_in(source.path, vehicle) for source in ours if mock]
        # Runs in different worlds have no truth in common.
        same = truths and all(one == truths[0] for one in truths)
        results = with_truth(outcome.results, truths[0]) if same else outcome.results
        return _with_axes_only(Identified(outcome, results, mock), axes)
    recordings = [source.recording.between(span.from_s, span.to_s) for source in sources if source.recording]
    if not any(one.measured_t for one in recordings):
        lasts = max(source.recording.end_s for source in sources if source.recording)
        raise UsageError(
            f"nothing was measured from {span.from_s:g} s to {span.to_s:g} s: the record lasts {lasts:.4g} s"
        )
    return _identify_recordings(recordings, vehicle, task, progress, workers)


def _own(sources: Sequence[RecordSource]) -> list[RecordSource]:
    """All sources if they are bags of this stack, or none; UsageError where they are mixed."""
    ours = [source for source in sources if source.recording is None]
    if ours and len(ours) < len(sources):
        raise UsageError(
            f"{ours[0].path} is a bag of this stack, and others are not: pool records of one kind, "
            "or name topics with --odometry and --wrench for all of them"
        )
    return ours


def axis_records(sources: Sequence[RecordSource], vehicle: Vehicle, task: IdentificationTask) -> dict[int, Record]:
    """Velocities, thrust and usable stretches of each axis that was excited, as the identification takes them.

    Parameters
    ----------
    sources
        Records.
    vehicle
        With its thrusters.
    task
        Which motions, which part of the time, which tuning.

    Returns
    -------
    dict[int, Record]
        By axis (0 to 5).
    """
    wanted = task.axes or tuple(range(6))
    ours = _own(sources)
    out: dict[int, Record] = {}
    if ours:
        session = _session_over(_own_events(ours, vehicle, task.span), vehicle, task.tuning)
        out = {axis: session.record(axis) for axis in session.axes if axis in wanted}
    recordings = [source.recording.between(task.span.from_s, task.span.to_s) for source in sources if source.recording]
    tuning = tuned(recordings, task.tuning)
    for axis in wanted if recordings else ():
        usable = [one for one in recordings if not reason_to_skip(one, axis)]
        if usable:
            events_of_axis = Feed(vehicle, tuning).all(_concatenated(usable, axis))
            out[axis] = _session_over(events_of_axis, vehicle, tuning).record(axis)
    return out


def _with_axes_only(identified: Identified, axes: Sequence[int]) -> Identified:
    kept = {name: one for name, one in identified.results.motions.items() if MOTIONS[name].axis in axes}
    return replace(identified, results=replace(identified.results, motions=kept))


def _own_events(sources: Sequence[RecordSource], vehicle: Vehicle, span: Span) -> Iterator[Stamped[IdentEvent]]:
    flown = [at_rest_volts(bag_events(source.path, vehicle), vehicle, source.volts) for source in sources]
    return events_apart(flown, span)


def events_apart(
    records: Sequence[Iterator[Stamped[IdentEvent]]], span: Span = Span()
) -> Iterator[Stamped[IdentEvent]]:
    """Events of records one after the other, so far apart that no stretch spans two."""
    begin = Stamp(0)
    for record in records:
        last = begin
        for event in _cut(record, span, begin):
            last = max(last, event.stamp)
            yield event
        last = after(last, 1e-3)
        yield Stamped(last, Phase("", ""))
        begin = after(last, APART_S)


def _cut(found: Iterator[Stamped[IdentEvent]], span: Span, begin: Stamp) -> Iterator[Stamped[IdentEvent]]:
    """Events of a span, shifted so that the record begins at `begin`; phase and thrust at its start are kept."""
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


def _identify_recordings(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    task: IdentificationTask,
    progress: Callable[[str], None],
    workers: Workers,
) -> Identified:
    """Identify each axis in a separate session: in such a record all axes may move at once."""
    tuning, axes = tuned(recordings, task.tuning), task.axes or tuple(range(6))
    motions: dict[str, MotionResult] = {}
    assessments: dict[int, Assessment] = {}
    traces: dict[str, Trace] = {}
    against = wrong_thrusters(recordings, vehicle)
    usable_on = {
        axis: [one for one in recordings if not (axis in against or reason_to_skip(one, axis))] for axis in axes
    }
    flown = {axis: usable for axis, usable in usable_on.items() if usable}

    def fit_all(masses: FoundMasses) -> list[Outcome]:
        """One pass over all axes, in processes of their own where there are any."""
        each = partial(_axis, vehicle=vehicle, tuning=tuning, traced=task.traced and not masses, masses=masses)
        outcomes: list[Outcome] = []
        jobs = [partial(each, axis, usable) for axis, usable in flown.items()]
        for axis, (outcome, seen) in zip(flown, workers.run(jobs), strict=True):
            progress(f"fit and uncertainty of {AXES[axis]}{AGAIN if masses else ''}")
            outcomes.append(outcome)
            traces.update(seen)
        return outcomes

    found = dict(zip(flown, with_found_masses(vehicle, fit_all), strict=True))
    turned = turned_by([_planar(one) for one in recordings])
    for axis, usable in usable_on.items():
        if usable:
            results_of = found[axis].results.motions.items()
            motions |= {name: with_plausibility_check(one, vehicle, turned) for name, one in results_of}
            assessments |= found[axis].assessments
        elif task.axes or any(has_signal(one, axis) for one in recordings):
            motions |= _skipped(recordings[0], axis, against)
    if not motions:
        # No axis was excited: report the verdict on every measured axis.
        for axis in axes:
            motions |= _skipped(recordings[0], axis, against) if has_samples(recordings[0], axis) else {}
    if not motions:
        raise UsageError(
            f"{recordings[0].source}: has no axis with both finite velocities and finite forces; a velocity without "
            "bottom lock, or of a variance below 0 or of 1000 and more, counts as not measured; an unknown one is 0"
        )
    results = Results({name: _weighed(one, vehicle, task) for name, one in motions.items()}, vehicle)
    return Identified(Outcome(results, assessments), results, mock=False, traces=traces)


def _planar(recording: Recording) -> Planar:
    """Thrusts and velocities of surge and sway, where both are known."""
    commanded = np.isfinite(recording.wrench[:, :2]).all(axis=1)
    moved = np.isfinite(recording.velocity[:, :2]).all(axis=1)
    turned = np.isfinite(recording.velocity[:, 5])
    return planar(
        (recording.wrench_t[commanded], recording.wrench[commanded, :2]),
        (recording.velocity_t[moved], recording.velocity[moved, :2]),
        (recording.velocity_t[turned], recording.velocity[turned, 5]),
    )


def _weighed(one: MotionResult, vehicle: Vehicle, task: IdentificationTask) -> MotionResult:
    """What the mass of the vehicle file says of a motion; without one, no added mass is told."""
    if task.mass_known:
        return with_mass_checks(one, vehicle)
    kept = {key: number for key, number in one.coefficients.items() if key != "added_mass"}
    return replace(one, coefficients=kept)


def _skipped(recording: Recording, axis: int, against: Mapping[int, Objection]) -> dict[str, MotionResult]:
    motion = motions_of(axis)[0]
    return {motion.name: unidentified(motion, against.get(axis) or reason_to_skip(recording, axis))}


def _axis(
    axis: int, recordings: Sequence[Recording], vehicle: Vehicle, tuning: Tuning, masses: FoundMasses, *, traced: bool
) -> tuple[Outcome, dict[str, Trace]]:
    every_s = min(TRACE_S, sum(one.duration_s for one in recordings) / TRACE_POINTS) if traced else math.inf
    feed, session = Feed(vehicle, tuning), Session(vehicle, tuning, every_s=every_s)
    seen: dict[str, list[tuple[float, tuple[float, ...], tuple[float, ...]]]] = {}
    names: dict[str, tuple[str, ...]] = {}
    first = Stamp(0)
    for event in feed.all(_concatenated(recordings, axis)):
        first = first or event.stamp
        for estimate in session.step(event):
            reading = estimate.reading
            names[reading.motion] = reading.names
            at_s = seconds_between(first, estimate.stamp)
            seen.setdefault(reading.motion, []).append((at_s, reading.values, reading.sigmas))
    traces = {motion: Trace(names[motion], *map(np.array, zip(*rows, strict=True))) for motion, rows in seen.items()}
    return session.finalize(found_masses=masses), traces


def _concatenated(recordings: Sequence[Recording], axis: int) -> Iterator[Stamped[IdentEvent]]:
    begin_s = 0.0
    for recording in recordings:
        yield from events(recording, axis, begin_s)
        begin_s += recording.duration_s + APART_S


def _session_over(found: Iterator[Stamped[IdentEvent]], vehicle: Vehicle, tuning: Tuning) -> Session:
    session = Session(vehicle, tuning, every_s=math.inf)
    for event in found:
        session.step(event)
    return session


# ---- several runs


def _with_spread(pooled: Results, runs: Sequence[Results]) -> tuple[Results, dict[str, dict[str, RunScatter]]]:
    """Widen the deviations of the pooled result where the scatter between runs is larger."""
    spreads: dict[str, dict[str, RunScatter]] = {}
    motions = {}
    for name, result in pooled.motions.items():
        own = [run.motions[name].coefficients for run in runs if name in run.motions]
        found = {key: pool_runs([one[key] for one in own if key in one]) for key in result.coefficients}
        spreads[name] = {key: spread for key, spread in found.items() if spread is not None}
        motions[name] = widened_by_scatter(result, spreads[name])
    return replace(pooled, motions=motions), spreads


def widened_by_scatter(result: MotionResult, spreads: Mapping[str, RunScatter]) -> MotionResult:
    """Widen each coefficient by what differs between the runs, and keep the correlations."""
    own = {key: one.std for key, one in result.coefficients.items()}
    ratio = {key: max(1.0, spreads[key].std / std) if key in spreads and std > 0.0 else 1.0 for key, std in own.items()}
    numbers = {}
    for key, one in result.coefficients.items():
        # Of the deviation with calibration only the statistical part grows; NaN stays.
        more = one.std * math.sqrt(ratio[key] ** 2 - 1.0)
        numbers[key] = replace(
            one,
            std=ratio[key] * one.std,
            std_calibrated=math.hypot(one.std_calibrated, more),
            corrected=one.corrected and one.corrected.widened(more),
        )
    scale = np.array([ratio.get(name, 1.0) for name in result.names])
    widened = replace(result, coefficients=numbers, covariance=array(result.covariance * np.outer(scale, scale)))
    if result.drag is None:
        return widened
    std = array([widened.drag_force(speed)[1] for speed in result.drag.speed.tolist()])
    added = np.maximum(0.0, std**2 - result.drag.std**2)
    step = result.next_step and replace(result.next_step, std=math.hypot(result.next_step.std, math.sqrt(added[-1])))
    corrected = result.drag.corrected and result.drag.corrected.widened(array(np.sqrt(added)))
    calibrated = np.sqrt(result.drag.std_calibrated**2 + added)
    drag = replace(result.drag, std=std, std_calibrated=calibrated, corrected=corrected)
    return replace(widened, drag=drag, next_step=step)


def axes_named(names: Sequence[str]) -> list[int]:
    """Axes of motions or axes by name, each once. UsageError for an unknown name."""
    for name in names:
        if name not in AXES and name not in MOTIONS:
            raise UsageError(f"found {name!r}, wanted some of {', '.join(dict.fromkeys((*AXES, *MOTIONS)))}")
    return list(dict.fromkeys(AXES.index(name) if name in AXES else MOTIONS[name].axis for name in names))


def recorded_vehicle(source: RecordSource) -> Vehicle | None:
    """Vehicle of a bag of this stack: the file beside it, else the one inside it; None for third-party records."""
    if source.recording is not None:
        return None
    beside = source.path.parent / VEHICLE_FILE
    if beside.is_file():
        return load_vehicle(beside)
    inside = attachments(source.path)
    return attached_vehicle(source.path, inside) if VEHICLE_FILE in inside else None
