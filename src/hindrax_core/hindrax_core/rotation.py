"""Body frames, and rotations in plain scalars: angles are roll, pitch, yaw, applied z-y-x (yaw first)."""

import math
from typing import TypeAlias

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, refused

FSD, FLU = "base_link_fsd", "base_link"
"""Frames of the body: x forward, y starboard, z down (SNAME); x forward, y left, z up (REP-103)."""


def unprefixed(frame: str) -> str:
    """Name of a frame without the prefix that a stack of several vehicles gives it, such as `rov1/base_link`."""
    return frame.rpartition("/")[2]


def foreign_frame(frame: str, prefix: str) -> Refusal:
    """Return why a frame is not of the vehicle with this prefix.

    Parameters
    ----------
    frame
        As a message has it, with or without a prefix.
    prefix
        Of our frames, such as `rov1/`; empty: frames of any vehicle are taken.

    Returns
    -------
    Refusal
        `FOREIGN_FRAME`; nothing where the frame is ours, or has no prefix itself.
    """
    its, _, name = frame.rpartition("/")
    if not (prefix and its) or f"{its}/" == prefix:
        return NOTHING
    return refused(Reason.FOREIGN_FRAME, frame=frame[:60], wanted=f"{prefix}{name[:40]}")


Matrix3: TypeAlias = tuple[Vec3, Vec3, Vec3]
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def matrix(angles_rad: Vec3) -> Matrix3:
    """Rotation from the turned frame into the reference frame, (3, 3)."""
    roll, pitch, yaw = angles_rad
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rotate(turn: Matrix3, vector: Vec3) -> Vec3:
    """Matrix times vector."""
    x, y, z = vector
    (a, b, c), (d, e, f), (g, h, i) = turn
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def half_turn(wrench: Vec6) -> Vec6:
    """Between base_link (x forward, y left, z up) and base_link_fsd: half a turn about x, its own inverse."""
    X, Y, Z, K, M, N = wrench
    return (X, -Y, -Z, K, -M, -N)


def wrapped(angle_rad: float) -> float:
    """Angle within plus or minus pi."""
    return math.remainder(angle_rad, math.tau)


def xyzw_from_sname(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Quaternion of the REP-103 body (forward, left, up) in east, north, up, from SNAME angles.

    Parameters
    ----------
    roll, pitch, yaw : [rad]
        Of the SNAME body (forward, right, down) in north, east, down.

    Returns
    -------
    tuple[float, float, float, float]
        x, y, z, w, as ROS messages have it.
    """
    return xyzw(roll, -pitch, math.pi / 2.0 - yaw)


def xyzw(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Quaternion of a z-y-x rotation: yaw first, then pitch about the new y, then roll about the new x.

    Parameters
    ----------
    roll, pitch, yaw : [rad]
        In any right-handed axes.

    Returns
    -------
    tuple[float, float, float, float]
        x, y, z, w of length one.
    """
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def sname_from_xyzw(x: float, y: float, z: float, w: float) -> Vec3:
    """SNAME angles from the quaternion of a REP-103 body in east, north, up; the inverse of `xyzw_from_sname`.

    Parameters
    ----------
    x, y, z, w
        Of length one.

    Returns
    -------
    Vec3
        Roll, pitch and yaw [rad], yaw clockwise from north.
    """
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (roll, -pitch, wrapped(math.pi / 2.0 - yaw))


def minus(a: Vec3, b: Vec3) -> Vec3:
    """Difference of two vectors in the same axes, such as a lever from the second place to the first."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
