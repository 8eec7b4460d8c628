"""A velocity where only poses are measured, by motion capture or tags: the mean over an interval, as a DVL gives it.

The way between two poses is turned into the body by the attitude halfway, v = R' (p_1 - p_0) / dt, and is valid in the
middle of its interval. Intervals follow each other, so what one end is off by is taken back by the next: the way does
not drift. What is identified after a flight fits the places themselves (`identify --odometry`).
"""

import math
from dataclasses import dataclass

from hindrax_core.events import Stamped, after, seconds_between
from hindrax_core.messages.contents import Read
from hindrax_core.readings import BottomVelocity, Reading, Vec3
from hindrax_core.rotation import matrix, sname_from_xyzw

LEAST_S, MOST_S = 0.19, 0.7
"""Intervals: shorter ones are all noise, longer ones hide what the vehicle did. Poses of 5 Hz come every 0.2 s."""
UNIT = 0.1
"""Difference of the size of a quaternion from 1 that is not rounding any more."""


@dataclass(frozen=True, slots=True)
class Pose(Reading):
    """Position [m] in a world with z up (REP-105), attitude of the body (x forward, y left, z up) as x, y, z, w.

    `sigma_m`: standard deviation of the position.
    """

    position_m: Vec3
    attitude: tuple[float, float, float, float]
    sigma_m: float


class VelocityOfPoses:
    """Reads messages of poses as velocities."""

    def __init__(self, read: Read[Reading]) -> None:
        """Take the reader of the poses."""
        self._read = read
        self._begin: Stamped[Pose] | None = None
        self._seen: Pose | None = None

    def __call__(self, data: bytes) -> Stamped[Reading]:
        """Read a message.

        Parameters
        ----------
        data
            Bytes of a pose.

        Returns
        -------
        Stamped[Reading]
            A BottomVelocity with the middle of its interval; a bare Reading while an interval lasts.

        Raises
        ------
        ValueError
            For a pose that is none, or that no velocity follows from.
        """
        found = self._read(data)
        pose = _checked(found.reading)
        if self._seen is not None and pose.attitude == self._seen.attitude:
            # A tracker that repeats what it no longer sees; or a position without an attitude.
            raise ValueError(
                "found the same attitude twice, to the last digit, wanted that of the vehicle as it is seen"
            )
        self._seen = pose
        before, since_s = self._begin, math.inf
        if before is not None:
            since_s = seconds_between(before.stamp, found.stamp)
        if 0.0 <= since_s < LEAST_S:
            return Stamped(found.stamp, Reading())
        self._begin = Stamped(found.stamp, pose)
        if before is None or since_s < 0.0:
            return Stamped(found.stamp, Reading())
        if since_s > MOST_S:
            raise ValueError(f"found {since_s:.2f} s between poses, wanted at most {MOST_S:g} s")
        return Stamped(after(before.stamp, 0.5 * since_s), _velocity(before.reading, pose, since_s))


def _checked(reading: Reading) -> Pose:
    """The pose; ValueError for one that cannot be."""
    assert isinstance(reading, Pose)
    size = math.hypot(*reading.attitude)
    if not all(map(math.isfinite, reading.position_m)) or not abs(size - 1.0) < UNIT:
        raise ValueError(f"found a position of {reading.position_m} m and a quaternion of length {size:.2g}, wanted 1")
    return reading


def _velocity(begin: Pose, end: Pose, interval_s: float) -> BottomVelocity:
    """Mean velocity between two poses."""
    # Both signs of a quaternion are the same turn.
    sign = math.copysign(1.0, math.fsum(a * b for a, b in zip(begin.attitude, end.attitude, strict=True)))
    between = [a + sign * b for a, b in zip(begin.attitude, end.attitude, strict=True)]
    size = math.hypot(*between)
    x, y, z, w = (part / size for part in between)
    turn = matrix(sname_from_xyzw(x, y, z, w))
    east, north, up = (b - a for a, b in zip(begin.position_m, end.position_m, strict=True))
    way_m = (north, east, -up)
    u, v, w = (math.fsum(turn[row][axis] * way_m[row] for row in range(3)) / interval_s for axis in range(3))
    return BottomVelocity((u, v, w), math.hypot(begin.sigma_m, end.sigma_m) / interval_s, 1.0, interval_s, 0)
