"""One pool test: start, arm, fly, disarm, identify, report."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeAlias

from hindrax_analysis.plain import print_json
from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.liveness import health_change
from hindrax_bringup.network.tether import available_tether
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import EVERY, RECORDER
from hindrax_bringup.share_files import vehicle_word
from hindrax_bringup.stack import MockOptions, adopted, environment_beside, world_of_pool_test
from hindrax_bringup.stack_process import StackProcess, UpOptions
from hindrax_bringup.supervisor import stop_signals
from hindrax_control.commissioning.record import slow_sentence, slowed, unproven
from hindrax_control.maneuver.goal import PLATEAUS, Goal, motions_to_fly
from hindrax_control.maneuver.plan import plans_of
from hindrax_core.errors import INTERRUPTED, HindraxError
from hindrax_core.text.refusals import NOTHING, STOPPED, FarEnd, Reason, Refusal, far_end
from hindrax_core.text.screen_text import fitted, print_fitted, print_stderr, screen_width
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.online.aim import Aim, ExperimentGoal, check_experiment, plan_text
from hindrax_operator.operator_view import OperatorLink, OperatorView
from hindrax_operator.progress import Progress
from hindrax_operator.snapshot import left_out, node_problems, troubles

if TYPE_CHECKING:
    from hindrax_analysis.identification.bag_identification import Identified
    from hindrax_analysis.identification.verdict import NextFlight
    from hindrax_operator.nodes.operator_node import Operator

UP_S = 30.0
REPEATED = "seed: repeats the world and the noise, not the timing of processes; a second run differs within its +-"
STEADY_S = 20.0
STATE_NODES = ("navigator", "estimator_health")
"""Nodes whose troubles at a start mostly end by themselves, and the time given to them."""
ENDED: Mapping[FarEnd, str] = {
    FarEnd.DISARMED: "disarmed",
    FarEnd.LEFT_ARMED: "disarmed; the autopilot does not say so: disarm it at a ground station",
    FarEnd.TAKEN_OVER: "disarmed here; whoever has taken over has the vehicle, which may be armed: disarm it there",
}
"""Who has an autopilot at the far end when a flight has ended."""
ABORT, CONTINUE = "abort", "continue"
FLY_S = 3600.0
ARMING_S = 60.0
MOTION_S = 240.0
"""Upper bound of a motion's duration, for the check of free space; a staircase of plateaus takes two minutes."""


@dataclass(frozen=True, slots=True)
class PoolOptions:
    """Motions, vehicle and result folder of a run."""

    motions: tuple[str, ...]
    """Names, or `all`: what the vehicle can fly."""
    vehicle_file: Path
    mock: MockOptions | None
    out: str | None
    seed: int
    excitation: str
    on_cancel: str
    without_record: str
    """ABORT or CONTINUE: what a flight does when it is no longer recorded."""
    headless: bool
    json: bool
    aim: Aim | None = None
    """End of an experiment of the identification node; without one the pilot flies its plan."""
    predicted: Mapping[str, float] = field(default_factory=dict)
    """Deviation of the drag of each motion as a share of it, by a rehearsal [-]."""
    tuning: ParameterOverrides = field(default_factory=ParameterOverrides)
    uncommissioned: bool = False
    """Whether a vehicle whose file is not proven flies as fast as that file says."""
    start: tuple[float, float, float] | None = None
    """Position in the pool before arming, as for `recentre`; none: by the pilot's parameters."""
    again: tuple[str, ...] = ()
    """Options that a next flight repeats as they were given, where the vehicle file is a copy for this one."""

    @property
    def plan_is_the_pilots(self) -> bool:
        """Whether only the pilot knows the plan: its parameters were set."""
        own = self.tuning != ParameterOverrides(self.tuning.namespace)
        return own and self.aim is None and self.excitation == PLATEAUS


@dataclass(frozen=True, slots=True)
class Proof:
    """Whether the vehicle file was proven, in a sentence, and whether maneuvers are slow because it was not."""

    text: str
    slow: bool = False


@dataclass(slots=True)
class FlownManeuver:
    """Outcome of a flight, besides the bag."""

    aborted: Refusal = NOTHING
    armed: bool = False
    interrupted: bool = False
    node_problems: list[str] = field(default_factory=list)
    """Errors in /diagnostics at the end."""
    vehicle_s: float = 0.0
    wall_s: float = 0.0
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def real_time_factor(self) -> float:
        """Vehicle time over wall time, from arming to disarming."""
        return self.vehicle_s / self.wall_s if self.wall_s > 0.0 else 0.0


