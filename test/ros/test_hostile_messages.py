"""What comes from the graph is data: whatever is sent to the control process ends no node and moves nothing."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import hostile
import numpy as np
import rclpy
import yaml
from builtin_interfaces.msg import Time
from documentation.pages import ROOT, block_of
from geometry_msgs.msg import Twist
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, Joy
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, AppliedWrench
from hindrax_control.nodes import allocator_node, pilot_node
from hindrax_control.nodes.allocator_node import AllocatorNode
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_control.nodes.teleop_node import TeleopNode
from hindrax_control.nodes.thrust_node import ThrustNode
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure
from hindrax_core.signals import ZERO6, Estimate, Navigation
from hindrax_core.text.refusals import Reason
from hindrax_core.topics import (
    ALLOCATION,
    ALTITUDE,
    BATTERY,
    DVL_ATTITUDE,
    DVL_DETAIL,
    ESTIMATE,
    HOLD_SETPOINT,
    IMU,
    JOYSTICK,
    LEAK,
    MAGNETIC,
    NAMESPACE,
    ODOMETRY,
    OPERATOR_WRENCH,
    PRESSURE,
    THRUSTER_HEALTH,
    THRUSTER_HEALTH_ORDER,
    THRUSTER_STATE,
    TOPICS,
    TWIST,
    WRENCH,
    Topic,
    resolved,
)
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.nodes.identifier import Identifier
from hindrax_ident.nodes.measurement_messages import readers
from hindrax_ident.online.session import Outcome, Session
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import AllocationStatus, HoldSetpoint, ThrusterHealth, ThrusterState
from hindrax_msgs.srv import Recentre
from hindrax_ros.messages import convert
from hindrax_ros.messages.convert import stamp_from_msg, stamp_to_msg, wrench_from_msg, wrench_to_msg
from hindrax_ros.messages.fast_serialization import command_from_bytes
from hindrax_ros.messages.serialization import message_class, serialized
from hindrax_ros.testing import sensor_messages
from hindrax_ros.testing.state_messages import odometry_to_msg
from hindrax_tools import ardusub

pytestmark = pytest.mark.ros

VEHICLE = load_vehicle(default_vehicle())
PUSH = (20.0, 0.0, 0.0, 0.0, 0.0, 5.0)
LEVEL = BottomTrack(True, 0.0, 0.0, 0.0, None, (math.nan, math.nan), (), "", 0)
HANGING = replace(IdealVehicle(VEHICLE, depth_m=0.9).navigation(), velocity_mps=(0.0, 0.0, 0.0))
STRANGER = "/stranger"
TOLD = Estimate("surge", ("k_q",), ("N s^2/m^2",), (66.0,), ((0.2,),), 9, 9.0, True, "")


def good(topic: Topic, now: Stamp) -> Any:
    """Message of a topic with which nothing is wrong, and which moves nothing where it is an order."""
    makers: dict[Topic, Callable[[], Any]] = {
        IMU: lambda: sensor_messages.inertial_to_msg(
            Stamped(now, Inertial((0.0, 0.0, -9.8), ZERO6[:3], 20.0)), "imu", 0.1, 0.1
        ),
        MAGNETIC: lambda: sensor_messages.magnetic_to_msg(Stamped(now, Magnetic((2e-5, 0.0, 1e-5))), "imu", 1e-6),
        PRESSURE: lambda: sensor_messages.pressure_to_msg(Stamped(now, Pressure(1.1e5, 20.0)), "depth", 100.0),
        ALTITUDE: lambda: sensor_messages.echo_to_msg(Stamped(now, Echo(0.9, 1.0)), "ping", (0.3, 30.0), 0.4),
        DVL_DETAIL: lambda: sensor_messages.dvl_to_msg(
            Stamped(now, BottomVelocity((0.0, 0.0, 0.0), 0.01, 1.0, 0.1, 1)), LEVEL, "dvl", 1480.0
        ),
        DVL_ATTITUDE: lambda: sensor_messages.attitude_to_msg(Stamped(now, LEVEL), "dvl", 0.01),
        ESTIMATE: lambda: convert.estimate_to_msg(Stamped(now, TOLD)),
        OPERATOR_WRENCH: lambda: wrench_to_msg(now, ZERO6),
        WRENCH: lambda: wrench_to_msg(now, ZERO6),
        ODOMETRY: lambda: odometry_to_msg(Stamped(now, HANGING)),
        ALLOCATION: lambda: AllocationStatus(forces=[0.0] * 8, pulses=[1500.0] * 8, saturated=[False] * 8),
        HOLD_SETPOINT: lambda: HoldSetpoint(axis="depth", engaged=False),
        THRUSTER_STATE: lambda: ThrusterState(armed=True, state="armed", pulses=[1500.0] * 8, output="pca9685"),
        THRUSTER_HEALTH: ThrusterHealth,
        THRUSTER_HEALTH_ORDER: ThrusterHealth,
        BATTERY: lambda: BatteryState(voltage=15.0, present=True),
        JOYSTICK: lambda: Joy(axes=[0.0] * 6, buttons=[0] * 8),
        TWIST: Twist,
        LEAK: Bool,
    }
    made = makers[topic]()
    if hasattr(made, "header"):
        made.header.stamp = stamp_to_msg(now)
    return made


class Handle:
    """Stands for the server's end of a goal: keeps the result."""

    def __init__(self, request: Any) -> None:
        self.request, self.is_cancel_requested = request, False
        self.result: Any = None
        self.status = ""

    def execute(self, callback: Any) -> None:
        assert self.result is None, "one result for one goal"
        self.result = callback(self)

    def publish_feedback(self, _: Any) -> None: ...
    def succeed(self) -> None: ...
    def canceled(self) -> None: ...

    def abort(self) -> None:
        self.status = "aborted"


