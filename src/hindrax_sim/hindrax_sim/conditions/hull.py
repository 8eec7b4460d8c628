"""Conditions of the hull: what is true of it beside the vehicle file. Each function adds one of them, of a size."""

from __future__ import annotations

import math
from dataclasses import replace

from hindrax_core.vehicle import AXES, Drag
from hindrax_sim.conditions.realization import TESTED, Realization
from hindrax_sim.physics.geometry import six, unit
from hindrax_sim.physics.normal_draws import NormalDraws

CROSSED = ((0, 4), (1, 3), (1, 5), (2, 4))
"""Pairs of axes that a plane of symmetry leaves coupled: surge-pitch, heave-pitch, sway-roll, sway-yaw."""


def drag_exponent(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The quadratic part of the drag goes with another power of speed, 2 + size, and is equal at the tested speed.

    Size: Between v^1.7 and v^2, as drag coefficients fall with the Reynolds number.
    """
    drags = [world.hydrodynamics.drag(axis) for axis in AXES]
    quadratic = [(drag.k_q, drag.of(backward=True)[0]) for drag in drags]
    exponent = 2.0 + size

    def beyond(axis: int, speed: float) -> float:
        """What k_q V^(2 - n) |v|^n has beyond k_q v^2 [N, Nm]."""
        k_q, along = quadratic[axis][speed < 0.0], abs(speed)
        return math.copysign(k_q * (TESTED[axis] ** (2.0 - exponent) * along**exponent - along * along), speed)

    world.influences.append(lambda plant, dt: six(-beyond(*at) for at in enumerate(plant.mid_step(dt))))
    world.drag_changes.append(beyond)


def fore_aft(world: Realization, size: float, _draws: NormalDraws) -> None:
    """Drag of surge is a share higher ahead than its mean, and as much lower astern.

    Size: Heave of COB-2023-1394 has 25 % each way, surge less; our estimate.
    """
    drag = world.hydrodynamics.surge
    ahead, astern = 1.0 + size, 1.0 - size
    surge = Drag(ahead * drag.k_q, ahead * drag.k_l, astern * drag.k_q, astern * drag.k_l)
    world.change_vehicle(hydrodynamics=replace(world.hydrodynamics, surge=surge))


def added_mass_cross(world: Realization, size: float, draws: NormalDraws) -> None:
    """Axes that no plane of symmetry separates share added mass: this part of the geometric mean of theirs.

    Size: Xu, Ma, Han 2017 measured such terms; the size is our estimate.
    """
    mass = world.hydrodynamics.added_mass
    rows = [[0.0] * 6 for _ in AXES]
    for a, b in CROSSED:
        rows[a][b] = rows[b][a] = math.copysign(size * math.sqrt(mass[a] * mass[b]), draws.normal())
    world.change_vehicle(hydrodynamics=replace(world.hydrodynamics, added_mass_cross=tuple(map(six, rows))))


def center_of_mass(world: Realization, size: float, draws: NormalDraws) -> None:
    """The center of mass lies beside that of the vehicle file, in a direction drawn at random.

    Size: A quarter of the distance to the center of buoyancy.
    """
    x, y, z = unit(draws.three(1.0))
    cx, cy, cz = world.vehicle.center_of_mass_m
    world.change_vehicle(center_of_mass_m=(cx + size * x, cy + size * y, cz + size * z))
