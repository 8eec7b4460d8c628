"""The operator's end of the link: when it may conclude that a maneuver is over, and whose heartbeat it sends."""

import signal
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.topics import OPERATOR_WRENCH
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import ManeuverStatus, ThrusterState
from hindrax_operator.nodes.operator_node import Operator
from hindrax_ros.graph import subscription
from hindrax_ros.messages.convert import stamp_to_msg

NOW = Stamp(1_000 * 10**9)


def unheard(maneuver_age_s: float | None, navigation_age_s: float) -> bool:
    maneuver = None
    if maneuver_age_s is not None:
        maneuver = ManeuverStatus()
        maneuver.header.stamp = stamp_to_msg(after(NOW, -maneuver_age_s))
    navigation = Stamped(after(NOW, -navigation_age_s), None)
    seen: Any = SimpleNamespace(maneuver=maneuver, navigation=navigation, now=lambda: NOW)
    return Operator._maneuver_lost(seen)


@pytest.mark.parametrize(
    ("maneuver_age_s", "navigation_age_s", "over"),
    [
        (0.1, 0.02, False),  # it is being flown
        (9.0, 9.0, False),  # the link is down
        (60.0, 60.0, False),  # for long
        (60.0, 0.02, True),  # the link is back, and nobody speaks of a maneuver
        (None, 0.02, False),  # it has not begun
    ],
)
def test_silence_about_a_maneuver(maneuver_age_s: float | None, navigation_age_s: float, over: bool) -> None:
    assert unheard(maneuver_age_s, navigation_age_s) is over


def test_heartbeats_keep_the_pace_of_the_wall_though_the_clock_of_a_mock_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    beats: list[int] = []
    monkeypatch.setattr(Operator, "_send_heartbeat", lambda operator: beats.append(operator.now()))
    with Operator(mock=True) as operator:
        operator.wait(lambda: len(beats) > 1, 20.0, lambda: "a second heartbeat")
    assert beats == [0, 0]


def test_without_a_clock_no_heartbeat_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    sent: list[Any] = []
    with Operator(mock=True) as operator:
        monkeypatch.setattr(operator, "_heartbeats", SimpleNamespace(publish=sent.append))
        operator._send_heartbeat()
        assert sent == []
        monkeypatch.setattr(operator, "now", lambda: NOW)
        operator._send_heartbeat()
    assert [message.header.stamp.sec for message in sent] == [1_000]


def test_ctrl_c_in_a_callback_waits_for_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    ended: list[None] = []

    def interrupted() -> None:
        if operator.thrusters:  # in the executor, where C++ may have called
            signal.raise_signal(signal.SIGINT)
            ended.append(None)

    with Operator(mock=False) as operator, operator.repeating(0.02, interrupted):
        operator.thrusters = ThrusterState()
        with pytest.raises(KeyboardInterrupt):
            operator.pause(10.0)
        assert ended == [None]


def test_resting_the_heartbeat_leaves_other_timers_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with Operator(mock=False) as operator:
        ticks: list[None] = []
        with operator.repeating(0.02, lambda: ticks.append(None)):
            operator.beat(on=False)
            operator.wait(lambda: len(ticks) > 2, 10.0, lambda: "the other timer")
            assert [timer.is_canceled() for timer in operator.node.timers] == [True, False]
        operator.beat(on=True)
        assert not any(timer.is_canceled() for timer in operator.node.timers)


def test_what_a_timer_asked_for_before_its_end_is_not_done_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seen in 246 flights: a wrench was published again after its publisher had been destroyed."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with Operator(mock=False) as operator:
        ticks: list[None] = []
        with operator.repeating(60.0, lambda: ticks.append(None)):
            *_, timer = operator.node.timers
            late = timer.callback
            late()
        late()
    assert len(ticks) == 2


def clock_that_arrives(operator: Operator, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first /clock of a mock comes while the operator waits for it."""
    spun: list[None] = []
    monkeypatch.setattr(operator, "_tick", lambda: spun.append(None))
    monkeypatch.setattr(operator, "now", lambda: NOW if spun else Stamp(0))


def test_orders_wait_for_the_clock_but_not_a_disarm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a stamp an order is refused on board, a disarm obeyed: seen where the state was heard before /clock."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    asked: list[Any] = []

    def answer(request: Any) -> Any:
        asked.append(request.stamp.sec)
        reply = SimpleNamespace(accepted=False, reason="that is all", error_code=0)
        return SimpleNamespace(done=lambda: True, result=lambda: reply)

    with Operator(mock=True) as operator:
        clock_that_arrives(operator, monkeypatch)
        monkeypatch.setattr(operator, "_arm", SimpleNamespace(service_is_ready=lambda: True, call_async=answer))
        with pytest.raises(HindraxError, match="that is all"):
            operator.arm(arm=False)
        with pytest.raises(HindraxError, match="that is all"):
            operator.arm()
        clock_that_arrives(operator, monkeypatch)
        client = SimpleNamespace(send_goal_async=answer)
        with pytest.raises(HindraxError, match="without a reason"):
            operator._fly_to_its_end(client, FlyManeuver.Goal(), 1.0)
    assert asked == [0, 1_000, 1_000]


def test_who_sends_has_a_time_to_stamp_with(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with Operator(mock=True) as operator:
        subscription(operator.node, OPERATOR_WRENCH, lambda _: None)
        clock_that_arrives(operator, monkeypatch)
        with operator.sender(OPERATOR_WRENCH, "a reader"):
            assert operator.now() == NOW


def test_after_a_standstill_its_order_ends_with_the_remedy_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with Operator(mock=False) as operator:
        operator.spin()
        assert not operator.forgotten
        operator._watch._standstills.append(8.2)
        said = "this program stood still for 8 s, and ROS may have lost it; start it again"
        with pytest.raises(HindraxError, match=f"^{said}$"):
            operator.pause(10.0)
        assert operator.forgotten
        operator.spin()
