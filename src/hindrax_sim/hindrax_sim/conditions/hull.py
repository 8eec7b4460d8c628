"""Conditions of the hull: what is true of it beside the vehicle file. Each function adds one of them, of a size."""

from __future__ import annotations

import math
from dataclasses import replace

from hindrax_core.readings import Vec6
from hindrax_core.vehicle import AXES, Drag
from hindrax_sim.conditions.realization import TESTED, Realization, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

CROSSED = ((0, 4), (1, 3), (1, 5), (2, 4))
"""Pairs of axes that a plane of symmetry leaves coupled: surge-pitch, heave-pitch, sway-roll, sway-yaw."""


def drag_exponent(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The quadratic part of the drag goes with another power of speed, 2 + size, and is equal at the tested speed.

    Size: Between v^1.7 and v^2, as drag coefficients fall with the Reynolds number.
    """
    changed = PowerDrag([world.hydrodynamics.drag(axis) for axis in AXES], 2.0 + size)
    world.influences.append(changed)
    world.drag_changes.append(changed.resistance)


class PowerDrag:
    """k_q V^(2 - n) |v|^n in the place of k_q v^2."""

    def __init__(self, drags: list[Drag], exponent: float) -> None:
        self._quadratic = [(one.k_q, one.of(backward=True)[0]) for one in drags]
        self._exponent = exponent

    def resistance(self, axis: int, speed: float) -> float:
        """What this law has beyond the quadratic one [N, Nm]."""
        k_q = self._quadratic[axis][speed < 0.0]
        top, size = TESTED[axis], abs(speed)
        return math.copysign(k_q * (top ** (2.0 - self._exponent) * size**self._exponent - size * size), speed)

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """The difference of the two laws."""
        X, Y, Z, K, M, N = (-self.resistance(axis, speed) for axis, speed in enumerate(plant.mid_step(dt)))
        return (X, Y, Z, K, M, N)


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
    cross: tuple[Vec6, ...] = tuple((a, b, c, d, e, f) for a, b, c, d, e, f in rows)
    world.change_vehicle(hydrodynamics=replace(world.hydrodynamics, added_mass_cross=cross))


def center_of_mass(world: Realization, size: float, draws: NormalDraws) -> None:
    """The center of mass lies beside that of the vehicle file, in a direction drawn at random.

    Size: A quarter of the distance to the center of buoyancy.
    """
    x, y, z = unit(draws.three(1.0))
    cx, cy, cz = world.vehicle.center_of_mass_m
    world.change_vehicle(center_of_mass_m=(cx + size * x, cy + size * y, cz + size * z))