class Control:
    """The nodes of the control process and the operator's hand, with an armed vehicle that hangs still."""

    def __init__(self) -> None:
        self.given: list[tuple[float, ...]] = []
        self.hand = TeleopNode(VEHICLE)
        self.allocator = AllocatorNode(VEHICLE)
        self.pilot = PilotNode(VEHICLE, self.allocator.supply, send_wrench=self._send_wrench)
        self.allocator._command = self
        self.pulses: tuple[float, ...] = ()
        self.states: list[Navigation] = []
        self.navigator = NavigatorNode(VEHICLE, on_state=lambda stamped: self.states.append(stamped.reading))
        self.sampled = self.now()
        self.allocator.allocation_listeners += [self.pilot.on_allocation, self.navigator.on_allocation]
        self._last = Stamp(0)
        self.cycle()
        self.say(THRUSTER_STATE, good(THRUSTER_STATE, self.now()))
        self.cycle()

    def _send_wrench(self, wrench: Any, frame: str, stamp: Stamp, now: Stamp) -> None:
        self.given.append(wrench)
        self.allocator.on_wrench(wrench, frame, stamp, now)

    def publish(self, command: bytes) -> None:
        """Keep what the allocator wants of the thrusters."""
        self.pulses = command_from_bytes(command).pulses_us

    @property
    def nodes(self) -> tuple[Node, ...]:
        return (self.hand, self.allocator, self.pilot, self.navigator)

    def now(self) -> Stamp:
        return Stamp(self.pilot.get_clock().now().nanoseconds)

    def cycle(self, count: int = 1) -> None:
        for _ in range(count):
            self._last = Stamp(max(self.now(), self._last + 1))
            self.pilot.on_navigation(Stamped(self._last, HANGING))

    def sample(self, count: int) -> None:
        """Give the navigator good inertial samples, one hundred a second."""
        for _ in range(count):
            self.sampled = after(self.sampled, 0.01)
            self.say(IMU, good(IMU, self.sampled))

    def subscriptions(self) -> Iterator[tuple[Topic, Any]]:
        """Every subscription of every node; a topic that nobody here knows how to abuse fails the test."""
        topics = {resolved(topic): topic for topic in TOPICS}
        for node in self.nodes:
            for one in Node.subscriptions.fget(node):
                yield topics[one.topic_name], one

    def say(self, topic: Topic, message: Any) -> None:
        """Give a message to everybody here who listens to its topic."""
        for subscribed, one in self.subscriptions():
            if subscribed is topic:
                one.callback(serialized(message) if one.raw else message)

    def ask(self, goal: Any) -> Handle:
        handle = Handle(goal)
        self.pilot._accept(handle)
        return handle

    def still(self) -> bool:
        """Whether nothing was asked of the thrusters lately."""
        self.given.clear()
        self.cycle(3)
        return self.given == [ZERO6] * 3 and set(self.pulses) == {1500.0}

    def close(self) -> None:
        self.pilot.close()
        for node in self.nodes:
            node.destroy_node()


