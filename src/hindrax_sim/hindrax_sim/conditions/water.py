"""Conditions of water and tether. Each function adds one of them, of a size, to a world in the making.

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
from collections.abc import Callable

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec6, vec6
from hindrax_core.rotation import minus
from hindrax_core.signals import ZERO6
from hindrax_core.vehicle import AXES
from hindrax_sim.conditions.realization import Realization
from hindrax_sim.physics.geometry import lever_wrench, plus, rotate_back
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

TETHER_m, TETHER_mps = 5.0, 0.5
MEMORY_S = 1.0
WAKE_S = 5.0


def tether(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A line from the top of the stern to the end of the pool pulls, with this force at 5 m and more the longer it is.

    Size: Pull of a neutral line of 8 mm; our estimate.
    """
    _tie(world, size, 0.0)


def tether_drag(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The line is dragged along: it brakes with this force at 0.5 m/s and 5 m, with speed squared and with its length.

    Size: 7.6 mm (Fathom ROV Tether), C_D 1.2, speed growing evenly along 5 m: 1.9 N.
    """
    _tie(world, 0.0, size)


def _tie(world: Realization, pull_N: float, drag_N: float) -> None:
    """Pull towards the anchor, `pull_N` at a distance of 5 m; drag against the motion, `drag_N` there at 0.5 m/s.

    Both grow with the horizontal distance, and act at the top of the stern.
    """
    length, _, height = world.vehicle.envelope_m
    lever_m = minus((-0.5 * length, 0.0, -0.5 * height), world.vehicle.center_of_mass_m)
    anchor_x = -0.5 * world.vehicle.pool.length_m
    pull, drag = pull_N / TETHER_m, drag_N / (TETHER_m * TETHER_mps**2)
    world.pulled |= pull_N != 0.0

    def tug(plant: Plant, dt: float) -> Vec6:
        away = (plant.x - anchor_x, plant.y, 0.0)
        a, b, c = rotate_back(plant.quaternion, away)
        u, v, w, _, _, _ = plant.mid_step(dt)
        brake = drag * math.hypot(*away) * math.sqrt(u * u + v * v + w * w)
        return lever_wrench((-pull * a - brake * u, -pull * b - brake * v, -pull * c - brake * w), lever_m)

    world.influences.append(tug)


def fluid_memory(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A share of the added mass follows with a delay of 1 s, beside the added mass that acts at once.

    Size: Flow follows in about a length over speed; our estimate.
    """
    # Cummins' convolution with one exponential: F = -share d/dt (the velocity through a first-order lag of 1 s).
    shares = [size * mass for mass in world.hydrodynamics.added_mass]
    _follow(world, MEMORY_S, lambda axis, velocity, followed: -shares[axis] * (velocity - followed) / MEMORY_S)


def wake(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A vehicle that reverses meets its own wake: a share of its speed, decaying in 5 s.

    Size: Wake fraction of bluff hulls, 0.1 to 0.3; our estimate.
    """
    drags = [world.hydrodynamics.drag(axis) for axis in AXES]

    def added(axis: int, velocity: float, followed: float) -> float:
        """Drag at the speed through the water that follows, met by a motion against it, less what the plant knows."""
        if velocity * followed >= 0.0:
            return 0.0
        return drags[axis].resistance(velocity) - drags[axis].resistance(velocity - size * followed)

    _follow(world, WAKE_S, added)


def _follow(world: Realization, lag_s: float, force: Callable[[int, float, float], float]) -> None:
    """Add a force [N, N m] by axis, velocity through the water, and that through a first-order lag."""
    followed = [0.0] * 6

    def push(plant: Plant, dt: float) -> Vec6:
        share, velocities = 1.0 - math.exp(-dt / lag_s), plant.mid_step(dt)
        forces = vec6(list(map(force, range(6), velocities, followed)))
        for axis, velocity in enumerate(velocities):
            followed[axis] += share * (velocity - followed[axis])
        return forces

    world.influences.append(push)


def current(world: Realization, size: float, draws: NormalDraws) -> None:
    """The water moves evenly, in a horizontal direction drawn at random.

    Size: Pool circulation; our estimate.
    """
    angle = math.tau * draws.uniform()
    _move_water(world, size * math.cos(angle), size * math.sin(angle))


def seiche(world: Realization, size: float, draws: NormalDraws) -> None:
    """The pool's longest standing wave moves the water back and forth along its length; its phase is drawn at random.

    Size: A wave of 4 mm: its height times sqrt(g / depth).
    """
    pool = world.vehicle.pool
    # Merian's formula: the longest wave of a closed basin is twice its length.
    frequency = math.tau / (2.0 * pool.length_m / math.sqrt(GRAVITY_mps2 * pool.depth_m))
    phase = math.tau * draws.uniform()
    _move_water(world, size, 0.0, frequency_radps=frequency, phase=phase, wave_number_radpm=math.pi / pool.length_m)


def _move_water(
    world: Realization,
    north_mps: float,
    east_mps: float,
    *,
    frequency_radps: float = 0.0,
    phase: float = 0.0,
    wave_number_radpm: float = 0.0,
) -> None:
    """Move the water with amplitude * cos(frequency t + phase) * cos(wave_number x), horizontally.

    Accelerated water takes the vehicle along: with the mass that it displaces and its added mass (Froude-Krylov).
    """
    displaced = world.vehicle.volume_m3 * world.vehicle.water.density_kgpm3
    masses = [displaced + mass for mass in world.hydrodynamics.added_mass[:3]]
    was = (0.0, 0.0, 0.0)

    def move(plant: Plant, dt: float) -> Vec6:
        nonlocal was
        factor = math.cos(frequency_radps * (plant.time_s + dt) + phase) * math.cos(wave_number_radpm * plant.x)
        now = (factor * north_mps, factor * east_mps, 0.0)
        if now == was:
            return ZERO6
        change, was = minus(now, was), now
        plant.current_mps = plus(plant.current_mps, change)
        if plant.time_s == 0.0:  # it moved already before the world began
            return ZERO6
        X, Y, Z = (mass * part / dt for mass, part in zip(masses, rotate_back(plant.quaternion, change), strict=True))
        return (X, Y, Z, 0.0, 0.0, 0.0)

    world.influences.append(move)
