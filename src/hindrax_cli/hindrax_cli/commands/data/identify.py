"""`hindrax identify`: the identification over recorded data, of this stack or third-party."""

import argparse
import contextlib
import shlex
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from hindrax_analysis.coefficients_file import ResultConditions, SavedCoefficients, as_yaml
from hindrax_analysis.identification.bag_identification import (
    Identified,
    recorded_conditions,
    show,
    write,
    write_report,
)
from hindrax_analysis.identification.executor import add_workers, workers_of
from hindrax_analysis.identification.joint_identification import (
    contradicted,
    filters_found,
    identify_jointly,
    lags_found,
    mean_found,
    show_joint,
    wants_joint_fit,
)
from hindrax_analysis.identification.record_identification import (
    GAIN_SIGMA,
    IdentificationTask,
    RecordSource,
    Span,
    axes_named,
    identify_sources,
    open_sources,
    recorded_vehicle,
    usual_gain_sigma,
    worthwhile,
)
from hindrax_analysis.identification.verdict import NextCommand, NextFlight, NextReport, show_next
from hindrax_analysis.records.autopilot_vehicle import A_SIMULATOR, BOX, OF_THE_SIMULATOR, logged_wiring, wired
from hindrax_analysis.records.csv.columns import COLUMNS
from hindrax_analysis.records.csv.thrusters import MEANING, OUTPUTS
from hindrax_analysis.records.third_party_bag import FRAMES, TopicSelection
from hindrax_analysis.terminal import print_answer, working
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.argument_types import add_json, named_vehicle, within
from hindrax_cli.command import command, option
from hindrax_cli.command_line import is_here
from hindrax_cli.vehicle_edit import text_behind
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.refusals import THRUSTERS_BY_HAND, from_sentence
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.text.text_file import require_place
from hindrax_core.vehicle import AXES, VEHICLE_OF_FRAME, Vehicle, load_vehicle, vehicle_from_text
from hindrax_ident.assess.results import Results
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_ident.tuning import Tuning

NO_VEHICLE = (
    "no --vehicle was named: dimensionless numbers are for the size of the Hindrax, and the added mass is left out; "
    "a file with name, mass_kg, volume_m3 and envelope_m is enough"
)
OF_ANOTHER = (
    "the record is of {recorded}, --vehicle names {named}: thrust, mass and size of {named} are used; without it "
    "the file in the record is"
)
FILTERED = "for the fit of all axes together a filter of {longest_s:.2g} s is undone, which the velocities seem to have"
UNNAMED = "unnamed vehicle"
"""Not by the name of the Hindrax: what the paper has of that would stand beside it."""
ALL = "all"
CHOICES = (*AXES, *(name for name in MOTIONS if name not in AXES))
ABOUT = """
Bags of this stack reproduce the numbers of their pool test. In third-party bags (MCAP or sqlite3) velocities are found
as Odometry, TwistStamped or TwistWithCovarianceStamped, without these as reports of a DVL (marine_acoustic_msgs/Dvl,
dvl_msgs/DVL, in the axes of the instrument); rates and attitude that they lack are those of the only Imu, depths those
of the only FluidPressure; forces are found as WrenchStamped or Wrench. Body axes follow from the name of the frame:
*_fsd, *_frd or *_ned point down, and so does a body in a world of such a name; others are REP-103 and are turned;
--frame overrides. Stamps that step back begin another record. Where --wrench and --odometry name them, pulses
(UInt16MultiArray, mavros RCOut and the like) become forces by the thrust curves of the vehicle file, and poses become
velocities.
Logs of ArduPilot (.bin, .tlog, recordings of BlueOS) and PX4 (.ulg) give velocities and attitude of its estimator and
the pulses of the outputs, at the logged voltage.
Several records of one vehicle are pooled, and the spread between them is shown. CSV files one after the other that
hold different columns of the same time (one file per topic, as `rostopic echo -p` or PlotJuggler write them) are one
record. Invalid samples are left out and reported: zeros of a DVL without lock, numbers that stand for none (-32.768),
values of a frozen or saturated sensor, outliers, heave while the thrust presses the vehicle against the surface, an
axis at rest under a thrust that moves it at other times (held, or the thrusters were off), and roll and pitch while it
is turned over about the other of them; velocities and rates that the pose beside them shows to be those of the world
are turned into body axes; a filter that has smoothed the velocities is undone; velocities that came in
bursts, and lines that share the times of a coarse clock, are spread evenly; lines of several trials that are mixed
are reported.

columns of a CSV record (SNAME axes, those of ROS for fields of Twist and Wrench, or --frame; SI units, or others in
the header line such as "u [cm/s]" or t_ms; names like vx, surge_force or as of PlotJuggler serve too; angles and
rates without a unit are in degrees where their size or each other says so; empty cells where a row says nothing;
others are ignored):
"""


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Options that select from the records, for `opened`."""
    add = parser.add_argument
    add("--odometry", default="", metavar="TOPIC", help="velocities; default: found by type")
    forces = (
        "forces, or TOPIC:FIELD=us, N or ratio for an array with a value per output; with a * in TOPIC for the number "
        "where each thruster has one; default: found by type"
    )
    add("--wrench", default="", metavar="TOPIC", help=forces)
    axes = "axes; default: by the frame name; world: velocities of an odometry"
    add("--frame", choices=FRAMES, default="", help=axes)
    add("--dof", nargs="+", default=[], choices=(*CHOICES, ALL), metavar="MOTION", help="default: all that moved")
    add("--from", dest="from_s", type=float, default=0.0, metavar="S", help="begin here [s]")
    add("--to", dest="to_s", type=float, default=float("inf"), metavar="S", help="end here [s]")


def opened(arguments: argparse.Namespace) -> tuple[Vehicle | None, list[RecordSource], IdentificationTask]:
    """The vehicle that is named, the records, and the axes and part asked for; UsageError for an empty part."""
    if not arguments.to_s > arguments.from_s:
        raise UsageError(f"--to {arguments.to_s:g}: wanted more than --from {arguments.from_s:g}")
    topics = TopicSelection(arguments.odometry, arguments.wrench, arguments.frame)
    named = _with_wiring(arguments.records, load_vehicle(arguments.vehicle) if arguments.vehicle else None)
    axes = tuple(axes_named([] if ALL in arguments.dof else arguments.dof))
    task = IdentificationTask(axes, Span(arguments.from_s, arguments.to_s))
    return named, open_sources(arguments.records, topics, named), task


SIMULATED = f"{A_SIMULATOR}, whose own vehicle is assumed; behind Gazebo or another simulator it is another one"
"""Sentence about the vehicle of a simulator's log."""


