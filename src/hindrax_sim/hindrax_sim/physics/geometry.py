"""Vectors, wrenches and attitudes of the mock vehicle, in plain scalars for speed.

Attitudes are unit quaternions (w, x, y, z) that turn body vectors into the reference frame.
"""

import math
from collections.abc import Sequence

from hindrax_core.readings import Quaternion, Vec3, Vec6


def plus(a: Vec3, b: Vec3, share: float = 1.0) -> Vec3:
    """Sum of a vector and a share of another.

    Parameters
    ----------
    a, b : (3,)
        In the same axes and unit.
    share
        Factor of `b`.

    Returns
    -------
    Vec3
        a + share b.
    """
    return (a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2])


def unit(vector: Vec3) -> Vec3:
    """The vector's direction."""
    x, y, z = vector
    norm = math.sqrt(x * x + y * y + z * z) or 1.0
    return (x / norm, y / norm, z / norm)


def lever_wrench(force: Vec3, lever_m: Vec3) -> Vec6:
    """Wrench about the center of mass of a force at a lever: [f; r x f]."""
    x, y, z = force
    a, b, c = lever_m
    return (x, y, z, b * z - c * y, c * x - a * z, a * y - b * x)


def combined(shares: Sequence[tuple[float, Vec6]]) -> Vec6:
    """Weighted sum of wrenches."""
    X = Y = Z = K = M = N = 0.0
    for factor, (x, y, z, k, m, n) in shares:
        X, Y, Z = X + factor * x, Y + factor * y, Z + factor * z
        K, M, N = K + factor * k, M + factor * m, N + factor * n
    return (X, Y, Z, K, M, N)


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


def rotate_back(attitude: Quaternion, vector: Vec3) -> Vec3:
    """Turn a vector of the reference frame into the body."""
    w, x, y, z = attitude
    return rotate((w, -x, -y, -z), vector)