@pytest.fixture
def control(monkeypatch: pytest.MonkeyPatch) -> Iterator[Control]:
    for module in (allocator_node, pilot_node):
        monkeypatch.setattr(module, "publishers_of", lambda *_: {"01": STRANGER})
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        made = Control()
        try:
            yield made
        finally:
            made.close()
            rclpy.try_shutdown()


def test_nothing_that_is_sent_to_any_subscription_ends_a_node_or_moves_the_vehicle(control: Control) -> None:
    swept = set()
    for topic, _ in list(control.subscriptions()):
        now = stamp_to_msg(control.now())
        for message in hostile.floods(type(good(topic, control.now())), now):
            control.say(topic, message)
        control.say(THRUSTER_STATE, good(THRUSTER_STATE, control.now()))
        assert control.still(), topic.name
        swept.add(topic)
    assert {IMU, THRUSTER_STATE, HOLD_SETPOINT, OPERATOR_WRENCH, ESTIMATE, BATTERY, JOYSTICK, TWIST} <= swept
    assert {WRENCH, ODOMETRY, ALLOCATION} <= swept


def test_one_wrong_field_in_a_good_message_ends_no_node_either(control: Control) -> None:
    limits = VEHICLE.limits.wrench
    for topic, _ in list(control.subscriptions()):
        for message in hostile.mutants(good(topic, control.now())):
            control.say(topic, message)
            control.cycle()
            assert all(abs(value) <= limit for value, limit in zip(control.given[-1], limits, strict=True)), message
            assert all(1100 <= pulse <= 1900 for pulse in control.pulses), message
        control.say(OPERATOR_WRENCH, wrench_to_msg(control.now(), ZERO6))


MEASURED = (IMU, MAGNETIC, PRESSURE, ALTITUDE, DVL_DETAIL, DVL_ATTITUDE)


@pytest.mark.parametrize("topic", MEASURED, ids=lambda topic: topic.name)
def test_a_navigator_navigates_on_whatever_a_sensor_states(control: Control, topic: Topic) -> None:
    control.sample(300)
    begun, sensible = control.sampled, [one for one in MEASURED if one not in (IMU, topic)]
    for one in MEASURED:
        control.say(one, good(one, begun))
    for message in hostile.mutants(good(topic, begun)):
        if topic is IMU and stamp_from_msg(message.header.stamp) != begun:
            continue  # the navigator's clock are its inertial samples
        if topic is IMU:
            message.header.stamp = stamp_to_msg(after(control.sampled, 0.005))
        control.states.clear()
        for other in sensible:
            control.say(other, good(other, control.sampled))
        control.say(topic, message)
        control.sample(8)
        assert control.states, message
        known = control.states[-1]
        assert all(map(math.isfinite, (*known.attitude_rad, *known.rate_radps, *known.velocity_mps, known.depth_m)))
        assert max(map(abs, known.attitude_rad[:2])) < 0.1, message


ORDERS: dict[Topic, Callable[[Stamp], Any]] = {
    OPERATOR_WRENCH: lambda now: wrench_to_msg(now, PUSH),
    HOLD_SETPOINT: lambda _: HoldSetpoint(axis="depth", engaged=True, value=1.5),
    THRUSTER_HEALTH_ORDER: lambda _: ThrusterHealth(disabled=["T1"], reasons=["a test"]),
}


