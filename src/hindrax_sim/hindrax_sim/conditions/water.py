"""Conditions of water and tether. Each function adds one of them, of a size, to a world in the making."""

from __future__ import annotations

import math

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.signals import ZERO6
from hindrax_core.vehicle import AXES, GRAVITY_mps2
from hindrax_sim.conditions.realization import Realization, lever_wrench
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.quaternion import rotate

TETHER_m, TETHER_mps = 5.0, 0.5
MEMORY_S = 1.0
WAKE_S = 5.0


def tether(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A line from the top of the stern to the end of the pool pulls, with this force at 5 m and more the longer it is.

    Size: What a hand feels of a neutral line of 8 mm; our estimate.
    """
    world.influences.append(Tether(world, size, 0.0))


def tether_drag(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The line is dragged along: it brakes with this force at 0.5 m/s and 5 m, with speed squared and with its length.

    Size: 7.6 mm (Fathom ROV Tether), C_D 1.2, speed growing evenly along 5 m: 1.9 N.
    """
    world.influences.append(Tether(world, 0.0, size))


class Tether:
    """Pull towards the anchor, `pull_N` at a distance of 5 m; drag against the motion, `drag_N` there at 0.5 m/s.

    Both grow with the horizontal distance, and act at the top of the stern.
    """

    def __init__(self, world: Realization, pull_N: float, drag_N: float) -> None:
        vehicle = world.vehicle
        length, _, height = vehicle.envelope_m
        cx, cy, cz = vehicle.center_of_mass_m
        self._lever_m = (-0.5 * length - cx, -cy, -0.5 * height - cz)
        self._anchor_x = -0.5 * vehicle.pool.length_m
        self._pull, self._drag = pull_N / TETHER_m, drag_N / (TETHER_m * TETHER_mps**2)

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """Pull and drag at the stern."""
        w, x, y, z = plant.quaternion
        away = (plant.x - self._anchor_x, plant.y, 0.0)
        a, b, c = rotate((w, -x, -y, -z), away)
        u, v, down, _, _, _ = plant.mid_step(dt)
        brake = self._drag * math.hypot(*away) * math.sqrt(u * u + v * v + down * down)
        pull = self._pull
        return lever_wrench((-pull * a - brake * u, -pull * b - brake * v, -pull * c - brake * down), self._lever_m)


def fluid_memory(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A share of the added mass follows with a delay of 1 s, beside the added mass that acts at once.

    Size: Flow follows in about a length over speed; our estimate.
    """
    shares = [size * mass for mass in world.hydrodynamics.added_mass]
    world.influences.append(FluidMemory(shares))


class FluidMemory:
    """Cummins' convolution with one exponential: F = -share d/dt (the velocity through a first-order lag of 1 s)."""

    def __init__(self, shares: list[float]) -> None:
        self._shares = shares
        self._followed = [0.0] * 6

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """Force of the memory on each axis."""
        kept = math.exp(-dt / MEMORY_S)
        forces = []
        for axis, (velocity, share) in enumerate(zip(plant.mid_step(dt), self._shares, strict=True)):
            behind = velocity - self._followed[axis]
            forces.append(-share * behind / MEMORY_S)
            self._followed[axis] += (1.0 - kept) * behind
        X, Y, Z, K, M, N = forces
        return (X, Y, Z, K, M, N)


def wake(world: Realization, size: float, _draws: NormalDraws) -> None:
    """Whoever turns back meets the water that he dragged along: a share of his speed, forgotten in 5 s.

    Size: Wake fraction of bluff hulls, 0.1 to 0.3; our estimate.
    """
    world.influences.append(Wake(world, size))


class Wake:
    """Drag at the speed through the water that follows the vehicle, less the drag that the plant knows.

    The water's speed is `size` times the vehicle's own through a first-order lag of 5 s, and is met only by a motion
    against it.
    """

    def __init__(self, world: Realization, size: float) -> None:
        self._size, self._followed = size, [0.0] * 6
        self._drags = [world.hydrodynamics.drag(axis) for axis in AXES]

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """What the wake adds to the drag of each axis."""
        share = 1.0 - math.exp(-dt / WAKE_S)
        forces = []
        for axis, (velocity, drag) in enumerate(zip(plant.mid_step(dt), self._drags, strict=True)):
            followed = self._followed[axis]
            met = velocity - self._size * followed if velocity * followed < 0.0 else velocity
            forces.append(drag.resistance(velocity) - drag.resistance(met))
            self._followed[axis] += share * (velocity - followed)
        X, Y, Z, K, M, N = forces
        return (X, Y, Z, K, M, N)


def current(world: Realization, size: float, draws: NormalDraws) -> None:
    """The water moves evenly, in a horizontal direction drawn at random.

    Size: Pool circulation; our estimate.
    """
    angle = math.tau * draws.uniform()
    world.influences.append(MovingWater(world, (size * math.cos(angle), size * math.sin(angle), 0.0)))


def seiche(world: Realization, size: float, draws: NormalDraws) -> None:
    """The pool's longest standing wave moves the water to and fro along its length; its phase is drawn at random.

    Size: A wave of 4 mm: its height times sqrt(g / depth).
    """
    pool = world.vehicle.pool
    # Merian's formula: the longest wave of a closed basin is twice its length.
    period_s = 2.0 * pool.length_m / math.sqrt(GRAVITY_mps2 * pool.depth_m)
    phase = math.tau * draws.uniform()
    world.influences.append(MovingWater(world, (size, 0.0, 0.0), math.tau / period_s, phase, math.pi / pool.length_m))


class MovingWater:
    """Water that moves with amplitude * cos(frequency t + phase) * cos(wave_number x), horizontally.

    Accelerated water takes the vehicle along: with the mass that it displaces and its added mass (Froude-Krylov).
    """

    def __init__(
        self,
        world: Realization,
        amplitude_mps: Vec3,
        frequency_radps: float = 0.0,
        phase: float = 0.0,
        wave_number_radpm: float = 0.0,
    ) -> None:
        vehicle = world.vehicle
        displaced = vehicle.volume_m3 * vehicle.water.density_kgpm3
        self._masses = [displaced + mass for mass in world.hydrodynamics.added_mass[:3]]
        self._amplitude, self._frequency, self._phase = amplitude_mps, frequency_radps, phase
        self._wave_number = wave_number_radpm
        self._time_s, self._was = 0.0, (0.0, 0.0, 0.0)

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """Move the water; force of its acceleration."""
        self._time_s += dt
        factor = math.cos(self._frequency * self._time_s + self._phase) * math.cos(self._wave_number * plant.x)
        now = (factor * self._amplitude[0], factor * self._amplitude[1], 0.0)
        was, self._was = self._was, now
        change = (now[0] - was[0], now[1] - was[1], 0.0)
        if not any(change):
            return ZERO6
        cx, cy, cz = plant.current_mps
        plant.current_mps = (cx + change[0], cy + change[1], cz)
        if self._time_s == dt:  # it moved already before the world began
            return ZERO6
        w, x, y, z = plant.quaternion
        into_body = rotate((w, -x, -y, -z), change)
        X, Y, Z = (mass * part / dt for mass, part in zip(self._masses, into_body, strict=True))
        return (X, Y, Z, 0.0, 0.0, 0.0)
