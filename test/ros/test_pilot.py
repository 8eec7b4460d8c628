"""The pilot node and an operator, by messages: reports of a maneuver in flight, and of one that is refused."""

import itertools
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.commissioning.record import geometry_hash
from hindrax_control.maneuver.goal import Goal, Pulse
from hindrax_control.maneuver.plan import plans_of
from hindrax_control.nodes import pilot_node
from hindrax_control.nodes.allocator_node import AllocatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_control.pool_bounds import PoolPosition
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.refusals import LEFT_ARMED, Reason, Refusal
from hindrax_core.topics import ESTIMATE, PLANS, THRUSTER_STATE
from hindrax_core.vehicle import AXES, Commissioned, load_vehicle
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import ManeuverStatus, ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_operator.nodes.idle_force import IDLE_FORCE, idle_force_times
from hindrax_operator.nodes.operator_node import Operator
from hindrax_operator.nodes.orders import recentre
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import estimate_to_msg, stamp_to_msg

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
AGES_S = {"icm20948": 0.01, "ms5837": 0.02, "ping1d": 0.05, "dvl75": 0.05}
ADRIFT = Navigation(
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    (0.1, 0.0, 0.0),
    0.9,
    0.9,
    (0.0, 0.0),
    dvl_locked=True,
    ages_s=AGES_S,
    depth_age_s=0.02,
    altitude_age_s=0.05,
)
"""Never at rest, so that a maneuver stays at its first stage."""
DISARMED = ThrusterState(armed=False, state="faulted", reason="output is faulted: no answer", pulses=[1500.0] * 8)


T = TypeVar("T")


def latest(message: T | None) -> T:
    assert message is not None
    return message


class Bench:
    """A pilot who is told that all is well, and an operator whose every turn is one cycle of that pilot."""

    def __init__(self) -> None:
        self.operator = Operator(mock=False, tick=self.turn)
        vehicle = load_vehicle(default_vehicle())
        vehicle = replace(vehicle, commissioned=Commissioned(geometry_hash(vehicle), "2026-01-31", ""))
        self.pilot = PilotNode(vehicle, SupplyVoltage(vehicle.supply_V), send_wrench=lambda *_: None)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.pilot)
        self._others: list[AllocatorNode] = []
        self._thrusters = publisher(self.operator.node, THRUSTER_STATE, held=False)
        self.estimates = publisher(self.operator.node, ESTIMATE, held=False)
        self.state = ThrusterState(armed=False, state="disarmed", reason="not armed since start", pulses=[1500.0] * 8)
        self.navigation: Navigation | None = ADRIFT
        self._plans: list[tuple[Callable[[], object], Callable[[], object]]] = []

    def turn(self) -> None:
        if self._plans and self._plans[0][0]():
            self._plans.pop(0)[1]()
        self.state.header.stamp = stamp_to_msg(self.operator.now())
        self._thrusters.publish(self.state)
        self._executor.spin_once(timeout_sec=0.0)
        self.pilot.drain()
        if self.navigation is not None:
            self.pilot.on_navigation(Stamped(self.operator.now(), self.navigation))
        self.pilot.publish_queue.flush()

    def until(self, done: Callable[[], object]) -> None:
        self.operator.wait(lambda: bool(done()), PATIENT_S, lambda: "the bench")

    def fly(self, motions: Sequence[str] = ("surge",), *, excitation: str = "plateaus") -> Refusal:
        """The operator's last message."""
        return self.operator.fly(Goal(tuple(motions), excitation, seed=1, on_cancel="neutral"), PATIENT_S)[0]

    def say_armed(self, *, armed: bool, reason: str = "") -> None:
        self.state.armed, self.state.reason = armed, reason
        self.state.state = "armed" if armed else "disarmed"
        self.until(lambda: self.operator.thrusters is not None and self.operator.armed is armed)

    def when(self, true: Callable[[], object], act: Callable[[], object]) -> None:
        """Act once, in the turn in which something is true."""
        self._plans.append((true, act))

    def when_flying(self, act: Callable[[], object]) -> None:
        self.when(lambda: self.operator.flying, act)

    def place(self) -> PoolPosition:
        pool = self.pilot._pilot.pool
        assert pool is not None
        return pool.place(ADRIFT)

    def go_on(self) -> None:
        self.navigation = ADRIFT

    def also(self, node: AllocatorNode) -> None:
        """Turn another node with the pilot, until the end."""
        self._executor.add_node(node)
        self._others.append(node)

    def close(self) -> None:
        self._executor.shutdown()
        for node in self._others:
            node.destroy_node()
        self.pilot.close()
        self.pilot.destroy_node()
        self.operator.__exit__()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        made = Bench()
        made.operator.wait_for_time()
        try:
            yield made
        finally:
            made.close()


