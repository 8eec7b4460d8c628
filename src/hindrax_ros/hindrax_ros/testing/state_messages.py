"""Messages of a navigation state, field by field, against which the bytes of `fast_serialization` are held."""

import math

from nav_msgs.msg import Odometry

from hindrax_core.events import Stamped
from hindrax_core.rotation import FLU, FSD
from hindrax_core.signals import Navigation
from hindrax_msgs.msg import NavigationStatus
from hindrax_ros.messages.convert import (
    half_turn,
    header,
    quaternion_from_sname,
    stamp_from_msg,
    vector_to_msg,
)


def odometry_to_msg(stamped: Stamped[Navigation]) -> Odometry:
    """Pose in `odom` (east, north, up from the start), twist in `base_link` (REP-105).

    Variances: of the velocities, and of east and north since the position was last known; NaN where unknown.
    """
    state = stamped.reading
    message = Odometry(header=header(stamped.stamp, "odom"), child_frame_id=FLU)
    north, east = state.position_m
    position = message.pose.pose.position
    position.x, position.y, position.z = east, north, -state.depth_m
    message.pose.pose.orientation = quaternion_from_sname(*state.attitude_rad)
    message.twist.twist.linear = vector_to_msg(half_turn(state.velocity_mps))
    message.twist.twist.angular = vector_to_msg(half_turn(state.rate_radps))
    for axis, sigma in enumerate(state.velocity_sigma_mps):
        message.twist.covariance[7 * axis] = sigma * sigma
    message.pose.covariance[0] = message.pose.covariance[7] = state.position_sigma_m**2
    return message


def navigation_to_msg(stamped: Stamped[Navigation]) -> NavigationStatus:
    """Full navigation state, SNAME."""
    state = stamped.reading
    ages = state.ages_s
    message = NavigationStatus(header=header(stamped.stamp, FSD))
    message.roll, message.pitch, message.heading = state.attitude_rad
    message.roll_rate, message.pitch_rate, message.yaw_rate = state.rate_radps
    message.surge_velocity, message.sway_velocity, message.heave_velocity = state.velocity_mps
    sigmas = state.velocity_sigma_mps
    message.surge_velocity_sigma, message.sway_velocity_sigma, message.heave_velocity_sigma = sigmas
    message.depth, message.altitude = state.depth_m, state.altitude_m
    message.position_north, message.position_east = state.position_m
    message.dvl_locked = state.dvl_locked
    message.depth_age, message.altitude_age = state.depth_age_s, state.altitude_age_s
    message.heave_velocity_age = min(message.depth_age, message.altitude_age)
    message.depth_valid = math.isfinite(state.depth_m)
    message.altitude_valid = math.isfinite(state.altitude_m)
    message.heave_velocity_valid = math.isfinite(state.velocity_mps[2])
    message.sources, message.ages = list(ages), list(ages.values())
    return message


def navigation_from_msg(message: NavigationStatus) -> Stamped[Navigation]:
    """Full navigation state, SNAME."""
    su, sv, sw = message.surge_velocity_sigma, message.sway_velocity_sigma, message.heave_velocity_sigma
    state = Navigation(
        attitude_rad=(message.roll, message.pitch, message.heading),
        rate_radps=(message.roll_rate, message.pitch_rate, message.yaw_rate),
        velocity_mps=(message.surge_velocity, message.sway_velocity, message.heave_velocity),
        depth_m=message.depth,
        altitude_m=message.altitude,
        position_m=(message.position_north, message.position_east),
        dvl_locked=message.dvl_locked,
        ages_s=dict(zip(message.sources, message.ages, strict=True)),
        velocity_sigma_mps=(su, sv, sw),
        depth_age_s=message.depth_age,
        altitude_age_s=message.altitude_age,
    )
    return Stamped(stamp_from_msg(message.header.stamp), state)