Act: TypeAlias = Callable[[PoolOptions, "Operator", Progress], Refusal]
"""What is done with an armed stack; returns why it was aborted."""


def run_pool_test(options: PoolOptions) -> int:
    """Fly, identify, print.

    Parameters
    ----------
    options
        Vehicle, motions, mock or real, and how the result is shown.

    Returns
    -------
    int
        0 when all was flown and identified, with all thrusters; INTERRUPTED after Ctrl-C.

    Raises
    ------
    HindraxError
        Where the record could not be identified; with why the flight ended.
    """
    vehicle = load_vehicle(options.vehicle_file)
    vehicle.output_channels()
    servable = motions_to_fly(options.motions, vehicle)
    options = replace(options, motions=servable.flown)
    if options.aim is not None:
        check_experiment(options.motions, options.aim)
    proof = proof_of(vehicle, options)
    plan = planned(slowed(vehicle) if proof.slow else vehicle, options)
    mock = options.mock is not None
    folder = make_run_folder(options.out, options.vehicle_file)
    with folder.unless_refused():
        BagLimits(planned_s=MOTION_S * len(options.motions)).check_space(folder.path)
    with Progress(headless=options.headless) as progress:
        progress.report(f"{vehicle.name} {servable}")
        progress.report(proof.text)
        if mock:
            progress.report(REPEATED)
        for line in plan:
            progress.report(line)
        flight = fly(options, folder, progress)
        progress.report("identifying over the bag")
        from hindrax_analysis.identification.bag_identification import identify_run  # noqa: PLC0415  # SciPy and the report take a second: the stack starts first
        from hindrax_analysis.terminal import working  # noqa: PLC0415  # as above

        predicted = options.predicted
        try:
            with working("identifying") as reached:
                identified = identify_run(
                    folder,
                    vehicle,
                    mock=mock,
                    aborted=flight.aborted,
                    predicted=predicted,
                    assumed=simulated_world(flight.facts),
                    progress=reached,
                )
        except HindraxError as error:
            end = f"aborted by {flight.aborted}" if flight.aborted else "flown"
            later = f"the record is stored; then `./hindrax identify {folder.bag}` gives the results"
            raise HindraxError(f"{end}; but {error}; {later}") from error
    factor = round(flight.real_time_factor, 2)
    document = identified.document(folder.bag, folder.report, factor, flight.aborted)
    document |= {"commissioned": proof.text}
    document |= {"mock": flight.facts} if mock else {}
    document |= {"predicted": dict(options.predicted)} if options.predicted else {}
    if options.json:
        print_json(document)
    else:
        finish(identified, folder, flight, next_flight(options))
    if flight.interrupted:
        return INTERRUPTED
    return 1 if flight.aborted or identified.left_out or not identified.complete else 0


def proof_of(vehicle: Vehicle, options: PoolOptions) -> Proof:
    """How the vehicle file counts in this run: a mock is built by its file, so that is proven."""
    if options.mock is not None:
        return Proof("vehicle file: counts as commissioned, because the mock is built from it")
    if not (reason := unproven(vehicle)):
        return Proof(f"vehicle file: commissioned on {vehicle.commissioned.date if vehicle.commissioned else ''}")
    if options.uncommissioned:
        return Proof(f"vehicle file: {reason}; flown as fast as it says, by --uncommissioned")
    return Proof(slow_sentence(vehicle), slow=True)


def planned(vehicle: Vehicle, options: PoolOptions) -> list[str]:
    """Plan, a line for each motion; UsageError when the pool leaves no room for it."""
    if options.aim is not None:
        return [f"plan: {plan_text(options.motions, options.aim)}"]
    if options.excitation != PLATEAUS or options.plan_is_the_pilots:
        return []
    return [f"plan: {plan}" for plan in plans_of(vehicle, options.motions)]


def simulated_world(facts: Mapping[str, Any]) -> list[str]:
    """Effects that the mock has simulated beside the model, for the report; none for a real vehicle."""
    from hindrax_analysis.coefficients_file import MOCK_WORLD  # noqa: PLC0415  # with SciPy: no start waits for it

    world = facts.get("world") or {}
    sizes = (f"{name} {size:.3g} {facts['world_units'][name]}".removesuffix(" -") for name, size in world.items())
    return [f"{MOCK_WORLD}: {', '.join(sizes)}"] if world else []


