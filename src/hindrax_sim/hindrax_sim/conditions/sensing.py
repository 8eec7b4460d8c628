"""Conditions of the sensors. Each function adds one of them, of a size, to a world in the making."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.sensor_table import SENSORS
from hindrax_core.signals import ZERO6
from hindrax_sim.conditions.realization import Realization, Travel, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

FALSE_m = 0.015
"""Deviation of what one false lock adds to the ground covered: 0.3 m/s over an interval of 50 ms."""


def dvl_scale(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The DVL says a share more than the velocity, as with a wrong speed of sound.

    Size: A50: 1 % long-term accuracy, 0.1 % in its better edition; 2 K of water are 0.3 %.
    """

    def scaled(travel: Travel) -> Travel:
        turned, (x, y, z) = travel
        return turned, ((1.0 + size) * x, (1.0 + size) * y, (1.0 + size) * z)

    world.travel_errors.append(scaled)


def dvl_bias(world: Realization, size: float, draws: NormalDraws) -> None:
    """The DVL adds a constant velocity in a horizontal direction drawn at random.

    Size: 1 mm/s is its resolution; crosstalk between beams over a hard floor brings more, our estimate.
    """
    x, y, _ = unit(draws.three(1.0))
    level = math.hypot(x, y)
    bias = Bias((size * x / level, size * y / level, 0.0))
    world.influences.append(bias)
    world.travel_errors.append(bias.added)


class Bias:
    """Adds ground covered at a constant velocity."""

    def __init__(self, velocity_mps: Vec3) -> None:
        self._velocity_mps = velocity_mps
        self._time_s = 0.0

    def wrench(self, _plant: Plant, dt: float) -> Vec6:
        """Let time pass; no force."""
        self._time_s += dt
        return ZERO6

    def added(self, travel: Travel) -> Travel:
        """The ground covered with what the bias has added so far."""
        turned, (x, y, z) = travel
        a, b, c = (each * self._time_s for each in self._velocity_mps)
        return turned, (x + a, y + b, z + c)


def dvl_yaw(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The DVL is mounted with a turn about the vertical axis that the vehicle file does not know.

    Size: Mounting by eye; our estimate.
    """
    _turn_mounts(world, "velocity", (0.0, 0.0, size))


def imu_misalignment(world: Realization, size: float, draws: NormalDraws) -> None:
    """The IMU is mounted with a turn about an axis drawn at random.

    Size: Mounting by eye; our estimate.
    """
    x, y, z = unit(draws.three(1.0))
    _turn_mounts(world, "data_raw", (size * x, size * y, size * z))


def _turn_mounts(world: Realization, quantity: str, turn_deg: Vec3) -> None:
    """Turn every sensor that publishes a quantity."""
    kinds = {sensor.name for sensor in SENSORS if quantity in sensor.publishes}
    a, b, c = turn_deg

    def turned(angles: Vec3) -> Vec3:
        x, y, z = angles
        return (x + a, y + b, z + c)

    sensors = {
        name: replace(mount, rotation_deg=turned(mount.rotation_deg)) if mount.device in kinds else mount
        for name, mount in world.vehicle.sensors.items()
    }
    world.change_vehicle(sensors=sensors)


def dvl_latency(world: Realization, size: float, _draws: NormalDraws) -> None:
    """What the DVL says was true this long before the time that it gives.

    Size: One interval at 20 Hz; a network brings more.
    """
    late = Latency(size)
    world.influences.append(late)
    world.travel_errors.append(late.delayed)


class Latency:
    """Keeps the travel of the last moments, and answers with that of a while ago."""

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._time_s = 0.0
        self._kept: deque[tuple[float, Travel]] = deque()

    def wrench(self, plant: Plant, dt: float) -> Vec6:
        """Remember where the vehicle is at the beginning of this step; no force."""
        self._kept.append((self._time_s, _travel(plant)))
        self._time_s += dt
        while len(self._kept) > 1 and self._kept[1][0] <= self._time_s - self._latency_s:
            self._kept.popleft()
        return ZERO6

    def delayed(self, travel: Travel) -> Travel:
        """What was true a while ago, linear between the steps."""
        if not self._kept:
            return travel
        then_s = self._time_s - self._latency_s
        (at_s, was), (next_s, following) = self._kept[0], (self._time_s, travel)
        if len(self._kept) > 1:
            next_s, following = self._kept[1]
        share = min(1.0, max(0.0, (then_s - at_s) / (next_s - at_s)))
        (ax, ay, az), (sx, sy, sz) = was
        (bx, by, bz), (tx, ty, tz) = following
        return (
            (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)),
            (sx + share * (tx - sx), sy + share * (ty - sy), sz + share * (tz - sz)),
        )


def _travel(plant: Plant) -> Travel:
    return (plant.ax, plant.ay, plant.az), (plant.sx, plant.sy, plant.sz)


def false_locks(world: Realization, size: float, draws: NormalDraws) -> None:
    """The DVL takes something else for the bottom, so often per second, each time for one interval.

    Size: One sample in a hundred; our estimate.
    """
    false = FalseLocks(size, draws)
    world.influences.append(false)
    world.travel_errors.append(false.added)


class FalseLocks:
    """Steps in the ground covered, with exponential waiting times: each is one wrong velocity."""

    def __init__(self, rate_Hz: float, draws: NormalDraws) -> None:
        self._rate_Hz, self._draws = rate_Hz, draws
        self._wait_s = self._waiting()
        self._sum = (0.0, 0.0, 0.0)

    def _waiting(self) -> float:
        return -math.log(max(1e-12, self._draws.uniform())) / self._rate_Hz

    def wrench(self, _plant: Plant, dt: float) -> Vec6:
        """Let time pass; no force."""
        self._wait_s -= dt
        if self._wait_s <= 0.0:
            self._wait_s += self._waiting()
            (x, y, z), (a, b, c) = self._sum, self._draws.three(FALSE_m)
            self._sum = (x + a, y + b, z + c)
        return ZERO6

    def added(self, travel: Travel) -> Travel:
        """The ground covered with all steps so far."""
        turned, (x, y, z) = travel
        a, b, c = self._sum
        return turned, (x + a, y + b, z + c)
