"""Where a sensor sits, made ready for computing with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_core.readings import Vec3
from hindrax_core.rotation import Matrix3, matrix, rotate
from hindrax_core.vehicle import Mount


@dataclass(frozen=True, slots=True)
class SensorMount:
    """Rotation sensor to body (None: none), position from the body origin, the sensor's z axis in body axes."""

    turn: Matrix3 | None
    lever_m: Vec3
    axis: Vec3
    away: bool
    """Whether it sits elsewhere than at the origin."""

    def body(self, vector: Vec3) -> Vec3:
        """Turn a vector of the sensor into body axes."""
        return vector if self.turn is None else rotate(self.turn, vector)


def sensor_mount(mount: Mount) -> SensorMount:
    """Make a mount of the vehicle file ready."""
    roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
    turn = matrix((roll, pitch, yaw)) if any(mount.rotation_deg) else None
    axis = (0.0, 0.0, 1.0) if turn is None else rotate(turn, (0.0, 0.0, 1.0))
    return SensorMount(turn, mount.position_m, axis, any(mount.position_m))


NOWHERE = sensor_mount(Mount(""))
"""For a sensor that the vehicle file does not place: at the origin, not turned."""