def next_flight(options: PoolOptions) -> NextFlight:
    """What a flight after this one would fly: the same vehicle, in the same water where it is a mock."""
    from hindrax_analysis.identification.verdict import NextFlight  # noqa: PLC0415  # SciPy is loaded after the flight

    words, world = [], ""
    if (mock := options.mock) is not None:
        words = ["--mock", *(["--simulator", mock.simulator] if mock.simulator else [])]
        world = mock.world if mock.world != world_of_pool_test(None, mock.simulator) else ""
    return NextFlight(words, world, vehicle_word(options.vehicle_file), options.again)


def finish(identified: Identified, folder: RunFolder, flight: FlownManeuver, following: NextFlight) -> None:
    """Print the result, how the flight ended, what the next one can gain, and where the report is: all on one screen.

    Parameters
    ----------
    identified
        Results over the bag, and warnings.
    folder
        Of the run, with its report.
    flight
        Why it was aborted, if so, and what was left out.
    following
        Best next flight.
    """
    from hindrax_analysis.identification.bag_identification import show  # noqa: PLC0415  # SciPy is loaded after the flight
    from hindrax_analysis.identification.verdict import show_next  # noqa: PLC0415  # as above

    said = _ends(identified, flight)
    for sentence in said:
        print_stderr(sentence)

    def ending() -> None:
        show_next(identified.results.motions, following)
        print_fitted(f"report: {folder.report}")

    if identified.results.motions:
        width = screen_width(sys.stderr)
        show(identified, reported=True, above=sum(len(fitted(one, width).splitlines()) for one in said), ending=ending)
    else:
        ending()


def _ends(identified: Identified, flight: FlownManeuver) -> list[str]:
    """How a flight ended, and how fast it was simulated."""
    said = [f"aborted by {flight.aborted}", *(f"  {line}" for line in flight.node_problems)] if flight.aborted else []
    if flight.aborted and not identified.results.motions:
        said.append("nothing was flown: there is no data, so there are no coefficients")
    if hits := flight.facts.get("wall_hits"):
        said.append(f"the mock vehicle ran into a wall of its pool (contacts: {hits})")
    if flight.vehicle_s:
        pace = f"{flight.real_time_factor:.1f} times real time"
        said.append(f"flown at {pace} ({flight.vehicle_s:.0f} s of vehicle time)")
    return said


def fly(
    options: PoolOptions, folder: RunFolder, progress: Progress, act: Act | None = None, *, arm: bool = True
) -> FlownManeuver:
    """Have a stack started, fly the motions, end it; the bag is closed and readable when this returns.

    Parameters
    ----------
    options
        Vehicle, motions, mock or real, parameters of the nodes.
    folder
        Of the run; removed where the stack refuses to begin.
    progress
        Gets what happens.
    act
        Done with the armed stack in place of the motions; it returns why it was aborted.
    arm
        False: `act` arms, after what it does at rest.

    Returns
    -------
    FlownManeuver
        Why it was aborted, if so, and the ground truth of a mock.
    """
    mock, flight = options.mock, FlownManeuver()
    whole = [one.name for one in EVERY if options.without_record != CONTINUE or one is not RECORDER]
    up = UpOptions(
        folder.vehicle,
        mock,
        record=True,
        out=str(folder.path),
        tether=None if mock else available_tether(progress.report),
        tuning=options.tuning,
        client=f"pool-test {' '.join(options.motions)}{f' in mock, seed {mock.seed}' if mock else ''}",
        needed=tuple(whole),
    )
    progress.report(f"starting {'the mock vehicle and ' if mock else ''}the stack")
    with _nothing_kept(flight, folder), StackProcess(up) as stack:
        with in_graph_of(stack, folder):
            _operate(options, flight, stack, progress, act or _fly_motions, arm=arm)
        flight.facts = stack.end()
    return flight


@contextlib.contextmanager
def in_graph_of(stack: StackProcess, folder: RunFolder) -> Iterator[None]:
    """Be in the graph of a stack that has just been started; the folder of a run that is refused goes.

    Parameters
    ----------
    stack
        Its process.
    folder
        Of the run, of which nothing has begun.

    Yields
    ------
    None
        Afterwards the environment is what it was.

    Raises
    ------
    HindraxError
        Why it was refused.
    """
    with folder.unless_refused():
        entry = stack.entry
    with adopted(environment_beside(entry)):
        yield


