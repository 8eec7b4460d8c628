"""Conditions of the hull: what is true of it beside the vehicle file, each added by a function, of a size.

And known loads [N] that an operator hangs on it to weigh its thrust.

Parameters
----------
world
    In the making; it gets the condition.
size
    In the unit of its row of `world_table`; behind "Size:" stands where a usual size comes from.
draws
    Random numbers of this condition, for what else is random in it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

from hindrax_core.readings import Vec3, Vec6, vec6
from hindrax_core.rotation import minus
from hindrax_core.vehicle import AXES, Drag, Vehicle
from hindrax_sim.conditions.realization import TESTED, Realization
from hindrax_sim.physics.geometry import combined, lever_wrench, plus, rotate_back, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

Hang: TypeAlias = Callable[[Realization, float, NormalDraws], None]
DOWN, AHEAD, ASIDE, MIDDLE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
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
        """What k_q V^(2 - n) |v|^n has beyond k_q v^2 [N, N m]."""
        k_q, along = quadratic[axis][speed < 0.0], abs(speed)
        return math.copysign(k_q * (TESTED[axis] ** (2.0 - exponent) * along**exponent - along * along), speed)

    world.influences.append(lambda plant, dt: vec6(-beyond(*at) for at in enumerate(plant.mid_step(dt))))
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
    world.change_vehicle(hydrodynamics=replace(world.hydrodynamics, added_mass_cross=tuple(map(vec6, rows))))


def center_of_mass(world: Realization, size: float, draws: NormalDraws) -> None:
    """The center of mass is offset from that of the vehicle file, in a direction drawn at random.

    Size: A quarter of the distance to the center of buoyancy.
    """
    world.change_vehicle(center_of_mass_m=plus(world.vehicle.center_of_mass_m, unit(draws.three(1.0)), size))


class KnownLoad:
    """Forces of steady direction (ahead, aside and down in the pool) at hooks of the hull; `share`: of them that hangs.

    A share of -1 is the same load the other way: a float, a line from the other wall, or the hook opposite. A float is
    tied to the top: below the hull it would turn the vehicle over.

    Parameters
    ----------
    vehicle
        That it hangs on.
    hung : [N], [m]
        Each force, and where it acts in body axes.
    """

    def __init__(self, vehicle: Vehicle, hung: Sequence[tuple[Vec3, Vec3]]) -> None:
        self.share = 1.0
        center_m = vehicle.center_of_mass_m
        self._hung = [(force, minus(hook_m, center_m)) for force, hook_m in hung]
        self._hung_as_float = [(force, minus((x, y, -z), center_m)) for force, (x, y, z) in hung]

    def __call__(self, plant: Plant, _dt: float) -> Vec6:
        """Force and moment in body axes."""
        hung = self._hung if self.share > 0.0 else self._hung_as_float
        return combined(
            [(self.share, lever_wrench(rotate_back(plant.quaternion, force), lever_m)) for force, lever_m in hung]
        )

    @property
    def level(self) -> Vec6:
        """Wrench of the whole load on a level vehicle [N, N m]."""
        return combined([(1.0, lever_wrench(*one)) for one in self._hung])


def _hung(direction: Vec3, hook: Vec3, about: str) -> Hang:
    """A force at a hook, which is given in halves of the envelope."""

    def hang(world: Realization, size: float, _draws: NormalDraws) -> None:
        x, y, z = (0.5 * length * part for length, part in zip(world.vehicle.envelope_m, hook, strict=True))
        world.influences.append(KnownLoad(world.vehicle, [(plus(MIDDLE, direction, size), (x, y, z))]))

    hang.__doc__ = about
    return hang


def _turned(world: Realization, size: float, _draws: NormalDraws) -> None:
    half_m = 0.5 * APART_m
    ahead = (0.0, size, 0.0), (half_m, 0.0, 0.0)
    behind = (0.0, -size, 0.0), (-half_m, 0.0, 0.0)
    world.influences.append(KnownLoad(world.vehicle, [ahead, behind]))


WEIGHT, LINE = "A weight of this force in water hangs", "A line over a pulley pulls with this force"
TWO_kg = "Size: A dive weight of 2 kg less the water that it displaces."
ONE_kg = "Size: A dive weight of 1 kg less the water that it displaces."
BOTTLE = "Size: A bottle of 1.5 l that hangs in the air."
APART_m = 0.15
"""Between two lines that turn the hull: with a bottle each 2.25 N m, which its heading hold carries."""
_turned.__doc__ = (
    f"Two lines over pulleys turn the hull, {APART_m:g} m apart: each pulls with this force, the one ahead to "
    f"starboard, the other to port. {BOTTLE}"
)

LOADS: Mapping[str, tuple[float, Hang]] = {
    "weight": (
        18.0,
        _hung(DOWN, DOWN, f"{WEIGHT} under the hull; negative: a float on its top. {TWO_kg}"),
    ),
    "weight_starboard": (9.0, _hung(DOWN, ASIDE, f"{WEIGHT} from the middle of the starboard side. {ONE_kg}")),
    "weight_bow": (9.0, _hung(DOWN, AHEAD, f"{WEIGHT} from the middle of the bow. {ONE_kg}")),
    "line": (15.0, _hung(AHEAD, MIDDLE, f"{LINE} along the pool, in the middle of the hull. {BOTTLE}")),
    "line_aside": (15.0, _hung(ASIDE, MIDDLE, f"{LINE} across the pool, in the middle of the hull. {BOTTLE}")),
    "line_bow": (15.0, _hung(ASIDE, AHEAD, f"{LINE} across the pool, at the middle of the bow. {BOTTLE}")),
    "lines_apart": (15.0, _turned),
}
"""Usual size [N] by name, and what hangs it on a vehicle."""
