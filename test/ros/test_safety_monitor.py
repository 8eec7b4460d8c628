"""The safety monitor of a vehicle whose operator is silent: its requests to other nodes, once, and its reports."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs", reason="needs the built workspace: run ./hindrax test")

import rclpy
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor

from hindrax_bringup.liveness import LivenessFile
from hindrax_bringup.network.link_monitor import HOLD, NEUTRAL, STAY
from hindrax_bringup.nodes import safety_monitor
from hindrax_bringup.nodes.safety_monitor import SafetyMonitor
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.stack_time import VARIABLE, StackTime, epoch_ns
from hindrax_core.topics import (
    DIAGNOSTICS,
    HEARTBEAT,
    NAMESPACE,
    THRUSTER_HEALTH,
    THRUSTER_HEALTH_ORDER,
    THRUSTER_STATE,
)
from hindrax_msgs.msg import Heartbeat, ThrusterHealth, ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_to_msg

pytestmark = pytest.mark.ros
PATIENT_S = 60.0
TURN_S = 0.1


class Vehicle:
    """In the process of the safety monitor: thrusters and pilot that note their requests, and an operator.

    The link has a time of its own, so that no machine is too slow for it: `TURN_S` with every heartbeat that arrives,
    and with every turn while the operator is silent.
    """

    def __init__(self, monitor: SafetyMonitor) -> None:
        self.monitor, self.said, self.now_s = monitor, list[str](), 0.0
        monitor.report = self.said.append  # type: ignore[assignment, method-assign]  # heard here, not logged
        self.node = rclpy.create_node("stand_in", namespace=NAMESPACE)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(monitor)
        self.armed: list[bool] = []
        self.reasons: list[str] = []
        self.cancelled = 0
        self.link: dict[str, bytes] = {}
        self.clock: dict[str, bytes] = {}
        self.node.create_service(Arm, "thrusters/arm", self._arm)
        self.node.create_service(CancelGoal, "maneuver/fly/_action/cancel_goal", self._cancel)
        subscription(self.node, DIAGNOSTICS, self._diagnose)
        self.beat = publisher(self.node, HEARTBEAT)

    def _arm(self, request: Any, response: Any) -> Any:
        self.armed.append(request.arm)
        self.reasons.append(request.reason)
        response.accepted = True
        return response

    def _cancel(self, _request: Any, response: Any) -> Any:
        self.cancelled += 1
        return response

    def _diagnose(self, message: Any) -> None:
        self.link |= {one.message: one.level for one in message.status if one.name == "hindrax: link"}
        self.clock |= {one.message: one.level for one in message.status if one.name == "hindrax: clock"}

    def heartbeat(self, ahead_s: float = 0.0) -> Heartbeat:
        message = Heartbeat(source="test")
        message.header.stamp = stamp_to_msg(time.time_ns() + round(ahead_s * 1e9))
        return message

    def until(self, done: Callable[[], bool], *, beating: bool) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, self.said
            if beating:
                self.beat.publish(self.heartbeat())
            self.executor.spin_once(timeout_sec=0.05)
            self.monitor.drain()
            self.monitor.publish_queue.flush()
            self.now_s += TURN_S * (not beating or self.monitor._link.last_s == self.now_s)


@pytest.fixture
def real() -> None:
    """A stack with a time of its own, which a mock has not; `watched` sets it."""


@pytest.fixture
def watched(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Vehicle]:
    """Not `vehicle`: a fixture of that name lives as long as the session, and its parameters would too."""
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        if "real" in request.fixturenames:
            monkeypatch.setenv(VARIABLE, str(epoch_ns()))
        rclpy.init(args=["--ros-args", "-p", f"without_operator:={request.param}"])
        made = Vehicle(SafetyMonitor(LivenessFile(tmp_path / "pulse")))
        monkeypatch.setattr(safety_monitor, "time", SimpleNamespace(monotonic=lambda: made.now_s))
        yield made
        made.executor.shutdown()
        made.node.destroy_node()
        made.monitor.destroy_node()
        rclpy.shutdown()


def shown(watched: Vehicle) -> set[tuple[str, bytes]]:
    """What was published of the link, without times."""
    return {(re.sub(r" \d.*", "", words), level) for words, level in watched.link.items()}


@pytest.mark.parametrize(("watched", "asked"), [(HOLD, []), (NEUTRAL, [False])], indirect=["watched"])
def test_a_silent_operator_ends_what_flies_and_comes_back(watched: Vehicle, asked: list[bool]) -> None:
    watched.until(lambda: "link: an operator is connected" in watched.said, beating=True)
    begin_s = watched.now_s
    watched.until(lambda: watched.now_s > begin_s + 5.0, beating=True)
    assert watched.cancelled == 0
    watched.until(lambda: watched.cancelled > 0 and len(watched.armed) == len(asked), beating=False)
    assert any(one.startswith("link: no operator for 2 s") for one in watched.said)
    watched.until(lambda: any("back after" in one for one in watched.said), beating=True)
    watched.until(lambda: ("no operator for", DiagnosticStatus.WARN) in shown(watched), beating=True)
    assert watched.armed == asked
    assert watched.reasons == ["no operator for 2 s" for _ in asked], "a reason says that no operator asks"
    assert watched.cancelled == 1


@pytest.mark.usefixtures("real")
@pytest.mark.parametrize("step_s", [-3600.0, 1e8])
@pytest.mark.parametrize("watched", [STAY], indirect=True)
def test_a_wall_clock_that_is_set_disarms_and_is_reported_and_shown(watched: Vehicle, step_s: float) -> None:
    why = f"the wall clock was set {'back' if step_s < 0 else 'forward'} by {abs(step_s):.1f} s"
    thrusters = publisher(watched.node, THRUSTER_STATE)
    state = ThrusterState(armed=True, state="armed", pulses=[1500.0] * 8)

    def received() -> bool:
        thrusters.publish(state)
        return watched.monitor.armed

    watched.until(lambda: received() and watched.clock == {"as the wall clock": DiagnosticStatus.OK}, beating=False)
    assert watched.armed == []
    watched.monitor.stack_time = StackTime(epoch_ns() - round(step_s * 1e9))
    watched.until(lambda: received() and len(watched.armed) > 2, beating=False)
    assert not any(watched.armed)
    assert set(watched.reasons) == {why}, "a request may be lost: it is repeated"
    watched.until(lambda: any(one.startswith(f"clock: {why}") for one in watched.said), beating=False)
    assert [level for text, level in watched.clock.items() if text.startswith(why)] == [DiagnosticStatus.WARN]
    state.armed = False
    watched.until(lambda: not received(), beating=False)
    watched.monitor.repeat_disarm()
    state.armed = True
    watched.until(received, beating=False)
    asked = len(watched.armed)
    watched.monitor.repeat_disarm()
    assert len(watched.armed) == asked, "who arms anew after the step is not disarmed for it"


@pytest.mark.parametrize("watched", [STAY], indirect=True)
def test_without_a_tether_it_leaves_the_vehicle_alone(watched: Vehicle) -> None:
    watched.until(lambda: watched.now_s > 5.0, beating=False)
    assert (watched.armed, watched.cancelled, watched.said) == ([], 0, [])


@pytest.mark.parametrize("watched", [HOLD], indirect=True)
def test_a_heartbeat_that_is_not_of_now_is_no_operator_and_is_shown(watched: Vehicle) -> None:
    for ahead_s, why in ((-30.0, r"\d+\.\d s old, wanted at most 1\.0 s"), (3e8, "stamped .* in the future")):

        def refused(ahead_s: float = ahead_s, why: str = why) -> bool:
            watched.beat.publish(watched.heartbeat(ahead_s))
            wanted = f"no operator yet; refused: operator/heartbeat: the heartbeat is {why}"
            return any(re.search(wanted, words) for words in watched.link)

        watched.until(refused, beating=False)
    assert [one.partition(": the")[0] for one in watched.said] == ["refused: operator/heartbeat"]
    watched.until(lambda: "link: an operator is connected" in watched.said, beating=True)


@pytest.mark.parametrize("watched", [STAY], indirect=True)
def test_a_list_from_the_future_is_not_kept_and_does_not_outrank_a_later_one(watched: Vehicle) -> None:
    kept: list[list[str]] = []
    subscription(watched.node, THRUSTER_HEALTH_ORDER, lambda message: kept.append(list(message.disabled)))
    say = publisher(watched.node, THRUSTER_HEALTH)
    listed = ThrusterHealth(disabled=["T1"], reasons=["a test"])
    listed.header.stamp = stamp_to_msg(time.time_ns() + 10**18)
    say.publish(listed)
    watched.until(lambda: any("thrusters/health: the list is stamped" in one for one in watched.said), beating=False)
    listed.disabled, listed.header.stamp = ["T2"], stamp_to_msg(time.time_ns())
    say.publish(listed)
    watched.until(lambda: bool(kept), beating=False)
    assert kept == [["T2"]]