def test_the_operator_states_where_the_vehicle_is_and_the_navigator_receives_of_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    known: list[bool] = []
    bench.pilot.confirm_position = lambda: known.append(True)
    bench.until(lambda: bench.pilot._pilot.pool is not None)
    recentre(bench.operator, 4.0, 2.0, math.nan)
    bench.until(lambda: bench.operator.place and bench.operator.place.along == 4.0)
    reported = latest(bench.operator.place)
    assert reported.across == 2.0
    assert dict(zip(reported.walls, reported.distances, strict=True))["west"] < 2.0
    assert reported.margin == pytest.approx(0.3), "an odometry without a covariance vouches for its positions"
    place = bench.place()
    assert (place.x_m, place.y_m, known) == (4.0, 2.0, [True])
    for x_m, y_m, turned in itertools.product((math.inf, -1e308, 11.0, math.nan), (2.0,), (math.nan, math.inf, 1e308)):
        with pytest.raises(HindraxError, match=r"recentre: (x|heading): found .* wanted"):
            recentre(bench.operator, x_m, y_m, turned)
    monkeypatch.setattr(bench.operator, "now", lambda: Stamp(1))
    with pytest.raises(HindraxError, match="recentre: "):
        recentre(bench.operator, 5.0, 3.0, math.nan)
    place = bench.place()
    assert (place.x_m, place.y_m, known) == (4.0, 2.0, [True])


@pytest.mark.parametrize("armings", [0, 2])
def test_a_pilot_that_begins_after_an_arming_knows_no_place_until_it_is_given(bench: Bench, armings: int) -> None:
    bench.state.armings = armings
    bench.say_armed(armed=True)
    if armings:
        assert "armed before this pilot began" in bench.fly()
        recentre(bench.operator, 5.0, 3.0, math.nan)
    bench.when_flying(bench.operator.cancel_all)
    assert bench.fly() == "cancelled: by the operator"


def test_the_plans_follow_parameters_and_thrusters_and_reach_who_comes_late(bench: Bench) -> None:
    def plans() -> dict[str, str]:
        found = bench.operator.plans
        return dict(zip(found.motions, found.plans, strict=True)) if found else {}

    pilot = bench.pilot
    bench.until(plans)
    default = {motion: str(plans_of(load_vehicle(default_vehicle()), (motion,))[0]) for motion in AXES}
    assert plans() == default
    pilot.set_parameters([Parameter("plan.surge_mps", value=[0.1, 0.3])])
    bench.until(lambda: plans()["surge"] != default["surge"])
    assert plans()["surge"].startswith("surge: 0.30, 0.10, 0.20 m/s")
    assert plans() | {"surge": default["surge"]} == default
    pilot._publish_disabled(dict.fromkeys(("T1", "T2", "T3", "T4"), "weed"), Stamp(bench.operator.now()))
    bench.until(lambda: "without T1" in plans()["surge"])
    assert math.isnan(latest(bench.operator.plans).seconds[0])
    late: list[Any] = []
    subscription(bench.operator.node, PLANS, late.append)
    bench.until(lambda: late)
    assert late[0].plans == latest(bench.operator.plans).plans


def test_the_idle_force_is_raised_while_yaw_is_weighed_and_set_back(bench: Bench) -> None:
    allocator = AllocatorNode(load_vehicle(default_vehicle()))
    bench.also(allocator)

    def idle_N() -> float:
        return float(allocator.get_parameter(IDLE_FORCE).value)

    told: list[str] = []
    allocator.set_parameters([Parameter(IDLE_FORCE, value=3.0)])
    with idle_force_times(bench.operator, 2.0, told.append):
        assert idle_N() == 6.0
    assert idle_N() == 3.0
    with idle_force_times(bench.operator, 1.0, told.append):
        assert idle_N() == 3.0
    assert told == []
    with idle_force_times(bench.operator, 20.0, told.append):
        assert idle_N() == 3.0, "it is refused"
    (sentence,) = told
    assert "idle force left as it is (the allocator refused idle_bias_N 60: " in sentence


def estimate(stamp: Stamp, motion: str = "surge", values: tuple[float, float] = (66.1, 1.3)) -> Stamped[Estimate]:
    reported = Estimate(
        motion,
        ("k_q", "k_l"),
        units=("N s^2/m^2", "N s/m"),
        values=values,
        covariance=((0.16, 0.0), (0.0, 0.25)),
        samples=120,
        effective_samples=80.0,
        learning=True,
        reason="",
    )
    return Stamped(stamp, reported)


