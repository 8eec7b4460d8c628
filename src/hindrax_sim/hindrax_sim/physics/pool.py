"""The mock pool: walls, floor and surface, and contacts of the vehicle with them.

The pool frame lies in the middle of the surface: x along the length, y along the width, z down.
"""

import math

from hindrax_core.readings import Vec3
from hindrax_core.rotation import minus
from hindrax_core.vehicle import Pool, Vehicle
from hindrax_sim.physics.geometry import rotate, rotate_back
from hindrax_sim.physics.plant import Plant


class PoolWalls:
    """Stops a vehicle at walls and floor, without bounce or friction, and counts the contacts."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._pool: Pool = vehicle.pool
        self._offset_m = vehicle.center_of_mass_m
        self._half_m = tuple(0.5 * side for side in vehicle.envelope_m)
        reach = math.hypot(*self._half_m) + math.hypot(*self._offset_m)
        half_length, half_width = 0.5 * self._pool.length_m, 0.5 * self._pool.width_m
        self._near = (half_length - reach, half_width - reach, self._pool.depth_m - reach)
        self._limits = (half_length, half_width, self._pool.depth_m)
        self._touching = (False, False, False)
        self.wall_hits = 0
        self.floor_hits = 0

    def confine(self, plant: Plant) -> None:
        """Keep the vehicle inside; to be called after every step."""
        near_x, near_y, near_z = self._near
        if -near_x < plant.x < near_x and -near_y < plant.y < near_y and plant.z < near_z:
            return
        (x, y, _), (along, across, below) = self._center(plant), self.clearance_m(plant)
        outside = (math.copysign(max(0.0, -along), x), math.copysign(max(0.0, -across), y), max(0.0, -below))
        was_x, was_y, was_z = self._touching
        self._touching = at_x, at_y, at_z = (outside[0] != 0.0, outside[1] != 0.0, outside[2] != 0.0)
        self.wall_hits += (at_x and not was_x) + (at_y and not was_y)
        self.floor_hits += at_z and not was_z
        if any(outside):
            _push_back(plant, outside)

    def clearance_m(self, plant: Plant) -> Vec3:
        """Distance of the hull from the walls along x and along y, and from the floor; negative beyond them."""
        (x, y, z), (ex, ey, ez) = self._center(plant), self._extent(plant)
        length, width, depth = self._limits
        return (length - abs(x) - ex, width - abs(y) - ey, depth - z - ez)

    def _center(self, plant: Plant) -> Vec3:
        return minus((plant.x, plant.y, plant.z), rotate(plant.quaternion, self._offset_m))

    def _extent(self, plant: Plant) -> Vec3:
        corners = [rotate(plant.quaternion, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        x, y, z = (sum(half * abs(c[k]) for half, c in zip(self._half_m, corners, strict=True)) for k in range(3))
        return (x, y, z)


def _push_back(plant: Plant, outside: Vec3) -> None:
    """Remove the displacement into the wall, and the velocity towards it."""
    plant.x, plant.y, plant.z = minus((plant.x, plant.y, plant.z), outside)
    over_ground = rotate(plant.quaternion, plant.velocity_over_ground)
    into = [speed if speed * beyond > 0.0 else 0.0 for speed, beyond in zip(over_ground, outside, strict=True)]
    lost = rotate_back(plant.quaternion, (into[0], into[1], into[2]))
    plant.u, plant.v, plant.w = minus((plant.u, plant.v, plant.w), lost)
