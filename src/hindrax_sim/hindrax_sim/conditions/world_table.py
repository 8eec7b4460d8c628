"""The table of conditions, and the worlds made of them: `ideal` has none, `pool` draws the size of all by its seed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from hindrax_core.errors import UsageError
from hindrax_core.text.nearest import found_in
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions import hull, sensing, thrust, water
from hindrax_sim.conditions.realization import Realization
from hindrax_sim.physics.normal_draws import NormalDraws

IDEAL, POOL = "ideal", "pool"
FORM = "ideal, pool, or NAME[=SIZE],... such as tether=1,dvl_yaw=2; after pool, they replace drawn sizes"
SIGNED, ONE_SIDED = "normal", "uniform"
SUPPLY_RESISTANCE, BATTERY_SAG = "supply_resistance", "battery_sag"
METER = 0.003
"""Standard deviation of the gain of a handheld meter: 0.5 % and two digits are its limits (Fluke 115, users manual)."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A row: name, unit, usual size, law, how pool draws it, where the size comes from.

    `add` puts it into a world; its docstring states its effect and, behind "Size:", the source of its size. Pool draws
    from a normal distribution of deviation `pool`, or evenly from 0 to `pool`. A size lies from `least` to `most`.
    """

    name: str
    unit: str
    size: float
    add: Callable[[Realization, float, NormalDraws], None]
    distribution: str
    pool: float
    least: float = 0.0
    most: float = math.inf

    @property
    def meaning(self) -> str:
        """Effect."""
        return self._description[0]

    @property
    def source(self) -> str:
        """Source of the size."""
        return self._description[2].strip()

    @property
    def _description(self) -> tuple[str, str, str]:
        return " ".join((self.add.__doc__ or "").split()).partition(" Size: ")

    @property
    def draw(self) -> str:
        """How pool draws it, for tables."""
        limits = f"deviation {self.pool:g}" if self.distribution == SIGNED else f"0 to {self.pool:g}"
        return f"{self.distribution}, {limits}"

    def drawn(self, seed: int) -> float:
        """Size in the pool of this seed."""
        draws = NormalDraws(f"pool {self.name}", seed)
        size = self.pool * (draws.normal() if self.distribution == SIGNED else draws.uniform())
        return min(self.most, max(self.least, size))


_ROWS = (
    Condition("thrust_gain", "-", 0.05, thrust.thrust_gain, SIGNED, 0.02, least=-0.9, most=1.0),
    Condition("weak_thruster", "-", 0.1, thrust.weak_thruster, ONE_SIDED, 0.05, most=1.0),
    Condition("dead_bands", "us", 5.0, thrust.dead_bands, ONE_SIDED, 5.0, most=100.0),
    Condition("inflow_loss", "-", 0.1, thrust.inflow_loss, ONE_SIDED, 0.3, most=0.5),
    Condition("late_stops", "s", 0.1, thrust.late_stops, ONE_SIDED, 0.0, most=1.0),
    Condition("thruster_wash", "-", 0.05, thrust.thruster_wash, ONE_SIDED, 0.05, most=0.5),
    Condition("hull_wash", "-", 0.05, thrust.hull_wash, ONE_SIDED, 0.05, most=1.0),
    Condition(BATTERY_SAG, "-", 0.1, thrust.battery_sag, ONE_SIDED, 0.1, most=0.5),
    Condition(SUPPLY_RESISTANCE, "ohm", 0.05, thrust.supply_resistance, ONE_SIDED, 0.05, most=1.0),
    Condition("tether", "N", 1.0, water.tether, ONE_SIDED, 1.0, most=100.0),
    Condition("tether_drag", "N", 2.0, water.tether_drag, ONE_SIDED, 2.0, most=100.0),
    Condition("fluid_memory", "-", 0.2, water.fluid_memory, ONE_SIDED, 0.2, most=1.0),
    Condition("wake", "-", 0.2, water.wake, ONE_SIDED, 0.2, most=1.0),
    Condition("current", "m/s", 0.02, water.current, ONE_SIDED, 0.01, most=2.0),
    Condition("seiche", "m/s", 0.01, water.seiche, ONE_SIDED, 0.01, most=1.0),
    Condition("drag_exponent", "-", -0.3, hull.drag_exponent, ONE_SIDED, -0.3, least=-1.0, most=1.0),
    Condition("fore_aft", "-", 0.09, hull.fore_aft, SIGNED, 0.05, least=-0.9, most=0.9),
    Condition("added_mass_cross", "-", 0.1, hull.added_mass_cross, ONE_SIDED, 0.1, most=0.5),
    Condition("center_of_mass", "m", 0.005, hull.center_of_mass, ONE_SIDED, 0.005, most=0.2),
    Condition("dvl_latency", "s", 0.15, sensing.dvl_latency, ONE_SIDED, 0.05, most=2.0),
    Condition("dvl_scale", "-", 0.01, sensing.dvl_scale, SIGNED, 0.003, least=-0.5, most=0.5),
    Condition("dvl_bias", "m/s", 0.003, sensing.dvl_bias, ONE_SIDED, 0.002, most=1.0),
    Condition("dvl_yaw", "deg", 2.0, sensing.dvl_yaw, SIGNED, 1.0, least=-180.0, most=180.0),
    Condition("imu_misalignment", "deg", 2.0, sensing.imu_misalignment, ONE_SIDED, 1.0, most=30.0),
    Condition("false_locks", "1/s", 0.2, sensing.false_locks, ONE_SIDED, 0.2, most=20.0),
    *(
        Condition(name, "N", usual, hang, ONE_SIDED, 0.0, least=-100.0, most=100.0)
        for name, (usual, hang) in hull.LOADS.items()
    ),
)

CONDITIONS: Mapping[str, Condition] = {row.name: row for row in _ROWS}


def sizes_of(world: str, seed: int) -> dict[str, float]:
    """Read a world: `ideal`, `pool`, or conditions by name, as `--world` has them.

    Parameters
    ----------
    world
        Text of this form: `FORM`; UsageError names what is wrong with it.
    seed
        From which pool draws its sizes.

    Returns
    -------
    dict[str, float]
        Size of each condition in the unit of its row; those of size 0 are left out.
    """
    first, *rest = world.split(",")
    sizes: dict[str, float] = {}
    if first == POOL:
        sizes = {row.name: row.drawn(seed) for row in _ROWS}
    elif first != IDEAL:
        rest = [first, *rest]
    sizes |= dict(_named(text, world) for text in rest)
    return {name: size for name, size in sizes.items() if size != 0.0}


def rest_volts(vehicle: Vehicle, world: str, seed: int, flown_s: float) -> tuple[float, float]:
    """What a person reads on a meter at the supply of a mock, at rest: before a flight and after it.

    Parameters
    ----------
    vehicle
        Whose nominal voltage a full battery has.
    world, seed
        As of the flight.
    flown_s : [s]
        How long it was.

    Returns
    -------
    tuple[float, float]
        [V], both off by the gain of the meter.
    """
    gain = 1.0 + METER * NormalDraws("meter", seed).normal()
    size = sizes_of(world, seed).get(BATTERY_SAG, 0.0)
    before, after = (round(gain * thrust.sagged_V(vehicle, size, at_s), 2) for at_s in (0.0, flown_s))
    return before, after


def _named(text: str, world: str) -> tuple[str, float]:
    name, equals, written = text.partition("=")
    row = CONDITIONS.get(name)
    if name in (IDEAL, POOL):
        raise UsageError(f"--world {world}: found {name!r} behind another name, wanted it first; the form is {FORM}")
    if row is None:
        raise UsageError(f"--world {world}: {found_in(name, CONDITIONS, (IDEAL, POOL))}; the form is {FORM}")
    try:
        size = float(written) if equals else row.size
    except ValueError:
        size = math.nan
    if not row.least <= size <= row.most:
        raise UsageError(f"--world {world}: {name}={written}, wanted {row.least:g} to {row.most:g} {row.unit}")
    return name, size


def realize(vehicle: Vehicle, sizes: Mapping[str, float], seed: int) -> Realization:
    """Make the world in which a vehicle has these conditions.

    Parameters
    ----------
    vehicle
        As its file has it; the resistance of a supply that it declares is true in its mock.
    sizes
        Of conditions by name, in the units of their rows.
    seed
        Fixes what else is random in them, as a direction.

    Returns
    -------
    Realization
        True vehicle, and what acts on it and on its sensors.
    """
    made = Realization(vehicle)
    if vehicle.supply_ohm is not None:  # what a file declares is the truth of its mock, and not drawn
        sizes = {**sizes, SUPPLY_RESISTANCE: vehicle.supply_ohm}
    for row in _ROWS:
        if sizes.get(row.name):
            row.add(made, sizes[row.name], NormalDraws(f"condition {row.name}", seed))
    return made