def _with_wiring(records: Sequence[Path], named: Vehicle | None) -> Vehicle | None:
    """The vehicle that an ArduSub's log describes, where none is named; one of the box is wired as the log says."""
    wiring = logged_wiring(records)
    if wiring is None:
        return named
    if not wiring.motors:
        print_stderr(
            "note: the log's parameters name no outputs (SERVOn_FUNCTION): the outputs of the vehicle file are assumed"
        )
    if wiring.simulated and named is not None and named.name in BOX:
        print_stderr(f"note: {OF_THE_SIMULATOR.format(kind=named.name)}")
    if named is None and wiring.kind:
        whose = SIMULATED if wiring.simulated else f"the log's frame belongs to {wiring.kind}, whose hull is assumed"
        print_stderr(f"note: no --vehicle was named; {whose}")
        return wired(vehicle_from_text(text_behind(wiring), wiring.kind), wiring)
    if named is None:
        known = ", ".join(f"{frame} ({name})" for frame, name in VEHICLE_OF_FRAME.items())
        raise UsageError(
            f"the log's FRAME_CONFIG is {wiring.frame}, wanted one of a vehicle in the box, {known}; "
            f"name a vehicle file with --vehicle; {THRUSTERS_BY_HAND}"
        )
    if named.name in BOX:
        return wired(named, wiring)
    if turned := wiring.turned:
        names = ", ".join(f"T{motor}" for motor in turned)
        print_stderr(f"note: by the log's parameters {names} turn the other way; is that in {named.name}'s file?")
    return named


def _about(parser: argparse.ArgumentParser) -> None:
    columns = "\n".join(f"  {name:<8} {meaning}" for name, meaning in {**COLUMNS, OUTPUTS: MEANING}.items())
    parser.description = f"{parser.description}\n{ABOUT}{columns}"