def test_feedback_shows_what_is_known_of_the_motion_flown(bench: Bench) -> None:
    bench.say_armed(armed=True)
    received = []
    client = ActionClient(bench.operator.node, FlyManeuver, "maneuver/fly")
    bench.until(client.server_is_ready)
    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="neutral")
    goal.stamp = stamp_to_msg(bench.operator.now())
    client.send_goal_async(goal, feedback_callback=lambda message: received.append(message.feedback))
    bench.until(lambda: received)
    assert (received[-1].motion, received[-1].phase) == ("surge", "settle")
    assert not received[-1].coefficients
    assert not received[-1].learning

    def reported(done: Callable[[Any], Any]) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done(received[-1]):
            assert time.monotonic() < deadline, received[-1]
            bench.operator.spin()

    bench.estimates.publish(estimate_to_msg(estimate(bench.operator.now(), motion="sway", values=(1.0, 2.0))))
    bench.estimates.publish(estimate_to_msg(estimate(bench.operator.now())))
    reported(lambda last: last.learning)
    assert received[-1].coefficients == ["k_q", "k_l"]
    assert received[-1].units == ["N s^2/m^2", "N s/m"]
    assert list(received[-1].estimates) == [66.1, 1.3]
    assert list(received[-1].sigmas) == pytest.approx([0.4, 0.5])
    reported(lambda last: not last.learning)  # nothing is heard of the identifier any more
    assert list(received[-1].estimates) == [66.1, 1.3]
    client.destroy()


