"""Conversion between our readings and ROS messages, both ways; holds the table of signs.

Inside, everything is SNAME (x forward, y starboard, z down). Outside, bodies and sensors are REP-103 (x forward, y
left, z up), the world is east, north, up (REP-105).

| quantity | inside | message |
|---|---|---|
| vector in a body or DVL frame | (x, y, z) | (x, -y, -z) |
| roll, pitch, yaw | phi, theta, psi (clockwise from north) | phi, -theta, pi/2 - psi |
| position | north, east, depth | east, north, -depth |
| ICM-20948 vectors | axes of the chip | axes of the chip, frame `icm20948_link` (REP-145) |
"""

import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion as QuaternionMsg
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.rotation import FLU, FSD, foreign_frame, sname_from_xyzw, unprefixed, xyzw_from_sname
from hindrax_core.signals import Consistency, Estimate, Navigation
from hindrax_msgs.msg import ModelEstimate

UNKNOWN_COVARIANCE = -1.0
UNIT = 0.01
"""Largest error of the length of an orientation."""


def stamp_to_msg(stamp: int) -> Time:
    """ROS time message of a stamp."""
    seconds, nanoseconds = divmod(int(stamp), NS_PER_S)
    return Time(sec=seconds, nanosec=nanoseconds)


def header(stamp: int, frame: str = "") -> Header:
    """Header of a message."""
    return Header(stamp=stamp_to_msg(stamp), frame_id=frame)


def stamp_from_msg(time: Time) -> Stamp:
    """Stamp of a ROS time message."""
    return Stamp(time.sec * NS_PER_S + time.nanosec)


def half_turn(vector: Sequence[float]) -> Vec3:
    """Turn a vector half way about x: from forward-starboard-down to forward-left-up, and back."""
    return (vector[0], -vector[1], -vector[2])


def vector_to_msg(vector: Sequence[float]) -> Vector3:
    """Message of a vector."""
    return Vector3(x=float(vector[0]), y=float(vector[1]), z=float(vector[2]))


def _plain(vector: Vector3) -> Vec3:
    return (vector.x, vector.y, vector.z)


def quaternion_from_sname(roll: float, pitch: float, yaw: float) -> QuaternionMsg:
    """Orientation of the REP-103 body in east, north, up, from SNAME angles.

    Parameters
    ----------
    roll, pitch, yaw : [rad]
        Of the SNAME body in north, east, down.

    Returns
    -------
    QuaternionMsg
        x, y, z, w of length one.
    """
    x, y, z, w = xyzw_from_sname(roll, pitch, yaw)
    return QuaternionMsg(x=x, y=y, z=z, w=w)


def odometry_from_msg(message: Odometry, prefix: str = "") -> Stamped[Navigation]:
    """State in any odometry of `base_link` in a world with z up, as REP-105 has it; z = 0 is the surface.

    Parameters
    ----------
    message
        A variance of zero or less in it means unknown.
    prefix
        Of the frames of our vehicle; empty: any.

    Returns
    -------
    Stamped[Navigation]
        In SNAME axes; the altitude is NaN.

    Raises
    ------
    ValueError
        For other frames, with the refusal where they are another vehicle's, and for what is no orientation.
    """
    world, body = message.header.frame_id, message.child_frame_id
    if foreign := foreign_frame(body, prefix):
        raise ValueError(foreign)
    if unprefixed(body) != FLU or not world or world.lower().endswith("ned"):
        raise ValueError(f"found {body[:40]!r} in {world[:40]!r}, wanted {FLU!r} in a world with z up, such as 'odom'")
    q, position, twist = message.pose.pose.orientation, message.pose.pose.position, message.twist.twist
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(length - 1.0) <= UNIT:
        raise ValueError(f"found an orientation of length {length:g}, wanted 1")
    sigma = [_sigma(variance) for variance in message.twist.covariance[::7]]
    tilt_variances = (message.pose.covariance[21], message.pose.covariance[28])
    velocity_mps = half_turn(_plain(twist.linear))
    state = Navigation(
        attitude_rad=sname_from_xyzw(q.x, q.y, q.z, q.w),
        rate_radps=half_turn(_plain(twist.angular)),
        velocity_mps=velocity_mps,
        depth_m=-position.z,
        altitude_m=math.nan,
        position_m=(position.y, position.x),
        dvl_locked=all(map(math.isfinite, velocity_mps)),
        velocity_sigma_mps=(sigma[0], sigma[1], sigma[2]),
        consistency=Consistency(tilt_sigma_rad=math.sqrt(max(0.0, *tilt_variances))),
        position_sigma_m=max(map(_sigma, message.pose.covariance[:8:7])),
    )
    return Stamped(stamp_from_msg(message.header.stamp), state)


def _sigma(variance: float) -> float:
    return math.sqrt(variance) if variance > 0.0 else math.nan


def wrench_to_msg(stamp: Stamp, wrench: Vec6, prefix: str = "") -> WrenchStamped:
    """Wrench as a message in the SNAME body frame.

    Parameters
    ----------
    stamp
        When it was made.
    wrench : [N, N m]
        About the center of mass, SNAME axes.
    prefix
        Of the frame.

    Returns
    -------
    WrenchStamped
        In base_link_fsd.
    """
    made = Wrench(force=vector_to_msg(wrench[:3]), torque=vector_to_msg(wrench[3:]))
    return WrenchStamped(header=header(stamp, prefix + FSD), wrench=made)


def wrench_from_msg(message: WrenchStamped) -> Vec6:
    """Six numbers in whatever frame the header names."""
    return (*_plain(message.wrench.force), *_plain(message.wrench.torque))


def estimate_to_msg(stamped: Stamped[Estimate], prefix: str = "") -> ModelEstimate:
    """Coefficients and covariance of one motion."""
    estimate = stamped.reading
    return ModelEstimate(
        header=header(stamped.stamp, prefix + FSD),
        motion=estimate.motion,
        names=list(estimate.names),
        units=list(estimate.units),
        values=list(estimate.values),
        covariance=[entry for row in estimate.covariance for entry in row],
        samples=estimate.samples,
        effective_samples=estimate.effective_samples,
        state="learning" if estimate.learning else "holding",
        reason=estimate.reason,
        last_innovation=estimate.innovation,
    )


def estimate_from_msg(message: ModelEstimate) -> Stamped[Estimate]:
    """Undo `estimate_to_msg`."""
    n = len(message.values)
    flat = list(message.covariance)
    estimate = Estimate(
        motion=message.motion,
        names=tuple(message.names),
        units=tuple(message.units),
        values=tuple(message.values),
        covariance=tuple(tuple(flat[row * n : row * n + n]) for row in range(n)),
        samples=message.samples,
        effective_samples=message.effective_samples,
        learning=message.state == "learning",
        reason=message.reason,
        innovation=message.last_innovation,
    )
    return Stamped(stamp_from_msg(message.header.stamp), estimate)
