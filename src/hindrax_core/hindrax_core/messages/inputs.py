"""What the navigator reads of sensors whose drivers are of another stack: messages of ROS, for depth and velocity.

An inertial sensor, a compass, a pressure and a range have one message each, which ours are as well. A velocity and a
depth have several; a row says what each of them holds. Sources: marine_acoustic_msgs/Dvl (github
apl-ocean-engineering/marine_msgs), REP-103 and REP-105.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from hindrax_core.hydrostatics import GRAVITY_mps2, Water
from hindrax_core.knobs import choice, knob
from hindrax_core.messages.contents import Contents, Read, parts
from hindrax_core.messages.velocity_of_poses import Pose, VelocityOfPoses
from hindrax_core.readings import BottomVelocity, Pressure, Reading
from hindrax_core.sensor_table import Capability

BOTTOM = 1
"""DVL_MODE_BOTTOM: velocity over ground."""
LEAST_BEAMS = 3
"""A velocity has three components."""
LARGEST_VARIANCE = 1e3
"""From here on a variance says that nothing is known: 1e6 and 1e9 are usual."""


class Input(NamedTuple):
    """Type of a message; what it holds, in this water, by these parameters; and what several of them make."""

    type: str
    contents: Callable[[Water, "InputKnobs"], Contents[Reading]]
    together: Callable[[Read[Reading]], Read[Reading]] = lambda read: read


def _sigma(variance: float, otherwise: float) -> float:
    """Deviation; messages have zero or -1 where it is not known."""
    return math.sqrt(variance) if 0.0 < variance < math.inf else otherwise


def _dvl(_water: Water, knobs: "InputKnobs") -> Contents[Reading]:
    """Axes of the instrument: x forward, y starboard, z along the beam axis."""

    def made(mode: int, u: float, v: float, w: float, *others: float) -> BottomVelocity:
        if mode != BOTTOM:
            raise ValueError(f"found velocity_mode {mode}, wanted {BOTTOM}, over ground")
        *covariance, beams, valid = others
        locked = all(map(math.isfinite, (u, v, w))) and (bool(valid) or beams >= LEAST_BEAMS)
        return _bottom((u, v, w) if locked else None, covariance[0], knobs.velocity_sigma_mps)

    paths = ("velocity_mode", *parts("velocity"), "velocity_covar", "num_good_beams", "beam_velocities_valid")
    return Contents(paths, made)


def _twist(_water: Water, knobs: "InputKnobs") -> Contents[Reading]:
    """REP-103: x forward, y left, z up. What is not finite is no velocity."""

    def made(x: float, y: float, z: float, variance: float, *_: float) -> BottomVelocity:
        known = all(map(math.isfinite, (x, y, z)))
        return _bottom((x, -y, -z) if known else None, variance, knobs.velocity_sigma_mps)

    return Contents((*parts("twist.twist.linear"), "twist.covariance"), made)


def _bottom(velocity_mps: tuple[float, float, float] | None, variance: float, sigma_mps: float) -> BottomVelocity:
    """Velocity, if it is one: without bottom lock some drivers send on, of a variance that is no knowledge or zeros."""
    if variance >= LARGEST_VARIANCE or (velocity_mps is not None and not any(velocity_mps) and not variance > 0.0):
        velocity_mps = None
    return BottomVelocity(velocity_mps, _sigma(variance, sigma_mps), 1.0, 0.0, 0)


def _height(path: str, water: Water, knobs: "InputKnobs") -> Contents[Reading]:
    """Height in a world with z up (REP-105), as the pressure at that depth."""
    return Contents((path,), partial(_at_height, water, knobs))


def _height_of_pose(path: str, water: Water, knobs: "InputKnobs") -> Contents[Reading]:
    """The same of a pose; one that repeats to the last digit is of a tracker that no longer sees the vehicle."""
    last: tuple[float, ...] = ()

    def made(*pose: float) -> Pressure:
        nonlocal last
        if pose == last:
            raise ValueError("found the same pose twice, to the last digit, wanted it as it is seen")
        last = pose
        return _at_height(water, knobs, pose[2])

    return Contents((*parts(f"{path}.position"), *parts(f"{path}.orientation", "xyzw")), made)


def _at_height(water: Water, knobs: "InputKnobs", z_m: float) -> Pressure:
    depth_m = knobs.surface_m - z_m
    return Pressure(water.surface_pressure_Pa + depth_m * water.density_kgpm3 * GRAVITY_mps2, math.nan)


def _pose(path: str, variance: tuple[str, ...], _water: Water, knobs: "InputKnobs") -> Contents[Reading]:
    """Position and attitude of REP-105; a variance of its position, where there is one."""

    def made(x: float, y: float, z: float, *others: float) -> Pose:
        qx, qy, qz, qw, *covariance = others
        sigma_m = _sigma(covariance[0] if covariance else 0.0, knobs.pose_sigma_m)
        return Pose((x, y, z), (qx, qy, qz, qw), sigma_m)

    return Contents((*parts(f"{path}.position"), *parts(f"{path}.orientation", "xyzw"), *variance), made)


INPUTS: Mapping[Capability, Mapping[str, Input]] = {
    "velocity": {
        "dvl": Input("marine_acoustic_msgs/msg/Dvl", _dvl),
        "velocity": Input("geometry_msgs/msg/TwistWithCovarianceStamped", _twist),
        "odometry": Input("nav_msgs/msg/Odometry", _twist),
        "pose": Input(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            partial(_pose, "pose.pose", ("pose.covariance",)),
            VelocityOfPoses,
        ),
        "pose_stamped": Input("geometry_msgs/msg/PoseStamped", partial(_pose, "pose", ()), VelocityOfPoses),
    },
    "depth": {
        "pose": Input("geometry_msgs/msg/PoseWithCovarianceStamped", partial(_height_of_pose, "pose.pose")),
        "pose_stamped": Input("geometry_msgs/msg/PoseStamped", partial(_height_of_pose, "pose")),
        "odometry": Input("nav_msgs/msg/Odometry", partial(_height, "pose.pose.position.z")),
    },
}
"""By what is measured and by the last word of the topic `NAME/...`: messages other than those of our own drivers."""


@dataclass(frozen=True, slots=True)
class InputKnobs:
    """Which messages bring velocity and depth; those of our own drivers by default."""

    velocity: str = choice("detail", ("detail", *INPUTS["velocity"]), "topic NAME/... with the velocity")
    depth: str = choice("pressure", ("pressure", *INPUTS["depth"]), "topic NAME/... with the depth")
    velocity_sigma_mps: float = knob(0.01, 1e-4, 1.0, "deviation of a velocity whose covariance is not known [m/s]")
    pose_sigma_m: float = knob(0.002, 1e-5, 1.0, "deviation of a position whose covariance is not known [m]")
    surface_m: float = knob(0.0, -1e4, 1e4, "height of the surface in the world of a pose or odometry [m]")

    def of(self, capability: Capability) -> tuple[str, Input] | None:
        """Word and row of the chosen message; None where it is our own."""
        word = {"velocity": self.velocity, "depth": self.depth}.get(capability, "")
        row = INPUTS.get(capability, {}).get(word)
        return None if row is None else (word, row)


@dataclass(frozen=True, slots=True)
class Inputs:
    """The parameters as a node has them: `input.velocity` and so on."""

    input: InputKnobs = field(default_factory=InputKnobs)
