"""Attitude of the mock vehicle: unit quaternions (w, x, y, z) that turn body vectors into the reference frame."""

from __future__ import annotations

import math

from hindrax_core.readings import Quaternion, Vec3


def quaternion(attitude_rad: Vec3) -> Quaternion:
    """Attitude of roll, pitch, yaw (z-y-x) as a unit quaternion. Fossen 2011, eq. 2.71."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in attitude_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler(attitude: Quaternion) -> Vec3:
    """Roll, pitch, yaw [rad] of a unit quaternion; at a pitch of 90 degrees the split of roll and yaw is arbitrary."""
    w, x, y, z = attitude
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x)))),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def rotate(attitude: Quaternion, vector: Vec3) -> Vec3:
    """Turn a vector by a unit quaternion: v + 2 w (e x v) + 2 e x (e x v)."""
    w, x, y, z = attitude
    a, b, c = vector
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx)