@contextlib.contextmanager
def _nothing_kept(flight: FlownManeuver, folder: RunFolder) -> Iterator[None]:
    """Remove the folder of a run that Ctrl-C ended before it was armed: the name is free again."""
    try:
        yield
    except KeyboardInterrupt:
        if not flight.armed:
            folder.remove()
        raise


def _operate(
    options: PoolOptions, flight: FlownManeuver, stack: StackProcess, progress: Progress, act: Act, *, arm: bool
) -> None:
    """Join the stack while it starts: the imports of the operator's node take as long as those of the nodes."""
    from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment as it is imported
    from hindrax_operator.nodes.orders import recentre  # noqa: PLC0415  # as above

    deaths: list[str] = []
    reported: dict[str, str] = {}
    told: set[str] = set()

    def tick() -> None:
        for sentence in stack.check():
            progress.report(sentence)
            deaths.append(sentence)
        if flight.armed:
            watch_thrusters(operator, told, progress)
            watch_record(operator, reported, progress, options.without_record)
        else:
            report_devices(operator, reported, progress)
        progress.show(operator.maneuver, operator.navigation, operator.estimates)

    with Operator(mock=options.mock is not None, namespace=options.tuning.namespace, tick=tick) as operator:
        progress.report("waiting for the devices, the thrusters and a navigation solution")
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: missing_solution(operator))
        operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: "a message from the thrusters")
        await_steady_state(operator, reported, progress)
        require_measurements(reported)
        arming = "; arming, which holds neutral for the time that the ESCs need" if arm else ""
        progress.report(f"{state_before_arming(reported)}{arming}")
        if options.plan_is_the_pilots:
            _say_plans_of_the_pilot(options, operator, progress)
        if options.start is not None:
            recentre(operator, *options.start)
        with interrupted_once(), disarmed_at_the_end(operator):
            if arm:
                operator.arm(seconds=ARMING_S)
                progress.report(f"armed; flying {', '.join(options.motions)}")
            flight.armed = True
            begin, wall = operator.now(), time.monotonic()
            try:
                flight.aborted = act(options, operator, progress)
            except KeyboardInterrupt:
                flight.aborted, flight.interrupted = STOPPED, True
            except HindraxError as error:
                # The bag holds the flight up to here, which can still be identified.
                flight.aborted = Refusal(Reason.STACK, f"stack: {error}")
            else:
                flight.aborted = flight.aborted.meanwhile(deaths)
            flight.node_problems = node_problems(operator) if flight.aborted else []
            flight.wall_s = time.monotonic() - wall
            flight.vehicle_s = (operator.now() - begin) / 1e9
        progress.end_view()
        reason = operator.thrusters.reason if operator.thrusters is not None else ""
        progress.report(ENDED[far_end(reason, flight.aborted)])


def _say_plans_of_the_pilot(options: PoolOptions, operator: Operator, progress: Progress) -> None:
    found = operator.awaited(lambda: operator.plans, UP_S, lambda: "the plans of the pilot")
    plans = dict(zip(found.motions, found.plans, strict=True))
    for motion in options.motions:
        progress.report(f"plan: {plans[motion]}")


def _fly_motions(options: PoolOptions, operator: OperatorLink, progress: Progress) -> Refusal:
    """Have the identifier run the experiment that was asked for, else the pilot its plan; why it was aborted."""
    goal: Goal | ExperimentGoal = Goal(options.motions, options.excitation, options.seed, options.on_cancel)
    if options.aim is not None:
        goal = ExperimentGoal(options.motions, options.aim, options.on_cancel)
    aborted, reached = operator.fly(goal, FLY_S)
    if reached:
        progress.report(f"experiment: {reached}")
    return aborted


@contextlib.contextmanager
def disarmed_at_the_end(operator: OperatorLink) -> Iterator[None]:
    """Disarm whatever happens; a failure to do so must not hide what went wrong before (the silence does it then)."""
    try:
        yield
    finally:
        with contextlib.suppress(HindraxError):
            operator.cancel()
        with contextlib.suppress(HindraxError):
            operator.arm(arm=False, seconds=5.0)