@pytest.mark.parametrize("topic", ORDERS, ids=lambda topic: topic.name)
def test_an_order_that_is_not_of_now_moves_nothing_is_counted_and_stands_in_no_ones_way(
    control: Control, topic: Topic
) -> None:
    order = ORDERS[topic](control.now())
    sent = list(hostile.wrong_stamps(order))
    for message in sent:
        control.say(topic, message)
        assert control.still(), message
    refusals = control.pilot._reporter.refusals
    assert refusals.counts[topic.name] >= len(sent) - (topic is THRUSTER_HEALTH_ORDER)  # an old list may be said again
    assert "wanted" in refusals.last
    control.say(topic, _of(order, control.now()))
    control.cycle(3)
    obeyed = control.pilot._disabled if topic is THRUSTER_HEALTH_ORDER else any(control.given[-1])
    assert obeyed


def _of(order: Any, now: Stamp) -> Any:
    order.header.stamp = stamp_to_msg(now)
    return order


def test_a_list_in_force_from_before_the_clock_was_set_back_can_still_be_replaced(control: Control) -> None:
    control.pilot._publish_disabled({"T1": "a test"}, after(control.now(), 3600.0))
    message = ThrusterHealth()
    message.header.stamp = stamp_to_msg(control.pilot._listed_at + 1)
    control.say(THRUSTER_HEALTH_ORDER, message)
    assert control.pilot._disabled == {}


def test_lists_that_come_before_the_time_is_known_are_judged_as_soon_as_it_is(
    control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = control.now()
    monkeypatch.setattr(control.pilot, "now", lambda: Stamp(0))
    for age_s, name in ((7200.0, "T3"), (3600.0, "T4"), (-3600.0, "T5")):
        control.say(THRUSTER_HEALTH_ORDER, _of(ThrusterHealth(disabled=[name], reasons=["weak"]), after(now, -age_s)))
    control.pilot.drain()
    assert control.pilot._disabled == {}
    monkeypatch.setattr(control.pilot, "now", lambda: now)
    control.pilot.drain()
    assert control.pilot._disabled == {"T4": "weak"}
    assert control.pilot._reporter.refusals.counts == {THRUSTER_HEALTH_ORDER.name: 1}


def test_strange_thrusters_are_left_out_of_a_list(control: Control) -> None:
    listed = ThrusterHealth(disabled=["T2", "T99", "x" * 1000], reasons=["weak"])
    control.say(THRUSTER_HEALTH_ORDER, _of(listed, control.now()))
    assert control.pilot._disabled == {"T2": "weak"}
    assert control.pilot._reporter.refusals.last.reason is Reason.UNKNOWN_NAME
    assert "T99" in control.pilot._reporter.refusals.last


def test_a_goal_that_is_not_of_now_or_makes_no_sense_is_answered_and_flies_nothing(control: Control) -> None:
    now = stamp_to_msg(control.now())
    for goal in hostile.floods(FlyManeuver.Goal, now):
        answered = control.ask(goal)
        assert answered.result is not None
        assert not answered.result.completed
    sensible = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="hold")
    printed = []
    for sec, nanosec in hostile.TIMES:
        sensible.stamp = Time(sec=sec, nanosec=nanosec)
        printed.append(control.ask(sensible).result.aborted)
    assert [one.partition(": ")[0] for one in printed] == ["clock", "clock", "repeat", "late", "clock", "clock"]
    assert all("wanted" in one for one in printed)
    sensible.stamp = stamp_to_msg(control.now())
    sensible.motions = ["surge"] * 10_000
    assert control.ask(sensible).result.aborted == "goal: 10000 motions, wanted at most 12; fly the rest after them"
    assert control.pilot._goal is None
    assert control.still()


