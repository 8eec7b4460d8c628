"""Known loads that an operator hangs on the vehicle to weigh its thrust. Each function adds one, of a size [N]."""

from __future__ import annotations

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.realization import Realization, lever_wrench
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.quaternion import rotate

DOWN, AHEAD, ASIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


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

    def wrench(self, plant: Plant, _dt: float) -> Vec6:
        """Force and moment in body axes."""
        w, x, y, z = plant.quaternion
        a, b, c = self._force
        return lever_wrench(rotate((w, -x, -y, -z), (self.share * a, self.share * b, self.share * c)), self._lever_m)

    @property
    def level(self) -> Vec6:
        """Wrench of the whole load on a level vehicle [N, Nm]."""
        return lever_wrench(self._force, self._lever_m)


def _hang(world: Realization, size: float, direction: Vec3, hook: Vec3) -> None:
    x, y, z = direction
    world.influences.append(KnownLoad(world.vehicle, (size * x, size * y, size * z), hook))


def weight(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A weight of this force in water hangs under the middle of the hull; negative: a float.

    Size: A dive weight of 2 kg less the water that it displaces.
    """
    _hang(world, size, DOWN, DOWN)


def weight_starboard(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A weight of this force in water hangs from the middle of the starboard side.

    Size: A dive weight of 1 kg less the water that it displaces.
    """
    _hang(world, size, DOWN, ASIDE)


def weight_bow(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A weight of this force in water hangs from the middle of the bow.

    Size: A dive weight of 1 kg less the water that it displaces.
    """
    _hang(world, size, DOWN, AHEAD)


def line(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A line over a pulley pulls with this force along the pool, in the middle of the hull.

    Size: A bottle of 1.5 l that hangs in the air.
    """
    _hang(world, size, AHEAD, (0.0, 0.0, 0.0))


def line_aside(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A line over a pulley pulls with this force across the pool, in the middle of the hull.

    Size: A bottle of 1.5 l that hangs in the air.
    """
    _hang(world, size, ASIDE, (0.0, 0.0, 0.0))


def line_bow(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A line over a pulley pulls with this force across the pool, at the middle of the bow.

    Size: A bottle of 1.5 l that hangs in the air.
    """
    _hang(world, size, ASIDE, AHEAD)
