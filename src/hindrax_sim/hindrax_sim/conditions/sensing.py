"""Conditions of the sensors. Each function adds one of them, of a size, to a world in the making.

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
from collections import deque
from dataclasses import replace

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.rotation import minus
from hindrax_core.sensor_table import Capability
from hindrax_core.signals import ZERO6
from hindrax_sim.conditions.realization import Realization, Travel
from hindrax_sim.physics.geometry import plus, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant

FALSE_m = 0.015
"""Deviation of what one false lock adds to the ground covered: 0.3 m/s over an interval of 50 ms."""


def dvl_scale(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The DVL overstates the velocity by a share, as with a wrong speed of sound.

    Size: A50: 1 % long-term accuracy, 0.1 % in its better edition; 2 K of water are 0.3 %.
    """

    def scaled(_plant: Plant, travel: Travel) -> Travel:
        turned, (x, y, z) = travel
        return turned, ((1.0 + size) * x, (1.0 + size) * y, (1.0 + size) * z)

    world.travel_errors.append(scaled)


def dvl_bias(world: Realization, size: float, draws: NormalDraws) -> None:
    """The DVL adds a constant velocity in a horizontal direction drawn at random.

    Size: 1 mm/s is its resolution; crosstalk between beams over a hard floor brings more, our estimate.
    """
    x, y, _ = unit(draws.three(1.0))
    level = math.hypot(x, y)
    u, v = size * x / level, size * y / level

    def biased(plant: Plant, travel: Travel) -> Travel:
        turned, (x, y, z) = travel
        return turned, (x + u * plant.time_s, y + v * plant.time_s, z)

    world.travel_errors.append(biased)


def dvl_yaw(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The DVL is mounted with a turn about the vertical axis that the vehicle file lacks.

    Size: Mounting by eye; our estimate.
    """
    _turn_mounts(world, "velocity", (0.0, 0.0, size))


def imu_misalignment(world: Realization, size: float, draws: NormalDraws) -> None:
    """The IMU is mounted with a turn about an axis drawn at random.

    Size: Mounting by eye; our estimate.
    """
    x, y, z = unit(draws.three(1.0))
    _turn_mounts(world, "rates", (size * x, size * y, size * z))


def _turn_mounts(world: Realization, capability: Capability, turn_deg: Vec3) -> None:
    sensors = dict(world.vehicle.sensors)
    for name in world.vehicle.measuring(capability):
        sensors[name] = replace(sensors[name], rotation_deg=plus(sensors[name].rotation_deg, turn_deg))
    world.change_vehicle(sensors=sensors)


def dvl_latency(world: Realization, size: float, _draws: NormalDraws) -> None:
    """DVL velocities are older than their stamp by this time.

    Size: One interval at 20 Hz; a network brings more.
    """
    kept: deque[tuple[float, Travel]] = deque()

    def remember(plant: Plant, dt: float) -> Vec6:
        """Remember where the vehicle is at the beginning of this step."""
        kept.append((plant.time_s, ((plant.ax, plant.ay, plant.az), (plant.sx, plant.sy, plant.sz))))
        while len(kept) > 1 and kept[1][0] <= plant.time_s + dt - size:
            kept.popleft()
        return ZERO6

    def delayed(plant: Plant, travel: Travel) -> Travel:
        """Truth a while ago, linear between the steps."""
        if not kept:
            return travel
        (at_s, was), (next_s, following) = kept[0], kept[1] if len(kept) > 1 else (plant.time_s, travel)
        share = min(1.0, max(0.0, (plant.time_s - size - at_s) / (next_s - at_s)))
        turned, ground = (plus(a, minus(b, a), share) for a, b in zip(was, following, strict=True))
        return turned, ground

    world.influences.append(remember)
    world.travel_errors.append(delayed)


def false_locks(world: Realization, size: float, draws: NormalDraws) -> None:
    """The DVL locks on something else than the bottom, at this rate, each time for one interval.

    Size: One sample in a hundred; our estimate.
    """

    def waiting_s() -> float:
        return -math.log(max(1e-12, draws.uniform())) / size

    wait_s, off_m = waiting_s(), (0.0, 0.0, 0.0)

    def pass_time(_plant: Plant, dt: float) -> Vec6:
        """Step in the ground covered after an exponential waiting time: each step is one wrong velocity."""
        nonlocal wait_s, off_m
        wait_s -= dt
        if wait_s <= 0.0:
            wait_s += waiting_s()
            off_m = plus(off_m, draws.three(FALSE_m))
        return ZERO6

    world.influences.append(pass_time)
    world.travel_errors.append(lambda _plant, travel: (travel[0], plus(travel[1], off_m)))
