"""The safety monitor without its graph: what it asks of others and when it asks again, what it keeps, what it says."""

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message

from hindrax_bringup.network.link_monitor import HOLD, NEUTRAL, STAY
from hindrax_bringup.nodes import safety_monitor
from hindrax_bringup.nodes.safety_monitor import SafetyMonitor
from hindrax_core import stack_time
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.topics import (
    DIAGNOSTICS,
    HEARTBEAT,
    THRUSTER_HEALTH,
    THRUSTER_HEALTH_ORDER,
    THRUSTER_STATE,
    Topic,
)
from hindrax_msgs.msg import Heartbeat, ThrusterHealth, ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.messages.convert import stamp_to_msg

LINK_S, AGAIN_S, REPORT_S = 0.1, 0.5, 1.0
"""Periods: of the look at the link, of requests to disarm, of what is reported."""
CANCEL, ARM = "maneuver/fly/_action/cancel_goal", "thrusters/arm"
NOW, EPOCH_ns = Stamp(1_700_000_000 * NS_PER_S), 1_600_000_000 * NS_PER_S


class Bench:
    """The node with its callbacks by topic and its timers, called by hand, and all that others get from it."""

    def __init__(self, patch: pytest.MonkeyPatch, *words: str) -> None:
        self.received: dict[str, Callable[[Any], None]] = {}
        self.timers: list[tuple[float, Callable[[], None]]] = []
        self.kept: list[str] = []
        self.asked: list[tuple[str, Any]] = []
        self.statuses: list[DiagnosticStatus] = []
        self.beats: list[tuple[str, dict[str, str], bool]] = []
        self.said: list[str] = []
        self.drained, self.now_s, self.stamp, self.wall_ns = 0, 1.0, NOW, EPOCH_ns
        patch.setattr(safety_monitor, "subscription", self._subscription)
        patch.setattr(safety_monitor, "publisher", self._publisher)
        patch.setattr(safety_monitor, "DiagnosticsPublisher", lambda _node: SimpleNamespace(publish=self._publish))
        patch.setattr(SafetyMonitor, "every", lambda _node, seconds, act: self.timers.append((seconds, act)))
        patch.setattr(SafetyMonitor, "create_client", self._client)
        patch.setattr(SafetyMonitor, "now", lambda _node: self.stamp)
        patch.setattr(BatchedNode, "drain", lambda _node: self._drain())
        patch.setattr(time, "monotonic", lambda: self.now_s)
        patch.setattr(stack_time, "epoch_ns", lambda: self.wall_ns)
        rclpy.init(args=["--ros-args", *words])
        self.monitor = SafetyMonitor(SimpleNamespace(beat=self._beat))  # type: ignore[arg-type]  # in its place
        self.report = self.monitor.report
        patch.setattr(self.monitor, "report", self.said.append)

    def _subscription(self, _node: object, topic: Topic, act: Callable[[Any], None], *, raw: bool = False) -> None:
        assert raw == (topic is THRUSTER_STATE), "read as bytes"
        self.received[topic.name] = act

    def _publisher(self, _node: object, topic: Topic) -> Any:
        assert topic is THRUSTER_HEALTH_ORDER
        return SimpleNamespace(publish=lambda message: self.kept.extend(message.disabled))

    def _client(self, kind: object, name: str) -> Any:
        assert kind is {CANCEL: CancelGoal, ARM: Arm}[name]
        return SimpleNamespace(call_async=lambda request: self.asked.append((name, request)))

    def _publish(self, now: Stamp, *statuses: DiagnosticStatus) -> None:
        assert now == self.stamp
        self.statuses += statuses

    def _beat(self, status: str, troubles: dict[str, str], *, armed: bool) -> None:
        self.beats.append((status, dict(troubles), armed))

    def _drain(self) -> None:
        self.drained += 1

    def every(self, period_s: float) -> list[DiagnosticStatus]:
        """Let the timers of a period act, and return what is published then."""
        self.statuses.clear()
        for seconds, act in self.timers:
            if seconds == period_s:
                act()
        return [*self.statuses]

    def look(self, now_s: float) -> list[DiagnosticStatus]:
        """Look at the link at a time [s]."""
        self.now_s = now_s
        return self.every(LINK_S)

    def beat(self, now_s: float, age_s: float = 0.0) -> None:
        """A heartbeat at a time, stamped so long ago [s]."""
        self.now_s, message = now_s, Heartbeat(source="test")
        message.header.stamp = stamp_to_msg(max(0, self.stamp - round(age_s * NS_PER_S)))
        self.received[HEARTBEAT.name](message)

    def steady(self) -> None:
        """An operator whose link is steady; the last heartbeat at 101.5 s."""
        for now_s in (100.0, 100.5, 101.0, 101.5):
            self.beat(now_s)

    def thrusters(self, *, armed: bool) -> None:
        state = ThrusterState(armed=armed, state="armed" if armed else "disarmed", pulses=[1500.0] * 8)
        self.received[THRUSTER_STATE.name](bytes(serialize_message(state)))

    def listed(self, name: str, stamp: int) -> None:
        """The pilot lists one thruster."""
        message = ThrusterHealth(disabled=[name], reasons=["a test"])
        message.header.stamp = stamp_to_msg(Stamp(stamp))
        self.received[THRUSTER_HEALTH.name](message)

    def clock(self, step_s: float) -> DiagnosticStatus:
        """Set the wall clock ahead of the time of the stack, and return what is said of it."""
        self.wall_ns = EPOCH_ns + round(step_s * NS_PER_S)
        (found,) = self.every(REPORT_S)
        return found

    def diagnosed(self, name: str, level: bytes, message: str) -> None:
        status = DiagnosticStatus(name=name, level=level, message=message)
        self.received[DIAGNOSTICS.name](DiagnosticArray(status=[status]))

    def reasons(self) -> list[str]:
        """Why it was asked to disarm, since the last time; nothing else may have been asked."""
        assert all(name == ARM and not request.arm for name, request in self.asked)
        assert all(request.stamp == stamp_to_msg(self.stamp) for _, request in self.asked)
        found = [request.reason for _, request in self.asked]
        self.asked.clear()
        return found


