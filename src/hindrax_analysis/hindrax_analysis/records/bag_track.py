"""Data of one topic of a third-party bag: times, frame, and rows of velocities, forces, pulses or poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hindrax_bag.read.bag_reader import BagMessage
from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, AppliedWrench, pulses_of_channels
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array

VELOCITY_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
)
NAMED_VELOCITY_TYPES = (
    "geometry_msgs/msg/Twist",
    "sensor_msgs/msg/Imu",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
"""Used as velocities only when named: commands, rates alone, and positions have these types too."""
WRENCH_TYPES = ("geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench")

UNKNOWN = float("nan")
UNKNOWN_VARIANCE = 1e3


@dataclass(slots=True)
class Track:
    """Rows of one topic: times of the stamps (zero where there are none) and of receipt [ns], values, poses."""

    topic: str
    kind: str
    stamped: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    poses: list[list[float]] = field(default_factory=list)
    """Position and quaternion x, y, z, w; empty where the topic has none."""
    frame: str = ""

    def add(self, message: BagMessage) -> None:
        """Append one message."""
        content = message.decoded()
        header = getattr(content, "header", None)
        self.stamped.append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec if header else 0)
        self.received.append(message.received)
        self.frame = header.frame_id if header else ""
        if self.kind in WRENCH_TYPES:
            wrench = getattr(content, "wrench", content)
            self.rows.append(_six(wrench.force, wrench.torque))
        elif self.kind in PULSE_FIELDS:
            self.rows.append([float(value) for value in getattr(content, PULSE_FIELDS[self.kind])])
        else:
            self._add_motion(content)

    def _add_motion(self, content: Any) -> None:
        if hasattr(content, "pose"):
            pose = getattr(content.pose, "pose", content.pose)
            self.poses.append([*_six(pose.position, pose.orientation), float(pose.orientation.w)])
            # The header of a pose names the world.
            self.frame = getattr(content, "child_frame_id", "")
        if hasattr(content, "angular_velocity"):
            rate = content.angular_velocity
            self.rows.append([UNKNOWN, UNKNOWN, UNKNOWN, float(rate.x), float(rate.y), float(rate.z)])
        elif not self.kind.startswith("geometry_msgs/msg/Pose"):
            self.rows.append(_twist(getattr(content, "twist", content)))


def _six(linear: Any, angular: Any) -> list[float]:
    """Components of two vectors of a message."""
    return [float(value) for one in (linear, angular) for value in (one.x, one.y, one.z)]


def _twist(content: Any) -> list[float]:
    """Six velocities; NaN where the covariance marks one as not measured."""
    inner = getattr(content, "twist", content)
    variances = content.covariance[::7] if hasattr(content, "covariance") else [0.0] * 6
    pairs = zip(_six(inner.linear, inner.angular), variances, strict=True)
    return [value if 0.0 <= variance < UNKNOWN_VARIANCE else UNKNOWN for value, variance in pairs]


def quaternions_of(track: Track) -> Array:
    """Unit quaternions x, y, z, w: (n, 4) [-]; NaN where a message has none."""
    q = np.array(track.poses)[:, 3:]
    size = np.linalg.norm(q, axis=1)
    return array(q / np.where(size > 0.5, size, np.nan)[:, None])


def tilts_of(quaternions: Array) -> Array:
    """Roll and pitch (n, 2) [rad], in the axes of the quaternions."""
    x, y, z, w = quaternions.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return array(np.column_stack([roll, np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))]))


def wrenches_of(track: Track, vehicle: Vehicle | None) -> Array:
    """Wrench (n, 6) [N, N m] in SNAME axes from pulses by the thrust curves of a vehicle; pulse 0 means stop."""
    if vehicle is None or not vehicle.thrusters:
        raise UsageError(
            f"{track.topic}: holds pulses, wanted newtons; name a vehicle file with thrusters and curves by --vehicle"
        )
    applied = AppliedWrench(vehicle)
    try:
        pulses = [pulses_of_channels(vehicle, row) for row in track.rows]
    except ValueError as error:
        raise UsageError(f"{track.topic}: {error}") from error
    return np.array([applied.wrench(applied.forces_N(row)) for row in pulses])