def test_an_arm_request_that_came_too_late_is_made_again_for_a_mock_alone(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers: list[int] = []

    def answer(request: Any, response: Any) -> Any:
        response.accepted = len(answers) == patience
        response.reason = "" if response.accepted else "request is 1.2 s old, wanted at most 1 s"
        response.error_code = 0 if response.accepted else Reason.LATE
        answers.append(request.sequence)
        bench.state.armed = response.accepted
        return response

    service = bench.pilot.create_service(Arm, "thrusters/arm", answer)
    patience = 99
    for mock, asked in ((False, 1), (True, 5)):
        monkeypatch.setattr(bench.operator, "_mock", mock)
        answers.clear()
        with pytest.raises(HindraxError, match=r"the thrusters refused to arm: request is 1\.2 s old"):
            bench.operator.arm(seconds=PATIENT_S)
        assert len(set(answers)) == asked
    answers.clear()
    patience = 2
    bench.operator.arm(seconds=PATIENT_S)
    assert len(answers) == 3
    bench.pilot.destroy_service(service)


def test_a_goal_that_nobody_can_fly_is_reported_why(bench: Bench) -> None:
    bench.say_armed(armed=True)
    assert bench.fly(["loop"]) == "goal: motion 'loop' unknown, wanted one of surge, sway, heave, roll, pitch, yaw"
    assert bench.fly([]).reason is Reason.GOAL
    assert bench.fly(excitation="noise").reason is Reason.GOAL


def test_pulses_of_thrusters_need_the_allocator_in_the_process_of_the_pilot(bench: Bench) -> None:
    bench.say_armed(armed=True)
    goal = Goal((), on_cancel="neutral", pulses=(Pulse((2.0, *(0.0,) * 7), 0.5),))
    assert bench.operator.fly(goal, PATIENT_S)[0].reason is Reason.ELSEWHERE


def test_a_goal_that_was_late_is_asked_again_and_given_its_age_in_the_end(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.say_armed(armed=True)
    true = bench.operator.now
    asked: list[str] = []

    def now() -> Stamp:
        return after(true(), -3.0 if bench.operator.maneuver is None and len(asked) < patience else 0.0)

    def judge(request: Any, judge: Callable[[Any], str] = bench.pilot._unflyable) -> str:
        asked.append(judge(request))
        return asked[-1]

    monkeypatch.setattr(bench.operator, "now", now)
    monkeypatch.setattr(bench.pilot, "_unflyable", judge)
    patience = 99
    wanted = r"late: the goal is 3\.\d s old, wanted at most 1\.0 s; try again, .*set the clocks.*"
    assert re.fullmatch(wanted, bench.fly())
    assert len(asked) == 5
    asked.clear()
    patience = 1
    bench.when_flying(bench.operator.cancel_all)
    assert bench.fly() == "cancelled: by the operator"
    assert len(asked) == 2


def test_before_arming_and_while_a_guard_objects_nothing_begins(bench: Bench) -> None:
    refused = bench.fly()
    assert refused == "start: the vehicle is not armed (not armed since start); `./hindrax arm` first"
    assert refused.reason is Reason.NOT_ARMED
    bench.say_armed(armed=True)
    bench.navigation = replace(ADRIFT, altitude_m=0.3)
    refused = bench.fly()
    assert re.fullmatch(r"start: altitude_band: 0\.10 m of water .*, wanted 0\.15 m; let it rise .*", refused)
    assert refused.reason is Reason.ALTITUDE_BAND


def test_one_goal_at_a_time_and_the_second_is_reported_so(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    # The first one waits for as long as the second takes to be refused, on any machine.
    monkeypatch.setattr(pilot_node, "SILENT_S", math.inf)
    client = ActionClient(bench.operator.node, FlyManeuver, "maneuver/fly")
    bench.until(client.server_is_ready)
    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="neutral")
    goal.stamp = stamp_to_msg(bench.operator.now())
    bench.navigation = None  # so that the first one waits
    first = client.send_goal_async(goal)
    bench.until(first.done)
    assert bench.fly() == "start: a maneuver is being flown; `./hindrax stop` ends it"
    bench.say_armed(armed=True)
    bench.navigation = ADRIFT
    bench.until(lambda: bench.operator.flying == "surge")
    assert bench.fly().reason is Reason.BUSY
    assert bench.operator.flying == "surge"
    client.destroy()


def test_the_first_reason_of_a_disarming_stands_where_others_came_before_the_next_state(bench: Bench) -> None:
    """An autopilot that freezes takes its sensors with it, and its output has another reason when they are back."""
    bench.say_armed(armed=True)

    def freeze() -> None:
        bench.navigation = None
        bench.state = ThrusterState(reason=f"the autopilot has fallen silent; {LEFT_ARMED}", pulses=[1500.0] * 8)
        bench.when(lambda: latest(bench.operator.thrusters).reason.startswith("the autopilot"), thaw)

    def thaw() -> None:
        bench.state = ThrusterState(reason=f"still answering; {LEFT_ARMED}", pulses=[1500.0] * 8)
        bench.when(lambda: latest(bench.operator.thrusters).reason.startswith("still"), bench.go_on)

    bench.when_flying(freeze)
    ended = bench.fly()
    assert ended == "disarmed: the autopilot has fallen silent; arm and fly again"


def test_a_flight_whose_autopilot_is_gone_ends_by_that_and_not_by_the_state_that_went_with_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pilot_node, "SILENT_S", 1.0)
    bench.say_armed(armed=True)

    def kill() -> None:
        bench.navigation = None
        bench.state = ThrusterState(reason=f"cannot connect; {LEFT_ARMED}", pulses=[1500.0] * 8)

    bench.when_flying(kill)
    assert bench.fly() == "disarmed: cannot connect; arm and fly again"


def test_disarming_ends_it_with_the_thrusters_own_reason(bench: Bench) -> None:
    bench.say_armed(armed=True)
    bench.when_flying(lambda: setattr(bench, "state", DISARMED))
    ended = bench.fly()
    assert ended == "disarmed: output is faulted: no answer; arm and fly again"
    assert (ended.reason, latest(bench.operator.maneuver).error_code) == (Reason.DISARMED, Reason.DISARMED)


def test_without_a_state_of_the_vehicle_a_maneuver_ends_and_reports_it(bench: Bench) -> None:
    bench.say_armed(armed=True)
    bench.when_flying(lambda: setattr(bench, "navigation", None))
    wanted = r"navigation: no state of the vehicle for [567] s, so the thrusters are neutral; .*`\./hindrax doctor`.*"
    assert re.fullmatch(wanted, bench.fly())
    assert (latest(bench.operator.maneuver).phase, bench.operator.flying) == ("aborted", "")
    assert bench.fly().reason is Reason.NAVIGATION
    bench.navigation = ADRIFT
    bench.when_flying(bench.operator.cancel_all)
    assert bench.fly() == "cancelled: by the operator"


def test_a_goal_cancelled_before_it_begins_is_not_begun(bench: Bench) -> None:
    bench.navigation = None
    bench.when(lambda: bench.pilot._goal is not None, bench.operator.cancel_all)
    bench.when(lambda: bench.pilot._goal is None or bench.pilot._goal.handle.is_cancel_requested, bench.go_on)
    assert bench.fly() == "cancelled: by the operator"


def test_a_result_that_went_lost_is_reported_from_the_last_word(bench: Bench) -> None:
    bench.say_armed(armed=True)
    operator = bench.operator
    operator.maneuver = ManeuverStatus(phase="done")
    assert operator._lost_outcome() == ""
    operator.maneuver = ManeuverStatus(phase="aborted", aborted="battery: 12.0 V")
    assert operator._lost_outcome() == "battery: 12.0 V"
    operator.maneuver, operator.thrusters = ManeuverStatus(phase="plateau"), DISARMED
    assert re.fullmatch(
        r"link: no status of the maneuver for 10 s, and the thrusters are faulted \(.*: no answer\); .*fly again",
        operator._lost_outcome(),
    )
