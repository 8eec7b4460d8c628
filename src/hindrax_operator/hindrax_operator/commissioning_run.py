"""A commissioning over the ROS graph: rest, arm, fly the pulses that the readings ask for, disarm.

In mock it starts a stack of its own; a real vehicle is commissioned beside a stack that runs, armed by its operator.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bringup.processes import EVERY
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_process import StackProcess, UpOptions
from hindrax_control.commissioning.commissioning import Commissioning
from hindrax_control.commissioning.findings import Findings
from hindrax_control.maneuver.goal import Goal
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamped, after, seconds_between
from hindrax_core.readings import Battery
from hindrax_core.sensor_table import Capability
from hindrax_core.text.refusals import NOTHING, STOPPED, Reason, Refusal
from hindrax_core.topics import ALLOCATION, BATTERY, Topic, carriers
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_operator.pool_run import disarmed_at_the_end, in_graph_of, interrupted_once, missing_solution
from hindrax_operator.snapshot import node_problems

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hindrax_control.maneuver.goal import Pulse
    from hindrax_core.messages.contents import Read
    from hindrax_core.readings import Reading
    from hindrax_operator.nodes.operator_node import Operator

Report: TypeAlias = Callable[[str], None]
Over: TypeAlias = Callable[[], bool]
UP_S, ARMING_S, ARMED_BY_HAND_S = 30.0, 60.0, 600.0
SETTLED_S, REST_S = 1.0, 3.0
"""Vehicle time until the readings count, and that of the rest."""
SLOWEST_PACE = 0.2
OWN_ALTITUDE = "/altitude"
"""Of a DVL: no echo."""
FLY_S = 1200.0
NO_GRAVITY = Refusal(
    Reason.COMMISSION, "gravity is not where the file has it: nothing was armed; mend that and commission again"
)
LISTS = Refusal(Reason.COMMISSION, "it lists too far: nothing was armed; trim it and commission again")
HEARD: tuple[Capability, ...] = ("rates", "field", "velocity", "depth", "altitude")


def commission_mock(
    vehicle_file: Path, mock: MockOptions, out: str | None, report: Report
) -> tuple[Findings, RunFolder]:
    """Commission the mock vehicle in a stack of its own, recorded in a run folder.

    Parameters
    ----------
    vehicle_file
        To be proven.
    mock
        Seed, pace, faults and world of the mock.
    out
        Folder of the run; None: a new one below `runs`.
    report
        Gets a sentence for each step, and those of the stack.

    Returns
    -------
    tuple[Findings, RunFolder]
        What was found, and where its bag lies.
    """
    vehicle = load_vehicle(vehicle_file)
    vehicle.output_channels()
    folder = make_run_folder(out, vehicle_file)
    needed = tuple(one.name for one in EVERY)
    up = UpOptions(folder.vehicle, mock, record=True, out=str(folder.path), client="commission in mock", needed=needed)
    report("starting the mock vehicle and the stack")
    with StackProcess(up) as stack:
        with in_graph_of(stack, folder):
            from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment as it is imported

            def tick() -> None:
                for sentence in stack.check():
                    report(sentence)

            with Operator(mock=True, tick=tick) as operator:
                operator.wait(lambda: operator.navigation is not None, UP_S, lambda: missing_solution(operator))
                operator.wait(lambda: operator.thrusters is not None, UP_S, lambda: "a message from the thrusters")
                findings = commission_beside(operator, vehicle, report, arm=True)
        stack.end()
    return findings, folder


def commission_beside(
    operator: Operator, vehicle: Vehicle, report: Report, *, arm: bool, over: Over = lambda: False
) -> Findings:
    """Commission the vehicle of a running stack: first at rest and disarmed, then by pulses of its thrusters.

    Parameters
    ----------
    operator
        In the graph of the stack.
    vehicle
        File to be proven.
    report
        Gets a sentence for each step.
    arm
        Whether it is armed here; else its operator is waited for.
    over
        Whether nothing more is to be begun, beside a Ctrl-C.

    Returns
    -------
    Findings
        Also of a commissioning that ended early; `ended` then says why.

    Raises
    ------
    HindraxError
        Where the thrusters are armed already: no vehicle at rest.
    """
    work = Commissioning(vehicle)
    with _listening(operator, work):
        if operator.armed:
            raise HindraxError(
                "the thrusters are armed, wanted a vehicle at rest first; `./hindrax disarm`, let it float, try again"
            )
        ended = _rest(operator, work, report, over) or _pulse(operator, work, report, over, arm=arm)
    return work.finalize(ended)


@contextlib.contextmanager
def _listening(operator: Operator, work: Commissioning) -> Iterator[None]:
    """Feed the commissioning with the readings of every sensor and with the forces of the thrusters."""
    from hindrax_ros.graph import subscription  # noqa: PLC0415  # rclpy reads the environment first
    from hindrax_ros.messages.convert import stamp_from_msg  # noqa: PLC0415  # as above
    from hindrax_ros.messages.fast_serialization import thrust_from_bytes  # noqa: PLC0415  # as above
    from hindrax_ros.messages.reading_fields import reader  # noqa: PLC0415  # as above

    vehicle = work.vehicle

    def on_reading(source: str, read: Read[Reading], data: bytes) -> None:
        with contextlib.suppress(ValueError):  # what is not a message of the topic proves nothing
            work.on_reading(source, read(data))

    def on_forces(data: bytes) -> None:
        thrust = thrust_from_bytes(data)
        if len(thrust.reading.forces_N) == len(vehicle.thrusters):
            work.on_forces(thrust.stamp, thrust.reading.forces_N)

    def on_battery(message: Any) -> None:
        battery = Battery(float(message.voltage), -float(message.current))
        work.on_reading(vehicle.measuring("supply")[0], Stamped(stamp_from_msg(message.header.stamp), battery))

    taken: list[tuple[Topic, Callable[[bytes], None]]] = [(ALLOCATION, on_forces)]
    for capability in HEARD:
        for source, topic in carriers(vehicle, capability).items():
            if topic.name.endswith(OWN_ALTITUDE) or source not in vehicle.sensors:
                continue
            taken.append((topic, partial(on_reading, source, reader(topic))))
    made = [subscription(operator.node, topic, heard, raw=True) for topic, heard in taken]
    if vehicle.measuring("supply"):
        made.append(subscription(operator.node, BATTERY, on_battery))
    try:
        yield
    finally:
        for one in made:
            operator.node.destroy_subscription(one)


def _rest(operator: Operator, work: Commissioning, report: Report, over: Over) -> Refusal:
    """Wait while the vehicle rests; returns why it ended early, if it did."""
    report(f"keep your hands off: at rest for {SETTLED_S + REST_S:.0f} s, afloat and disarmed")
    begin = after(operator.now(), SETTLED_S)
    end = after(begin, REST_S)
    seconds = (SETTLED_S + REST_S) / SLOWEST_PACE
    operator.wait(lambda: operator.now() >= end or over(), seconds, lambda: "the rest to end; the clock has stopped")
    if over():
        return STOPPED
    work.rest(begin, end)
    return NOTHING


def _pulse(operator: Operator, work: Commissioning, report: Report, over: Over, *, arm: bool) -> Refusal:
    """Fly what the commissioning asks for, and disarm; returns why it ended early, if it did."""
    pulses = work.next_pulses(operator.now())
    if pulses is None:
        return LISTS if work.upright else NO_GRAVITY
    with interrupted_once(), disarmed_at_the_end(operator):
        _arm(operator, report, over, arm=arm)
        begin = operator.now()
        while pulses is not None:
            if over():
                return STOPPED
            report(f"{len(pulses)} pulses, about {_seconds(pulses):.0f} s; keep clear, pull no tether")
            try:
                aborted, _ = operator.fly(Goal((), on_cancel="neutral", pulses=pulses), FLY_S)
            except KeyboardInterrupt:
                return STOPPED
            if not aborted:
                pulses = work.next_pulses(operator.now())
                continue
            pulses = work.gentler(operator.now(), aborted)
            if pulses is None:
                return Refusal(aborted.reason, "; ".join([aborted, *node_problems(operator)]))
            report(f"{aborted.partition(';')[0]}: once more, more gently")
        report(f"flown in {seconds_between(begin, operator.now()):.0f} s; disarming")
    return NOTHING


def _seconds(pulses: Sequence[Pulse]) -> float:
    return float(sum(pulse.seconds + pulse.calm * 1.5 for pulse in pulses))


def _arm(operator: Operator, report: Report, over: Over, *, arm: bool) -> None:
    if arm:
        report("arming; single thrusters will turn, keep clear")
        operator.arm(seconds=ARMING_S)
        return
    report("now arm it: `./hindrax arm` in another terminal; single thrusters will turn, keep clear")
    operator.wait(
        lambda: operator.armed or over(),
        ARMED_BY_HAND_S,
        lambda: "the operator to arm (`./hindrax arm`)",
    )
