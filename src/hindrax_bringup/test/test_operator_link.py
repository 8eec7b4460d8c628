"""When the operator's end may conclude that a maneuver is over although its result never came."""

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