@command(
    "./hindrax identify pool.mcap --vehicle myrov.yaml --odometry /odom --wrench /thrust --dof surge "
    "--report pool.html",
    _about,
    option(
        "records", nargs="+", type=Path, metavar="BAG_OR_CSV", help="bag, run folder, CSV file, .bin, .tlog or .ulg"
    ),
    named_vehicle("vehicle: its file, or its name; mass, volume and envelope are enough"),
    add_selection,
    option(
        "--gain-sigma",
        type=within(float, 0.0, 1.0),
        metavar="SHARE",
        help=f"deviation of the wrench's gain; default: by the vehicle file, {GAIN_SIGMA:g} where it has no thrusters",
    ),
    option(
        "--joint",
        action="store_true",
        default=None,
        help="also fit all axes together, with the terms that couple them; default: where several are pushed at once",
    ),
    option("--no-joint", dest="joint", action="store_false", default=None, help="fit them axis by axis alone"),
    partial(add_workers, processes=None, usual="one per core for more than 90 s of records"),
    option("--report", type=Path, metavar="FILE", help="write an HTML report"),
    option("--coefficients", type=Path, metavar="FILE", help="write a coefficients.yaml"),
    add_json,
)
def identify(arguments: argparse.Namespace) -> int:
    """Identify from recorded data: our bags, third-party bags, CSV, logs of ArduPilot and PX4."""
    for file in filter(None, (arguments.report, arguments.coefficients)):
        require_place(file)
    named, sources, task = opened(arguments)
    vehicle, notes = _vehicle(named, sources[0])
    began = time.monotonic()
    gain_sigma = _gain_sigma(arguments.gain_sigma, vehicle, sources[0], notes)
    task = replace(
        task,
        mass_known=NO_VEHICLE not in notes,
        tuning=Tuning(wrench_gain_sigma=gain_sigma),
        traced=arguments.report is not None,
    )
    with working(f"identifying over {', '.join(str(path) for path in arguments.records)}") as reached:
        workers = worthwhile(workers_of(arguments), sources)
        found = identify_sources(sources, vehicle, task, print_stderr, reached, workers=workers)
        steps = (reached,) if workers.here else ()
        together, why = arguments.joint, ""
        if arguments.joint is None:
            together, why = wants_joint_fit(sources, task, found.results)
        notes += [why] if why else []
        filters_s = filters_found(found.results) if together else {}
        notes += [FILTERED.format(longest_s=max(filters_s.values()))] if filters_s else []
        jointly = partial(identify_jointly, sources, vehicle, task, *steps, filters_s=filters_s)
        alone = found.results
        jobs = [partial(jointly, later_s=lags_found(alone), against=mean_found(alone))] if together else []
        try:
            joint = next(workers.run(jobs), None)
            joint = joint and contradicted(joint, alone)
        except UsageError as error:
            if arguments.joint:
                raise
            joint, notes = None, [*notes, f"no fit of all axes together: {error}"]
    took_s = time.monotonic() - began
    ours = [source.path for source in sources if source.recording is None]
    files = [file for source in sources for file in source.files]
    assumed = dict.fromkeys([*notes, *(one for source in sources for one in source.assumptions)])
    conditions = recorded_conditions(found, files, ours, tuple(assumed))
    if arguments.report:
        runs = [_saved(source, results, conditions) for source, results in zip(sources, found.runs, strict=False)]
        write_report(arguments.report, found, conditions, ours[0] if ours and len(sources) == 1 else None, *runs)
    if arguments.coefficients:
        write(arguments.coefficients, as_yaml(found.results, conditions, joint))
    recorded_s = sum(source.recording.duration_s for source in sources if source.recording)
    factor = round(recorded_s / took_s, 2) if recorded_s and took_s > 0.0 else None
    document = found.document(sources[0].path, arguments.report, factor, from_sentence(conditions.aborted))
    document |= {"assumptions": conditions.assumptions, **_runs(sources, found)}
    document |= {"joint": joint.to_json()} if joint else {}

    def show_all() -> None:
        """All together, then axis by axis: the verdicts and the next step are the last screen."""
        _show_notes(found, conditions)
        if joint:
            show_joint(joint, asked=bool(arguments.joint))
        following = _next(arguments, sources, vehicle)
        show(found, reported=bool(arguments.report), ending=partial(_show_ending, arguments, found, following))

    return print_answer(document, show_all, as_json=arguments.json)


