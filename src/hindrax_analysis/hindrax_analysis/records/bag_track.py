"""Data of one topic of a third-party bag: times, frame, and rows of velocities, forces, pulses or poses.

Poses beside velocities show the frame of the velocities; where there are none, velocities follow from poses.

Symbols: p position in the world, q = (x, y, z, w) unit quaternion of the body in the world, as messages have it, R(q)
its rotation from body to world; both signs of q are the same attitude.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.thruster_values import ThrusterValues
from hindrax_bag.read.bag_reader import BagMessage
from hindrax_core.messages.inputs import BOTTOM
from hindrax_core.signals import Supply
from hindrax_ident.arrays import Array, Flags, Index, array

VELOCITY_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
)
DOPPLER_TYPES = ("marine_acoustic_msgs/msg/Dvl", "dvl_msgs/msg/DVL", "waterlinked_a50_ros_driver/msg/DVL")
"""Reports of the instrument itself, where no topic of VELOCITY_TYPES has what a navigator made of them."""
NAMED_VELOCITY_TYPES = (
    "geometry_msgs/msg/Twist",
    "sensor_msgs/msg/Imu",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
"""Used as velocities only when named: commands, rates alone, and positions have these types too."""
PRESSURE, BATTERY = "sensor_msgs/msg/FluidPressure", "sensor_msgs/msg/BatteryState"
SCALARS = {PRESSURE: "fluid_pressure", BATTERY: "voltage"}
"""Types of one number, and its field."""
WRENCH_TYPES = ("geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench")

UNKNOWN = float("nan")
UNKNOWN_VARIANCE = 1e3
BIN_S = 0.1
"""Averaging time of positions; differences of the means are velocities."""
COMPARED_S = 0.5
"""Shortest time over which positions are compared with velocities, so that noise is negligible."""
FEWEST_POSES = 20
CLEAR_RATIO = 4.0
"""Ratio of mean squared errors above which one frame is the right one."""


STEP_BACK_S, STEP_BACK_PERIODS = 1.0, 20.0
"""Stamps that step back by more than both begin a record; by less it is jitter."""
EXACT_m = 1e-5
"""Deviation of positions that no instrument has."""


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
    world: str = ""
    """Frame of the poses."""
    values: ThrusterValues | None = None
    """Where the messages hold numbers of single thrusters instead of a wrench."""
    supplies_V: list[float] = field(default_factory=list)
    """Supply of the thrusters at each of these messages; empty: of the vehicle file."""
    supply: Supply = Supply.ASSUMED
    """How these are known."""

    def add(self, message: BagMessage) -> None:
        """Append one message; DamagedMessageError, and nothing is appended, where it cannot be decoded."""
        content = message.decoded()
        header = getattr(content, "header", None)
        self.stamped.append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec if header else 0)
        self.received.append(message.received)
        self.frame = header.frame_id if header else ""
        if self.kind in SCALARS:
            self.rows.append([float(getattr(content, SCALARS[self.kind]))])
        elif self.values is not None:
            self.rows.append(self.values.row(self.kind, content))
        elif self.kind in WRENCH_TYPES:
            wrench = getattr(content, "wrench", content)
            self.rows.append(_six(wrench.force, wrench.torque))
        else:
            self._add_motion(content)

    def parted(self, at: Sequence[int]) -> "list[Track]":
        """The messages before and from each index on: one track more than indices."""
        columns = ("stamped", "received", "rows", "poses", "supplies_V")
        ends = itertools.pairwise((0, *at, len(self.received)))
        return [replace(self, **{name: getattr(self, name)[i:end] for name in columns}) for i, end in ends]

    def _add_motion(self, content: object) -> None:
        if hasattr(content, "pose"):
            pose = getattr(content.pose, "pose", content.pose)
            self.poses.append([*_six(pose.position, pose.orientation), float(pose.orientation.w)])
            # The header of a pose names the world.
            self.frame, self.world = getattr(content, "child_frame_id", ""), self.frame
        if self.kind in DOPPLER_TYPES:
            self.rows.append([*_doppler(content), UNKNOWN, UNKNOWN, UNKNOWN])
        elif hasattr(content, "angular_velocity"):
            rate = content.angular_velocity
            self.rows.append([UNKNOWN, UNKNOWN, UNKNOWN, float(rate.x), float(rate.y), float(rate.z)])
            self.poses.append([UNKNOWN] * 3 + _orientation(content))
        elif not self.kind.startswith("geometry_msgs/msg/Pose"):
            self.rows.append(_twist(getattr(content, "twist", content)))


def steps_back(stamped: Sequence[int]) -> list[int]:
    """Messages (by their index) before which stamps [ns] step back and stay back: one alone came late."""
    t = 1e-9 * np.array(stamped, dtype=float)
    steps = np.diff(t)
    rising = steps[steps > 0.0]
    least_s = max(STEP_BACK_S, STEP_BACK_PERIODS * float(np.median(rising))) if len(rising) else math.inf
    found = np.flatnonzero(steps < -least_s) + 1
    return [int(i) for i in found if i + 1 < len(t) and t[i + 1] < t[i - 1]]


class Vector(Protocol):
    """A vector of a message, of the installed type or as a bag has it."""

    x: float
    y: float
    z: float


def _six(linear: Vector, angular: Vector) -> list[float]:
    """Components of two vectors of a message."""
    return [float(value) for one in (linear, angular) for value in (one.x, one.y, one.z)]


def _twist(content: Any) -> list[float]:
    """Six velocities; NaN where the covariance marks one as not measured."""
    inner = getattr(content, "twist", content)
    variances = content.covariance[::7] if hasattr(content, "covariance") else [0.0] * 6
    pairs = zip(_six(inner.linear, inner.angular), variances, strict=True)
    return [value if 0.0 <= variance < UNKNOWN_VARIANCE else UNKNOWN for value, variance in pairs]


def _doppler(content: object) -> list[float]:
    """Velocity over ground of the instrument's report; NaN where the report itself says that it is none.

    marine_acoustic_msgs: `velocity_mode` 1 is over ground, a variance below 0 no measurement. Drivers of Water Linked's
    instruments: `velocity_valid`, as in their JSON.
    """
    covariance = getattr(content, "velocity_covar", (0.0,))
    valid = (
        getattr(content, "velocity_valid", True)
        and getattr(content, "velocity_mode", BOTTOM) == BOTTOM
        and 0.0 <= covariance[0] < UNKNOWN_VARIANCE
    )
    if not (valid and hasattr(content, "velocity")):
        return [UNKNOWN] * 3
    v = content.velocity
    return [float(v.x), float(v.y), float(v.z)]


def _orientation(content: object) -> list[float]:
    """Quaternion x, y, z, w of an inertial sensor; NaN where its message says that it has none (covariance -1)."""
    if not hasattr(content, "orientation") or not getattr(content, "orientation_covariance", (-1.0,))[0] >= 0.0:
        return [UNKNOWN] * 4
    q = content.orientation
    return [float(q.x), float(q.y), float(q.z), float(q.w)]


def quaternions_of(track: Track) -> Array:
    """Unit quaternions x, y, z, w: (n, 4) [-]; NaN where a message has none."""
    q = np.array(track.poses)[:, 3:]
    size = np.linalg.norm(q, axis=1)
    return array(q / np.where(size > 0.5, size, np.nan)[:, None])


def tilts_of(quaternions: Array) -> Array:
    """Roll and pitch of the sequence yaw, pitch, roll.

    From the last row of R, which is where "up" is in the body: tan(roll) = R_32 / R_33, sin(pitch) = -R_31.

    Parameters
    ----------
    quaternions : (n, 4) [-]
        Unit quaternions x, y, z, w of the body in the world.

    Returns
    -------
    Array
        (n, 2) [rad], in the axes of the quaternions.
    """
    x, y, z, w = quaternions.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return array(np.column_stack([roll, np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))]))


# ---- poses


class FrameErrors(NamedTuple):
    """Mean squared difference between velocities, or rates, and the change of the pose, per assumption.

    `world`: velocities in the axes of the positions; `body`: in those of the vehicle; `still`: zero velocities;
    [m^2/s^2, rad^2/s^2].
    """

    world: float
    body: float
    still: float

    @classmethod
    def of(cls, *differences: Array) -> Self:
        """Mean squares of the differences (n, k) of each assumption."""
        return cls(*(float(np.mean(np.sum(one**2, axis=1))) for one in differences))

    @property
    def is_world(self) -> bool:
        """Whether positions and velocities agree only in world axes."""
        return self.still > CLEAR_RATIO * self.world and self.body > CLEAR_RATIO * self.world

    @property
    def is_neither(self) -> bool:
        """Whether positions and velocities disagree in both frames."""
        return min(self.world, self.body) > 0.5 * self.still


def to_body(vectors: Array, quaternions: Array) -> Array:
    """World vectors (n, 3) in body axes, by unit quaternions x, y, z, w of the body in the world, (n, 4)."""
    return to_world(vectors, quaternions * np.array([-1.0, -1.0, -1.0, 1.0]))


def to_world(vectors: Array, quaternions: Array) -> Array:
    """Body vectors (n, 3) in world axes: v + 2 w (e x v) + 2 e x (e x v), with q = (e, w); (n, 3)."""
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    across = 2.0 * np.cross(axis, vectors)
    return array(vectors + w * across + np.cross(axis, across))


def compare_frames(t_s: Array, positions: Array, quaternions: Array, velocities: Array) -> FrameErrors | None:
    """Compare velocities with rates of the positions in both frames that they may be of.

    Positions at least COMPARED_S apart are compared with the mean velocity between them, once as it is (if the
    velocities are of the world) and once turned by R(q) (if they are of the body). Longer steps than usual are gaps, in
    which velocities say nothing of the way. Only the plane is compared: many an odometry has no height.

    Parameters
    ----------
    t_s : (n,) [s]
        Of all.
    positions, quaternions, velocities : (n, 3) [m], (n, 4), (n, 3) [m/s]
        Pose and velocity of an odometry.

    Returns
    -------
    FrameErrors | None
        Mean squares [m^2/s^2] by assumption; None without comparable samples.
    """
    known = np.isfinite(velocities[:, :2]).all(axis=1) & np.isfinite(quaternions).all(axis=1)
    t, p, q, v = t_s[known], positions[known, :2], quaternions[known], np.nan_to_num(velocities[known])
    if len(t) < FEWEST_POSES or np.ptp(p) == 0.0:
        return None
    starts, usual = _windows(t)
    moved = np.diff(p[starts], axis=0) / np.diff(t[starts])[:, None]
    in_world, in_body = (moved - _means(t, one[:, :2], starts) for one in (v, to_world(v, q)))
    return FrameErrors.of(in_world[usual], in_body[usual], moved[usual])


def compare_rates(t_s: Array, quaternions: Array, rates: Array) -> FrameErrors | None:
    """Compare rates with those of the attitudes in both frames that they may be of.

    Between two samples the attitude turns by R_k' R_{k+1} about axes of the body, and by R_{k+1} R_k' about axes of the
    world. A simulator that asks its engine for the rate of a link is given the latter (Gazebo, WorldAngularVel).

    Parameters
    ----------
    t_s : (n,) [s]
        Of both.
    quaternions, rates : (n, 4), (n, 3) [rad/s]
        Attitude and rates of an odometry.

    Returns
    -------
    FrameErrors | None
        Mean squares [rad^2/s^2] by assumption; None without comparable samples.
    """
    known = np.isfinite(rates).all(axis=1) & np.isfinite(quaternions).all(axis=1)
    t, rates = t_s[known], rates[known]
    if len(t) < FEWEST_POSES:
        return None
    turned = Rotation.from_quat(quaternions[known])
    starts, usual = _windows(t)
    measured, steps = _means(t, rates, starts), np.diff(t[starts])[:, None]
    in_world, in_body = (
        np.add.reduceat(one.as_rotvec()[: starts[-1]], starts[:-1], axis=0) / steps
        for one in (turned[1:] * turned[:-1].inv(), turned[:-1].inv() * turned[1:])
    )
    return FrameErrors.of((in_world - measured)[usual], (in_body - measured)[usual], in_body[usual])


def _windows(t: Array) -> tuple[Index, Flags]:
    """Samples at least COMPARED_S apart, and which of the times between them are no gap."""
    starts = [0]
    for i, at in enumerate(t.tolist()):
        if at - t[starts[-1]] >= COMPARED_S:
            starts.append(i)
    steps = np.diff(t[starts])
    return np.array(starts), steps < 4.0 * float(np.median(steps))


def _means(t: Array, values: Array, starts: Index) -> Array:
    """Means between neighbors of `starts`, (m, k): differences of the trapezoidal integral over their times."""
    steps = np.diff(t)[:, None]
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
    return array(np.diff(sums[starts], axis=0) / np.diff(t[starts])[:, None])


def ways_from_poses(positions: Array, quaternions: Array) -> Array:
    """Distances covered along the body axes.

        s_k = s_{k-1} + R_k' (p_k - p_{k-1}),  R_k the attitude halfway between the two

    At one heading this is the position along it, and its noise that of the positions: nothing is divided by the time
    between them, as in `velocities_from_poses`, and one position that is off moves no other.

    Parameters
    ----------
    positions, quaternions : (n, 3) [m], (n, 4)
        Of the body, x, y, z, w.

    Returns
    -------
    Array
        (n, 3) [m], from zero.
    """
    # The sum of two quaternions of one sign is halfway between them, but for its length.
    halfway = (
        quaternions[1:]
        + np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)[:, None] * quaternions[:-1]
    )
    steps = Rotation.from_quat(halfway).inv().apply(np.diff(positions, axis=0))
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def are_exact(ways: Array) -> bool:
    """Whether ways have no noise, as those of a simulator: differences then lose nothing.

    Fitted as they are, the steps of the integration would be all that the fit leaves, and every influence of the budget
    would be found in them. Noise shows in fourth differences, in which a motion hardly does; their variance is 70 times
    that of the positions. The largest twentieth is where the thrust steps.

    Parameters
    ----------
    ways : (n, 3) [m]
        Evenly sampled.

    Returns
    -------
    bool
        True for those of a simulator.
    """
    fourth = np.sort(np.abs(np.diff(ways, n=4, axis=0)), axis=0)
    kept = fourth[: round(0.95 * len(fourth))]
    return bool(len(kept)) and bool(np.all(np.sqrt(np.mean(kept**2, axis=0) / 70.0) < EXACT_m))


def velocities_from_poses(t_s: Array, positions: Array, quaternions: Array) -> tuple[Array, Array]:
    """Velocities in body axes from positions and attitudes, averaged in bins of BIN_S or of a sample if that is longer.

        v = R(q_m)' (p_2 - p_1) / (t_2 - t_1),   omega = 2 e / (t_2 - t_1),   with (e, w) = q_1^-1 q_2

    q_m is the attitude halfway, the mean of both. Twice the vector part of a small turn is its angle; the error is its
    third power over 24. The mean of p and q of a bin belongs to the mean of its times.

    Parameters
    ----------
    t_s : (n,) [s]
        Of both.
    positions, quaternions : (n, 3) [m], (n, 4)
        Of the body, x, y, z, w.

    Returns
    -------
    tuple[Array, Array]
        Times (m,) [s] and velocities (m, 6) [m/s, rad/s].
    """
    number = np.floor((t_s - t_s[0]) / max(BIN_S, float(np.median(np.diff(t_s))))).astype(int)
    _, place = np.unique(number, return_inverse=True)
    counts = np.bincount(place)[:, None]
    # Either sign is the same attitude: each has that of the one before, or their mean would be another attitude.
    turned = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    signed = quaternions * np.cumprod([1.0, *turned])[:, None]
    t, p, q = (
        np.column_stack([np.bincount(place, column) for column in one.T]) / counts
        for one in (t_s[:, None], positions, signed)
    )
    steps = np.diff(t, axis=0)
    small = Rotation.from_quat(q[:-1]).inv() * Rotation.from_quat(q[1:])
    rates = 2.0 * small.as_quat(canonical=True)[:, :3] / steps
    middle = Rotation.from_quat(q[1:] + q[:-1])
    velocities = np.column_stack([middle.inv().apply(np.diff(p, axis=0) / steps), rates])
    return 0.5 * (t[1:, 0] + t[:-1, 0]), velocities
