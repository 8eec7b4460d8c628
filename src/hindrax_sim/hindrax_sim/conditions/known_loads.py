"""Known loads that an operator hangs on the vehicle to weigh its thrust, each of a size [N]."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.realization import Realization
from hindrax_sim.physics.geometry import lever_wrench, rotate_back
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

Hang: TypeAlias = Callable[[Realization, float, NormalDraws], None]
DOWN, AHEAD, ASIDE, MIDDLE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)


class KnownLoad:
    """A force of steady direction (ahead, aside and down in the pool) at a hook of the hull; `share`: of it that hangs.

    A share of -1 is the same load the other way: a float, a line from the other wall, or the hook opposite.
    """

    def __init__(self, vehicle: Vehicle, force: Vec3, hook: Vec3) -> None:
        self.share = 1.0
        self._force = force
        self._lever_m: Vec3 = tuple(  # type: ignore[assignment]  # three of three
            0.5 * size * part - center
            for size, part, center in zip(vehicle.envelope_m, hook, vehicle.center_of_mass_m, strict=True)
        )

    def __call__(self, plant: Plant, _dt: float) -> Vec6:
        """Force and moment in body axes."""
        a, b, c = self._force
        force = (self.share * a, self.share * b, self.share * c)
        return lever_wrench(rotate_back(plant.quaternion, force), self._lever_m)

    @property
    def level(self) -> Vec6:
        """Wrench of the whole load on a level vehicle [N, Nm]."""
        return lever_wrench(self._force, self._lever_m)


def _hung(direction: Vec3, hook: Vec3, about: str) -> Hang:
    def hang(world: Realization, size: float, _draws: NormalDraws) -> None:
        x, y, z = direction
        world.influences.append(KnownLoad(world.vehicle, (size * x, size * y, size * z), hook))

    hang.__doc__ = about
    return hang


WEIGHT, LINE = "A weight of this force in water hangs", "A line over a pulley pulls with this force"
TWO_kg = "Size: A dive weight of 2 kg less the water that it displaces."
ONE_kg = "Size: A dive weight of 1 kg less the water that it displaces."
BOTTLE = "Size: A bottle of 1.5 l that hangs in the air."

LOADS: Mapping[str, tuple[float, Hang]] = {
    "weight": (18.0, _hung(DOWN, DOWN, f"{WEIGHT} under the middle of the hull; negative: a float. {TWO_kg}")),
    "weight_starboard": (9.0, _hung(DOWN, ASIDE, f"{WEIGHT} from the middle of the starboard side. {ONE_kg}")),
    "weight_bow": (9.0, _hung(DOWN, AHEAD, f"{WEIGHT} from the middle of the bow. {ONE_kg}")),
    "line": (15.0, _hung(AHEAD, MIDDLE, f"{LINE} along the pool, in the middle of the hull. {BOTTLE}")),
    "line_aside": (15.0, _hung(ASIDE, MIDDLE, f"{LINE} across the pool, in the middle of the hull. {BOTTLE}")),
    "line_bow": (15.0, _hung(ASIDE, AHEAD, f"{LINE} across the pool, at the middle of the bow. {BOTTLE}")),
}
"""Usual size [N] by name, and what hangs it on a vehicle."""
