"""The table of signs, axis by axis, and the way back."""

import math
from dataclasses import replace

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Vec3
from hindrax_core.rotation import sname_from_xyzw, xyzw_from_sname
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.refusals import Reason, unreadable
from hindrax_ros.messages import convert
from hindrax_ros.testing.state_messages import navigation_from_msg, navigation_to_msg, odometry_to_msg

STAMP = Stamp(1_234_567_890_123_456_789)
NAVIGATION = Navigation(
    attitude_rad=(0.1, -0.2, 2.5),
    rate_radps=(0.01, 0.02, -0.03),
    velocity_mps=(0.4, -0.1, 0.05),
    depth_m=0.9,
    altitude_m=0.8,
    position_m=(1.5, -2.5),
    dvl_locked=True,
    ages_s={"dvl75": 0.05, "ms5837": 0.01},
    velocity_sigma_mps=(0.01, 0.02, 0.03),
)


def rotate(q: Quaternion, v: tuple[int, int, int]) -> tuple[float, ...]:
    """v' = q v q*, written out independently of the code under test."""
    w, x, y, z = q.w, q.x, q.y, q.z
    m = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return tuple(sum(a * b for a, b in zip(row, v, strict=True)) for row in m)


def test_stamps_keep_every_nanosecond() -> None:
    assert convert.stamp_from_msg(convert.stamp_to_msg(STAMP)) == STAMP


@pytest.mark.parametrize(
    ("angles", "body_axis", "east_north_up"),
    [
        ((0.0, 0.0, 0.0), (1, 0, 0), (0, 1, 0)),  # heading north: the bow points north
        ((0.0, 0.0, math.pi / 2), (1, 0, 0), (1, 0, 0)),  # heading east
        ((0.0, 0.0, 0.0), (0, 1, 0), (-1, 0, 0)),  # heading north: port is west
        ((0.0, math.pi / 6, 0.0), (1, 0, 0), (0, math.cos(math.pi / 6), 0.5)),  # bow up
        ((math.pi / 6, 0.0, 0.0), (0, 1, 0), (-math.cos(math.pi / 6), 0, 0.5)),  # starboard down: port up
    ],
)
def test_orientation_is_rep_103_in_east_north_up(
    angles: Vec3, body_axis: tuple[int, int, int], east_north_up: Vec3
) -> None:
    assert rotate(convert.quaternion_from_sname(*angles), body_axis) == pytest.approx(east_north_up, abs=1e-12)


def test_orientation_there_and_back() -> None:
    angles = (0.3, -0.4, -2.0)
    assert sname_from_xyzw(*xyzw_from_sname(*angles)) == pytest.approx(angles)


def test_odometry_is_rep_105() -> None:
    message = odometry_to_msg(Stamped(STAMP, NAVIGATION))
    position = message.pose.pose.position
    assert (position.x, position.y, position.z) == (-2.5, 1.5, -0.9)
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    assert (linear.x, linear.y, linear.z) == (0.4, 0.1, -0.05)
    assert (angular.x, angular.y, angular.z) == (0.01, -0.02, 0.03)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")


def test_navigation_there_and_back() -> None:
    assert navigation_from_msg(navigation_to_msg(Stamped(STAMP, NAVIGATION))).reading == NAVIGATION


def test_estimate_there_and_back() -> None:
    estimate = Estimate(
        "surge", ("k_q", "b"), ("N s^2/m^2", "N"), (66.0, 0.1), ((1.0, 0.2), (0.2, 3.0)), 12, 8.5, True, "", 0.3
    )
    assert convert.estimate_from_msg(convert.estimate_to_msg(Stamped(STAMP, estimate))).reading == estimate


def test_wrench_there_and_back() -> None:
    wrench = (1.0, -2.0, 3.0, -4.0, 5.0, -6.0)
    message = convert.wrench_to_msg(STAMP, wrench)
    assert message.header.frame_id == "base_link_fsd"
    assert convert.wrench_from_msg(message) == wrench


def test_odometry_comes_back_with_all_that_it_holds() -> None:
    found = convert.odometry_from_msg(odometry_to_msg(Stamped(STAMP, NAVIGATION)))
    assert found.stamp == STAMP
    state = found.reading
    for name in ("attitude_rad", "rate_radps", "velocity_mps", "position_m", "velocity_sigma_mps"):
        assert getattr(state, name) == pytest.approx(getattr(NAVIGATION, name)), name
    assert state.depth_m == NAVIGATION.depth_m
    assert math.isnan(state.altitude_m)
    assert state.consistency.tilt_sigma_rad == 0.0
    assert math.isnan(state.position_sigma_m)  # nobody said


def test_the_uncertainty_of_a_position_travels_in_the_covariance_of_east_and_north() -> None:
    message = odometry_to_msg(Stamped(STAMP, replace(NAVIGATION, position_sigma_m=0.3)))
    assert [index for index, variance in enumerate(message.pose.covariance) if variance == 0.09] == [0, 7]
    assert convert.odometry_from_msg(message).reading.position_sigma_m == pytest.approx(0.3)


def test_the_covariance_of_an_odometry_is_the_uncertainty_of_its_tilt() -> None:
    message = odometry_to_msg(Stamped(STAMP, NAVIGATION))
    message.pose.covariance[21], message.pose.covariance[28] = 0.01, 0.04
    assert convert.odometry_from_msg(message).reading.consistency.tilt_sigma_rad == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("world", "body", "w", "wanted"),
    [
        ("map", "base_link", 0.9, "an orientation of length 0.9, wanted 1"),
        ("map", "base_link", math.nan, "an orientation of length nan"),
        ("map", "camera", 1.0, "found 'camera' in 'map', wanted 'base_link' in a world"),
        ("", "base_link", 1.0, "found 'base_link' in '', wanted"),
        ("local_ned", "base_link", 1.0, "in 'local_ned', wanted 'base_link' in a world with z up"),
    ],
)
def test_an_odometry_of_other_frames_or_no_attitude_is_refused(world: str, body: str, w: float, wanted: str) -> None:
    message = Odometry(child_frame_id=body)
    message.header.frame_id, message.pose.pose.orientation.w = world, w
    with pytest.raises(ValueError, match=wanted):
        convert.odometry_from_msg(message)


@pytest.mark.parametrize(
    ("frame", "prefix", "refused"),
    [
        ("base_link", "rov1/", False),
        ("rov1/base_link", "rov1/", False),
        ("fleet/rov1/base_link", "fleet/rov1/", False),
        ("rov2/base_link", "", False),
        ("rov2/base_link", "rov1/", True),
        ("fleet/rov1/base_link", "rov1/", True),
    ],
)
def test_a_frame_of_another_vehicle_is_refused_where_ours_have_a_prefix(frame: str, prefix: str, refused: bool) -> None:
    message = Odometry(child_frame_id=frame)
    message.header.frame_id = "odom"
    if not refused:
        assert convert.odometry_from_msg(message, prefix).reading.depth_m == 0.0
        return
    with pytest.raises(ValueError, match="of another vehicle") as raised:
        convert.odometry_from_msg(message, prefix)
    assert unreadable(raised.value).reason is Reason.FOREIGN_FRAME
