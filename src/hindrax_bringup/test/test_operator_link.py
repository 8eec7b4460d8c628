"""The operator's end of the link: when it may conclude that a maneuver is over, and whose heartbeat it sends."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bringup.nodes.operator import Operator
from hindrax_core.events import Stamp, Stamped, after
from hindrax_msgs.msg import ManeuverStatus
from hindrax_ros.convert import stamp_to_msg

NOW = Stamp(1_000 * 10**9)


def unheard(maneuver_age_s, navigation_age_s):
    maneuver = None if maneuver_age_s is None else ManeuverStatus()
    if maneuver is not None:
        maneuver.header.stamp = stamp_to_msg(after(NOW, -maneuver_age_s))
    seen = SimpleNamespace(maneuver=maneuver, navigation=Stamped(after(NOW, -navigation_age_s), None), now=lambda: NOW)
    return Operator._unheard(seen)


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
def test_silence_about_a_maneuver(maneuver_age_s, navigation_age_s, over):
    assert unheard(maneuver_age_s, navigation_age_s) is over


def test_resting_the_heartbeat_leaves_other_timers_alone(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with Operator(mock=False) as operator:
        ticks = []
        with operator.repeating(0.02, lambda: ticks.append(None)):
            operator.beat(on=False)
            operator.wait(lambda: len(ticks) > 2, 10.0, lambda: "the other timer")
            assert [timer.is_canceled() for timer in operator.node.timers] == [True, False]
        operator.beat(on=True)
        assert not any(timer.is_canceled() for timer in operator.node.timers)