@contextlib.contextmanager
def interrupted_once() -> Iterator[None]:
    """The first Ctrl-C interrupts the flight; further ones do not interrupt the landing."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1
        if count == 1:
            signal.default_int_handler(number, frame)

    with stop_signals(interrupt):
        yield


def await_steady_state(operator: Operator, reported: Mapping[str, str], progress: Progress) -> None:
    """Give the state of the vehicle time to settle: a DVL locks, a noisy depth is learned, within seconds of a start.

    What is not settled by then, the guards refuse by name.

    Parameters
    ----------
    operator
        On its time the wait is `STEADY_S` at most.
    reported
        Trouble of each node, as `report_devices` keeps it.
    progress
        Is told that it waits, if it does.
    """
    begin, wall = operator.now(), time.monotonic()

    def settled() -> bool:
        late = operator.now() - begin > 1e9 * STEADY_S or time.monotonic() - wall > STEADY_S
        return late or (all(reported.get(name) == "" for name in STATE_NODES) and not _unmeasured(reported))

    if not settled():
        progress.report("waiting until the state of the vehicle is settled")
        operator.wait(settled, 2.0 * STEADY_S, lambda: "the state of the vehicle")


def require_measurements(reported: Mapping[str, str]) -> None:
    """Refuse to arm without a measurement that every maneuver needs: it would end as it begins.

    Parameters
    ----------
    reported
        Trouble of each node, as `report_devices` keeps it.

    Raises
    ------
    HindraxError
        With what the pilot's guard says, and what a device says of it.
    """
    if missing := _unmeasured(reported):
        raise HindraxError(f"not armed: {missing}")


def _unmeasured(reported: Mapping[str, str]) -> str:
    """What the pilot's guards find of a sensor, with the remedy; empty where nothing is missing."""
    _, guard, found = reported.get("pilot", "").partition(f"{Reason.SENSOR_AGE.name.lower()}: ")
    return f"{guard}{found}"


def state_before_arming(reported: Mapping[str, str]) -> str:
    """State of the stack, by the last reports of the nodes."""
    troubled = sorted(name for name, trouble in reported.items() if trouble)
    return (
        f"the thrusters are up, but not healthy: {', '.join(troubled)}" if troubled else "sensors and thrusters are up"
    )


def missing_solution(operator: OperatorView) -> str:
    """Missing parts of the stack, from /diagnostics."""
    return "a navigation solution\n  " + ("\n  ".join(node_problems(operator)) or "no node has reported anything")


def report_devices(operator: OperatorView, reported: dict[str, str], progress: Progress) -> None:
    """One line when a device or node is up, and one for what it still waits for.

    Parameters
    ----------
    operator
        With the last diagnostics.
    reported
        Trouble of each node as reported last; brought up to date.
    progress
        Gets the lines.
    """
    now = troubles(operator)
    for name, trouble in now.items():
        if change := health_change(name, reported.get(name), trouble):
            progress.report(change)
    reported.update(now)


def watch_thrusters(operator: OperatorView, told: set[str], progress: Progress) -> None:
    """Say at once that the vehicle flies on without a thruster.

    Parameters
    ----------
    operator
        With the last state of allocation and output.
    told
        Sentences that were said before; brought up to date.
    progress
        Gets the new ones.
    """
    for sentence in left_out(operator):
        if sentence not in told:
            told.add(sentence)
            progress.report(f"{sentence}; it is left out, and the flight goes on without it")


def watch_record(operator: OperatorView, reported: dict[str, str], progress: Progress, without_record: str) -> None:
    """Say at once that a flight is no longer recorded.

    Parameters
    ----------
    operator
        With the last diagnostics of the recorder.
    reported
        Failure of the recorder as reported last; brought up to date.
    progress
        Gets a change.
    without_record
        What then happens: `ABORT`, or `CONTINUE`.

    Raises
    ------
    HindraxError
        Where the flight is to end by it; with the option that flies on.
    """
    name = RECORDER.name
    status = operator.diagnostics.get(f"hindrax: {name}")
    failure = str(status.message) if status is not None and status.level == b"\x02" else ""
    if change := health_change(name, reported.get(name, ""), failure):
        progress.report(change)
    reported[name] = failure
    if failure and without_record == ABORT:
        raise HindraxError(f"{name}: {failure}; --without-record {CONTINUE} flies on")