Make = Callable[..., Bench]


@pytest.fixture
def make(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.delenv(stack_time.VARIABLE, raising=False)
    made: list[Bench] = []

    def bench(without_operator: str = STAY, *words: str) -> Bench:
        made.append(Bench(monkeypatch, "-p", f"without_operator:={without_operator}", *words))
        return made[-1]

    yield bench
    for one in made:
        one.monitor.destroy_node()
    rclpy.try_shutdown()


@pytest.fixture
def real(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stack with a time of its own, which a mock has not."""
    del make  # which sees to it that there is none
    monkeypatch.setenv(stack_time.VARIABLE, str(EPOCH_ns))


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


@pytest.mark.parametrize(
    ("without_operator", "periods_s"),
    [(STAY, [AGAIN_S, REPORT_S]), (HOLD, [LINK_S, AGAIN_S, REPORT_S]), (NEUTRAL, [LINK_S, AGAIN_S, REPORT_S])],
)
def test_the_link_is_watched_where_an_operator_is_wanted(
    make: Make, without_operator: str, periods_s: list[float]
) -> None:
    bench = make(without_operator)
    assert sorted(seconds for seconds, _ in bench.timers) == periods_s
    assert (HEARTBEAT.name in bench.received) is (without_operator != STAY)


@pytest.mark.usefixtures("real")
def test_the_wall_clock_is_watched_where_the_stack_has_a_time_of_its_own(make: Make) -> None:
    assert sorted(seconds for seconds, _ in make().timers) == [AGAIN_S, REPORT_S, REPORT_S]


@pytest.mark.parametrize(
    ("without_operator", "asked", "what"),
    [(HOLD, [CANCEL], "maneuvers end, holds stay"), (NEUTRAL, [CANCEL, ARM], "disarming")],
)
def test_a_link_that_is_lost_ends_what_flies_once(
    make: Make, without_operator: str, asked: list[str], what: str
) -> None:
    bench = make(without_operator)
    bench.steady()
    bench.look(103.5)
    assert bench.asked == []
    bench.look(103.75)
    bench.look(104.0)
    assert [name for name, _ in bench.asked] == asked
    assert bench.asked.pop(0)[1] == CancelGoal.Request(), "all goals"
    assert bench.reasons() == ["no operator for 2 s"] * (without_operator == NEUTRAL)
    assert bench.said == ["link: an operator is connected", f"link: no operator for 2 s; {what}"]
    bench.beat(105.0)
    assert bench.said[2:] == ["link: the operator is back after 3.5 s"]
    bench.look(115.25)
    assert bench.said[3:] == [f"link: no operator for 10 s; {what}"], "longer while it is not steady"


def test_the_link_is_reported_once_a_second_and_its_loss_at_once(make: Make) -> None:
    bench = make(HOLD)
    (first,) = bench.look(1.0)
    assert (first.name, first.level, first.message) == ("hindrax: link", DiagnosticStatus.OK, "no operator yet")
    assert values(first) == {"age [s]": "0.0"}
    assert bench.look(1.75) == []
    assert len(bench.look(2.0)) == 1
    bench.steady()
    (there,) = bench.look(103.0)
    assert (there.level, there.message, values(there)) == (
        DiagnosticStatus.OK,
        "an operator is connected",
        {"age [s]": "1.5"},
    )
    (lost,) = bench.look(103.75)
    assert (lost.level, lost.message, values(lost)) == (
        DiagnosticStatus.WARN,
        "no operator for 2 s",
        {"age [s]": "2.2"},
    )
    assert bench.look(104.5) == []
    assert len(bench.look(104.75)) == 1


def test_a_heartbeat_that_is_not_of_now_is_no_operator_is_reported_once_and_counted(make: Make) -> None:
    bench = make(HOLD)
    why = "refused: operator/heartbeat: the heartbeat is {} s old, wanted at most 1.0 s; try again, and if"
    bench.beat(1.0, age_s=1.5)
    (found,) = bench.look(1.0)
    assert found.level == DiagnosticStatus.WARN
    assert found.message.startswith(f"no operator yet; {why.format(1.5)}")
    bench.beat(1.5, age_s=2.5)
    (found,) = bench.look(2.0)
    assert found.message.startswith(f"no operator yet; {why.format(2.5)}")
    assert values(found)["refused: operator/heartbeat"] == "2"
    (found,) = bench.look(3.0)
    assert (found.level, found.message) == (DiagnosticStatus.OK, "no operator yet"), "nothing new"
    assert values(found)["refused: operator/heartbeat"] == "2"
    (said,) = bench.said
    assert said.startswith(why.format(1.5))
    bench.beat(4.0, age_s=1.0)
    assert bench.said[1:] == ["link: an operator is connected"]


def test_before_the_time_is_known_a_heartbeat_is_neither_counted_nor_refused(make: Make) -> None:
    bench = make(HOLD)
    bench.stamp = Stamp(0)
    message = Heartbeat(source="test")
    message.header.stamp = stamp_to_msg(NOW)
    bench.received[HEARTBEAT.name](message)
    (found,) = bench.look(1.0)
    assert (found.level, found.message, bench.said) == (DiagnosticStatus.OK, "no operator yet", [])


@pytest.mark.parametrize(("mock", "there"), [("true", True), ("false", False)])
def test_on_the_clock_of_a_mock_orders_may_be_older(make: Make, mock: str, there: bool) -> None:
    bench = make(HOLD, "-p", f"use_sim_time:={mock}")
    bench.beat(1.0, age_s=9.0)
    assert (bench.said == ["link: an operator is connected"]) is there


def test_it_asks_again_until_the_thrusters_say_that_they_are_disarmed(make: Make) -> None:
    bench = make(NEUTRAL)
    bench.thrusters(armed=True)
    bench.every(AGAIN_S)
    assert bench.asked == [], "nothing was wrong"
    bench.steady()
    bench.look(103.75)
    bench.asked.pop(0)
    for _ in range(2):
        bench.every(AGAIN_S)
    assert bench.reasons() == ["no operator for 2 s"] * 3
    bench.thrusters(armed=False)
    bench.every(AGAIN_S)
    bench.thrusters(armed=True)
    bench.every(AGAIN_S)
    assert bench.asked == [], "who arms anew is not disarmed for what was before"


def test_bytes_that_are_no_state_of_the_thrusters_are_refused_and_change_nothing(make: Make) -> None:
    bench = make(HOLD)
    assert not bench.monitor.armed
    bench.thrusters(armed=True)
    for data in (b"", bytes(7)):
        bench.received[THRUSTER_STATE.name](data)
    assert bench.monitor.armed
    assert [one.partition(": ")[2].partition(":")[0] for one in bench.said] == ["thrusters/state"]
    (found,) = bench.look(1.0)
    assert values(found)["refused: thrusters/state"] == "2"


@pytest.mark.usefixtures("real")
def test_each_step_of_the_wall_clock_disarms_once(make: Make) -> None:
    bench = make()
    bench.thrusters(armed=True)
    found = bench.clock(0.0625)
    assert (found.name, found.level, found.message) == ("hindrax: clock", DiagnosticStatus.OK, "as the wall clock")
    assert values(found) == {"wall clock ahead [s]": "0.062"}
    assert bench.asked == []
    found, step = bench.clock(1.0625), "the wall clock was set forward by 1.1 s"
    assert (found.level, values(found)) == (DiagnosticStatus.WARN, {"wall clock ahead [s]": "1.062"})
    assert found.message == f"{step}; stamps do not follow until the stack restarts"
    assert bench.reasons() == [step]
    for step_s in (1.0625, 1.125):
        assert bench.clock(step_s).level == DiagnosticStatus.WARN
        assert bench.asked == [], "it is the same step"
    bench.clock(-3600.0)
    assert bench.reasons() == ["the wall clock was set back by 3600.0 s"]
    assert bench.clock(0.0).level == DiagnosticStatus.OK
    assert bench.asked == [], "all is as it was"
    bench.clock(-3600.0)
    assert bench.reasons() == ["the wall clock was set back by 3600.0 s"], "set anew"


@pytest.mark.usefixtures("real")
def test_a_step_of_the_wall_clock_before_the_first_look_disarms(make: Make) -> None:
    bench = make()
    bench.thrusters(armed=True)
    bench.clock(1.0)
    assert bench.reasons() == ["the wall clock was set forward by 1.0 s"]


@pytest.mark.usefixtures("real")
def test_a_step_of_the_wall_clock_before_arming_disarms_nobody(make: Make) -> None:
    bench = make()
    assert bench.clock(60.0).level == DiagnosticStatus.WARN
    bench.thrusters(armed=True)
    bench.clock(60.0)
    bench.every(AGAIN_S)
    assert bench.asked == []


def test_the_newest_list_of_thrusters_is_kept_once(make: Make) -> None:
    bench = make()
    bench.listed("T0", 0)
    assert (bench.kept, bench.said) == ([], []), "a pilot that knows of none"
    hour = 3600 * NS_PER_S
    for name, stamp in (("T2", NOW - hour), ("T2", NOW - hour), ("T1", NOW - 2 * hour), ("T3", NOW)):
        bench.listed(name, stamp)
    assert bench.kept == ["T2", "T3"]
    assert bench.said == []


def test_a_list_from_the_future_is_refused_and_outranks_no_other(make: Make) -> None:
    bench = make()
    bench.listed("T1", NOW + NS_PER_S // 5)
    assert (bench.kept, len(bench.said)) == ([], 1)
    assert bench.said[0].startswith("refused: thrusters/health: the list is stamped 0.20 s in the future")
    bench.listed("T2", NOW + NS_PER_S // 20)
    bench.stamp = Stamp(NOW - NS_PER_S)
    bench.listed("T3", NOW + NS_PER_S // 10)
    assert bench.kept == ["T2", "T3"], "a clock that was behind for a while keeps no list out"


def test_a_list_that_comes_before_the_time_is_kept_when_the_time_is_known(make: Make) -> None:
    bench = make()
    bench.stamp = Stamp(0)
    for name in ("T1", "T2"):
        bench.listed(name, 1)
    bench.monitor.drain()
    assert bench.kept == []
    bench.stamp = Stamp(1)  # the first nanosecond of a mock
    for _ in range(2):
        bench.monitor.drain()
    assert bench.kept == ["T2"]
    assert bench.drained == 3
    bench.listed("T3", 2)
    assert bench.kept == ["T2", "T3"]


def test_news_of_the_nodes_are_reported_and_their_troubles_are_in_the_pulse(make: Make) -> None:
    bench = make()
    bench.diagnosed("hindrax: link", DiagnosticStatus.WARN, "no operator for 2 s")
    bench.diagnosed("hindrax: dvl75", DiagnosticStatus.ERROR, "no reading for 1.5 s")
    bench.diagnosed("hindrax: dvl75", DiagnosticStatus.ERROR, "no reading for 2.5 s")
    bench.diagnosed("hindrax: pilot", DiagnosticStatus.OK, "ready")
    bench.thrusters(armed=True)
    bench.every(REPORT_S)
    bench.diagnosed("hindrax: dvl75", DiagnosticStatus.OK, "measuring")
    bench.thrusters(armed=False)
    bench.every(REPORT_S)
    assert bench.said == ["dvl75: no reading for 1.5 s", "pilot: ok", "dvl75: ok"]
    assert bench.beats == [
        ("nodes in /hindrax", {"dvl75": "no reading for 2.5 s", "pilot": ""}, True),
        ("nodes in /hindrax", {"dvl75": "", "pilot": ""}, False),
    ]


def test_what_is_reported_goes_to_stderr(make: Make, capsys: pytest.CaptureFixture[str]) -> None:
    make().report("link: an operator is connected")
    assert capsys.readouterr().err == "link: an operator is connected\n"