def test_each_goal_that_cannot_be_flown_is_aborted_with_the_code_of_its_reason(control: Control) -> None:
    """Not rejected: a rejection has no room for a code (ADR 55)."""

    def refused(reason: Reason, age_s: float = 0.0, **words: Any) -> None:
        stamp = stamp_to_msg(after(control.now(), -age_s))
        handle = control.ask(FlyManeuver.Goal(stamp=stamp, **{"motions": ["surge"]} | words))
        control.cycle(pilot_node.ARMED_WITHIN + 1 if handle.result is None else 0)
        found = handle.result
        assert (handle.status, found.error_code, found.completed) == ("aborted", reason, False), found.aborted
        assert found.aborted

    refused(Reason.GOAL, motions=["loop"])
    refused(Reason.GOAL, pulse_seconds=[1.0])
    refused(Reason.GOAL, excitation="noise")
    refused(Reason.ELSEWHERE, motions=[], pulse_forces=[2.0] * 8, pulse_seconds=[0.5], pulse_calm=[True])
    refused(Reason.LATE, age_s=11.0)
    refused(Reason.CLOCK, age_s=-11.0)
    control.pilot._pilot.water_in_hull = True
    refused(Reason.LEAK)
    control.pilot._publish_disabled({f"T{number}": "a test" for number in range(1, 9)}, control.now())
    refused(Reason.MOTION)
    control.pilot._publish_disabled({}, control.now())
    control.pilot._armed = False
    refused(Reason.NOT_ARMED)


def test_what_is_typed_without_a_stamp_is_obeyed_when_it_is_repeated_with_the_stamp_of_the_answer(
    control: Control,
) -> None:
    ask = partial(control.pilot._on_recentre, response=Recentre.Response())
    refused = ask(Recentre.Request())
    assert (refused.accepted, refused.error_code) == (False, Reason.REPEAT)
    assert ask(Recentre.Request(stamp=typed(refused.reason))).accepted
    goal = FlyManeuver.Goal(motions=["surge"])
    result = control.ask(goal).result
    assert result.error_code == Reason.REPEAT
    goal.stamp = typed(result.aborted)
    assert control.ask(goal).result is None
    assert control.pilot._goal is not None
    kept = control.pilot._goal.goal
    assert (kept.excitation, kept.on_cancel) == ("plateaus", "hold")


def typed(sentence: str) -> Time:
    """The stamp of the line that a refusal wants typed."""
    return Time(**yaml.safe_load(sentence.rpartition("stamp: ")[2]))


def test_two_hundred_goals_at_once_are_answered_one_by_one_and_the_first_is_kept(control: Control) -> None:
    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="hold")
    asked = []
    for _ in range(200):
        goal.stamp = stamp_to_msg(control.now())
        asked.append(control.ask(goal))
    assert asked[0].result is None
    assert {one.result.aborted.partition(";")[0] for one in asked[1:]} == {"start: a maneuver is being flown"}


def test_a_state_of_other_thrusters_is_not_assumed(control: Control) -> None:
    wrong = ThrusterState(armed=False, state="disarmed", pulses=[1500.0] * 9)
    for pulses in ([1500.0] * 9, [], [math.nan] * 8, [9000.0] * 8):
        wrong.pulses = pulses
        control.say(THRUSTER_STATE, _of(wrong, control.now()))
    assert control.pilot._armed
    for node in (control.pilot, control.allocator):
        assert node._reporter.refusals.counts == {THRUSTER_STATE.name: 4}
        assert node._reporter.refusals.last.reason is Reason.MALFORMED


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[tuple[Identifier, ThrustNode]]:
    """What listens to the stack of anybody, here of a BlueROV2 on ArduSub."""
    file = tmp_path / "bluerov.yaml"
    file.write_text(block_of(ROOT / "docs" / "how-to" / "bluerov2-on-ardusub.md", "bluerov.yaml"), encoding="utf-8")
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=["--ros-args", "-p", f"vehicle:={file}"])
        nodes = Identifier(), ThrustNode()
        try:
            yield nodes
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.try_shutdown()