def _vehicle(named: Vehicle | None, source: RecordSource) -> tuple[Vehicle, list[str]]:
    """Vehicle, and the assumptions about it."""
    if named is not None:
        recorded = None
        with contextlib.suppress(HindraxError):  # who names a file may do so because that of the record is damaged
            recorded = recorded_vehicle(source)
        if recorded is None or recorded.name == named.name:
            return named, []
        return named, [OF_ANOTHER.format(recorded=recorded.name, named=named.name)]
    recorded = recorded_vehicle(source)
    if recorded is not None:
        return recorded, []
    ours = load_vehicle(default_vehicle())
    return Vehicle(UNNAMED, ours.mass_kg, ours.volume_m3, ours.envelope_m), [NO_VEHICLE]


def _gain_sigma(given: float | None, vehicle: Vehicle, source: RecordSource, notes: list[str]) -> float:
    """Standard deviation of the wrench's gain, beyond the curves of the vehicle file."""
    sigma = usual_gain_sigma(vehicle, source) if given is None else given
    if given is None and not sigma:
        return 0.0
    notes.append(
        f"the gain of the wrench is assumed within {sigma:.0%} (--gain-sigma): it is part of the calibrated uncertainty"
    )
    return sigma


def _saved(source: RecordSource, results: Results, conditions: ResultConditions) -> SavedCoefficients:
    """One of several records, as the report shows earlier runs."""
    label = source.path.parent.name if source.path.name == "bag" else source.path.stem
    return SavedCoefficients(label, conditions, results.motions)


def _runs(sources: list[RecordSource], found: Identified) -> dict[str, object]:
    """With several records, each by itself and the spread between them."""
    if not found.runs:
        return {}
    runs = [{"bag": str(source.path), **results.to_json()} for source, results in zip(sources, found.runs, strict=True)]
    return {"runs": runs, "spread": found.spreads}


def _delays(lag_s: float, latency_s: float) -> str:
    """Delays of thrust and velocities to the commands and to each other."""
    late = "early" if round(latency_s, 2) < 0.0 else "late"
    return f"thrust {lag_s:.2f} s; velocity stamps {abs(latency_s):.2f} s too {late}"


def _show_notes(found: Identified, conditions: ResultConditions) -> None:
    """Assumptions, delays, spread of the runs: what the result is to be read with."""
    for assumption in conditions.assumptions:
        print_stderr(f"assumed: {assumption}")
    if conditions.aborted:
        print_stderr(f"aborted by {conditions.aborted}; the results are of the part flown until then")
    foreign = not conditions.mock and found.origin is None
    delays: dict[str, list[str]] = {}
    for motion, result in found.results.motions.items() if foreign else ():
        # Those of a refused fit are of anything: 1.00 s of a thrust that nobody flew.
        if result.quality and result.identifiable:
            delays.setdefault(_delays(result.quality["lag_s"], result.quality["latency_s"]), []).append(motion)
    for words, motions in delays.items():
        print_fitted(f"{', '.join(motions)}: estimated delays: {words}")
    for motion, spreads in found.spreads.items():
        if spreads:
            runs = max(one.runs for one in spreads.values())
            ratios = ", ".join(f"{key} {one.ratio:.1f}" for key, one in spreads.items())
            print_fitted(f"{motion}: scatter of {runs} runs in their deviations, 1 is expected: {ratios}")
    if not found.results.motions:
        print_stderr("no motion was flown in this record; `./hindrax bag info` lists its contents")


def _show_ending(arguments: argparse.Namespace, found: Identified, following: NextCommand) -> None:
    """The next step, and what was written."""
    show_next(found.results.motions, following)
    for name, path in (("coefficients", arguments.coefficients), ("report", arguments.report)):
        if path:
            print_fitted(f"{name}: {path}")


def _next(arguments: argparse.Namespace, sources: Sequence[RecordSource], vehicle: Vehicle) -> NextCommand:
    """What would follow: a flight like the last one of this stack, or the report of a record of another."""
    last = sources[-1]
    if last.recording is None and is_here("pool-test"):
        own = RunFolder(last.path.parent).vehicle
        usual = vehicle.name == load_vehicle(default_vehicle()).name
        return NextFlight(("--mock",) if last.mock else (), vehicle="" if usual else arguments.vehicle or str(own))
    report = Path(arguments.records[0]).with_suffix(".html").name
    again = shlex.join(["./hindrax", *arguments.typed, "--report", report])
    return NextReport("" if arguments.report else again, is_here)