def test_nothing_that_anybodys_stack_states_ends_the_identifier_or_spoils_what_is_good(
    desk: tuple[Identifier, ThrustNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    identifier, thrust = desk
    reported: list[Estimate] = []
    monkeypatch.setattr(identifier, "_publish", lambda stamped: reported.append(stamped.reading))
    listening = {one.topic_name: one.callback for one in Node.subscriptions.fget(identifier)}
    odometry, wrench = (listening[f"{NAMESPACE}/{name}"] for name in ("odometry", "wrench"))
    now = Stamp(time.time_ns())
    monkeypatch.setattr(identifier, "now", lambda: now)  # stamps those that have none: a slow machine changes nothing
    state = good(ODOMETRY, now)
    for hear, message in ((odometry, state), (wrench, wrench_to_msg(now, PUSH))):
        for one in (*hostile.floods(type(message), stamp_to_msg(now)), *hostile.mutants(message)):
            hear(one)
        for one in (*hostile.wrong_stamps(message), *hostile.wrong_stamps(message)):
            hear(one)
        identifier.drain()
        assert "wanted" in identifier._refusals.last
    reported.clear()
    dropped, begin = identifier._any.dropped, after(now, 2.0)
    state.twist.covariance = np.zeros(36)
    monkeypatch.setattr(thrust, "_out", SimpleNamespace(publish=wrench))
    flown = [(stamp_to_msg(after(begin, k * ardusub.STEP_S)), *one) for k, one in enumerate(ardusub.flight(12.5))]
    for stamp, _, speeds in flown:
        state.header.stamp, state.twist.twist.linear.x = stamp, speeds["surge"]
        odometry(state)
    for stamp, pulses, _ in flown:  # all after all: as they wait while a verdict is made
        hear_pulses(thrust, Header(stamp=stamp), pulses)
    identifier.drain()
    k_q, k_l = [one for one in reported if one.motion == "surge"][-1].values[:2]
    assert k_q * 0.5**2 + k_l * 0.5 == pytest.approx(141.0 * 0.5**2 + 13.7 * 0.5, rel=0.1)
    assert identifier._any.dropped == dropped


@pytest.mark.parametrize("variance", [-1.0, 1e3, math.nan])
def test_an_odometry_that_says_that_it_measures_nothing_is_named(
    desk: tuple[Identifier, ThrustNode], variance: float
) -> None:
    """-1 in a covariance is one driver's "not measured" and another's "of unknown accuracy"."""
    identifier, _ = desk
    listening = {one.topic_name: one.callback for one in Node.subscriptions.fget(identifier)}
    state = good(ODOMETRY, Stamp(time.time_ns()))
    state.twist.covariance[:15:7] = variance
    listening[f"{NAMESPACE}/odometry"](state)
    identifier.drain()
    assert identifier._refusals.counts == {}, "it measures the rates"
    state.twist.covariance[::7] = variance
    listening[f"{NAMESPACE}/odometry"](state)
    identifier.drain()
    assert "found no velocity that is measured, wanted one of a variance from 0" in identifier._refusals.last


def test_bytes_that_are_no_measurement_do_not_end_the_identifier(desk: tuple[Identifier, ThrustNode]) -> None:
    identifier, _ = desk
    listening = {one.topic_name: one for one in Node.subscriptions.fget(identifier) if one.raw}
    assert listening.keys() == {resolved(topic) for topic in readers(load_vehicle(default_vehicle()))}
    for one in listening.values():
        for data in (b"", b"\x00\x01" + bytes(9)):
            one.callback(data)
    assert identifier._refusals.counts == {topic.name: 2 for topic in readers(load_vehicle(default_vehicle()))}


def hear_pulses(thrust: ThrustNode, header: Header, channels: Any) -> None:
    """As `mavros_msgs/RCOut`, which is in no wheel."""
    thrust._type = "mavros_msgs/msg/RCOut"
    message: Any = SimpleNamespace(header=header, channels=channels)
    thrust._on_pulses(message)


def test_the_stamps_of_an_autopilot_s_outputs_may_begin_again(
    desk: tuple[Identifier, ThrustNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They do after 71.6 minutes. A stamp of another clock stays as it is, for the identifier to refuse."""
    _, thrust = desk
    sent: list[Any] = []
    monkeypatch.setattr(thrust, "_out", SimpleNamespace(publish=sent.append))
    now, wrap_ns = thrust.now(), 2**32 * 1000
    for ago in (0, wrap_ns, 3 * wrap_ns, 10**11, now - 10**9):
        hear_pulses(thrust, Header(stamp=stamp_to_msg(now - ago)), [1500] * 8)
    assert [now - stamp_from_msg(one.header.stamp) for one in sent] == [0, 0, 0, 10**11, now - 10**9]


def test_the_thrust_of_anybodys_pulses_is_that_at_the_battery_s_voltage(
    desk: tuple[Identifier, ThrustNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `/mavros/battery` tells it: 12 V in place of the 16 V of the file were a third too much thrust."""
    _, thrust = desk
    sent: list[Any] = []
    monkeypatch.setattr(thrust, "_out", SimpleNamespace(publish=sent.append))
    now = thrust.now()
    monkeypatch.setattr(thrust, "now", lambda: now)
    for voltage in (0.0, 12.0, math.nan, 400.0):
        thrust._on_battery(BatteryState(voltage=voltage))
        hear_pulses(thrust, Header(), [1700] * 8)
    at_12V, nominal = (AppliedWrench(thrust._vehicle, supply_V) for supply_V in (12.0, None))
    wanted = [one.wrench(one.forces_N([1700.0] * 8)) for one in (nominal, at_12V, at_12V, at_12V)]
    assert [wrench_from_msg(one) for one in sent] == [pytest.approx(one) for one in wanted]
    assert abs(wanted[1][2]) < 0.9 * abs(wanted[0][2])
    assert thrust._reporter.refusals.counts == {"battery": 2}
    now = after(now, 60.0)
    hear_pulses(thrust, Header(), [1700] * 8)
    assert wrench_from_msg(sent[-1]) == pytest.approx(wanted[0]), "a battery that is silent no longer counts"


def test_pulses_that_are_none_are_refused_and_become_no_wrench(
    desk: tuple[Identifier, ThrustNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, thrust = desk
    sent: list[Any] = []
    monkeypatch.setattr(thrust, "_out", SimpleNamespace(publish=sent.append))
    for kind in PULSE_FIELDS:
        if kind.startswith("std_msgs/"):
            thrust._type = kind
            for message in hostile.floods(message_class(kind), Time(), every=31):
                thrust._on_pulses(message)
    reported = thrust._reporter.refusals.counts.total()
    for channels in ([], [1500] * 7, [65535] * 16, [1] * 8, [1500] * 7 + [499]):
        hear_pulses(thrust, Header(), channels)
    assert sent == []
    assert thrust._reporter.refusals.counts.total() == reported + 5
    for time_of in hostile.TIMES:
        hear_pulses(thrust, Header(stamp=Time(sec=time_of[0], nanosec=time_of[1])), [1500] * 8)
    assert {wrench_from_msg(one) for one in sent} == {ZERO6}


def test_measurements_are_read_while_a_verdict_is_made(
    desk: tuple[Identifier, ThrustNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    identifier, _ = desk
    read, beaten, seen = threading.Event(), threading.Event(), []
    nothing = Session(identifier._session.vehicle).finalize()

    def finalize(session: Session) -> Outcome:
        seen.append((session, read.wait(10.0), beaten.wait(10.0)))
        return nothing

    monkeypatch.setattr(identifier, "drain", read.set)
    monkeypatch.setattr(identifier, "_heartbeat", SimpleNamespace(beat=lambda _now_s: beaten.set()))
    monkeypatch.setattr(Session, "finalize", finalize)
    response = identifier._on_assess(Trigger.Request(), Trigger.Response())
    ((judged, was_read, was_alive),) = seen
    assert (was_read, was_alive, response.success) == (True, True, False)
    assert judged is not identifier._session, "what comes meanwhile would change it"
    assert response.message.startswith("nothing to judge yet: ")
