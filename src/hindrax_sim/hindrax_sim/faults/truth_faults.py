"""Faults of vehicle and water, and devices that lie: their data is plausible, and what they measure is not true.

Parameters
----------
world, target, on
    Of a fault of vehicle or water: changed in place; name of the thruster or device; whether the fault begins or ends.
truth
    Of a device that lies: what it would sense without this fault.
was
    What it sensed the time before, with the fault; `truth` at the first.
dt_s : [s]
    Time since then.

Returns
-------
Truth of the same kind
    Of a device that lies: what it senses.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias, TypeVar

from hindrax_core.readings import Pressure, Vec3
from hindrax_sim.devices.ardupilot.firmware import AutopilotTruth
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.imu.imu_signal import ImuTruth
from hindrax_sim.devices.ping1d import PingTruth
from hindrax_sim.physics.geometry import plus
from hindrax_sim.world import World

CURRENT_mps = 0.15
"""Across the pool: what a vehicle that flies along it feels most."""
SCALE = 1.5
TOO_DEEP, AIR_Pa = 1.2, 101_325.0
NEAR_m, SHORT_m = 0.3, 0.5
GYRO_OFFSET_radps: Vec3 = (math.radians(40.0), 0.0, 0.0)
FORCE_OFFSET_mps2: Vec3 = (0.0, 3.0, 0.0)
BIAS_mps, NOWHERE = (0.25, 0.0, 0.0), (0.0, 0.0, 0.0)
DepthT = TypeVar("DepthT", Pressure, AutopilotTruth)
SensorFault: TypeAlias = Callable[[Any, Any, float], Any]
"""Truth as a device senses it, from the truth, its previous output, and the time since [s]."""
WorldFault: TypeAlias = Callable[[World, str, bool], None]
"""Starts a fault of the world, or ends it; the name is that of its target."""


def thruster_fails(world: World, target: str, on: bool) -> None:
    """Stop the thruster `target`, or restore it."""
    world.fail_thruster(target, 0.0 if on else 1.0)


def thruster_reversed(world: World, target: str, on: bool) -> None:
    """Turn the force of the thruster `target` round, as two exchanged phases do, or restore it."""
    world.fail_thruster(target, -1.0 if on else 1.0)


def supply_dies(world: World, _target: str, on: bool) -> None:
    """Take all thrusters their power, while the computer has its own."""
    for thruster in world.vehicle.thrusters:
        world.fail_thruster(thruster.name, 0.0 if on else 1.0)
    world.supply_dead = on


def lock_lost(world: World, _target: str, on: bool) -> None:
    """Take the DVL its bottom lock."""
    world.dvl_silenced = on


def leak(world: World, _target: str, on: bool) -> None:
    """Let water into the dry hull; at the end it dries."""
    world.water_in_hull = on


def depth_drifts(world: World, _target: str, on: bool) -> None:
    """Let every pressure sensor drift, as one that warms up or clogs slowly; at the end it is right again."""
    world.pressure_drifts_since = world.stamp if on else None


def current(world: World, _target: str, on: bool) -> None:
    """Move the water across the pool; at the end it moves as it does without the fault."""
    world.plant.current_mps = plus(world.plant.current_mps, (0.0, CURRENT_mps if on else -CURRENT_mps, 0.0))


def velocity_bias(truth: DvlTruth, was: DvlTruth, dt_s: float) -> DvlTruth:
    """A velocity with an offset forward, and the way that belongs to it."""
    velocity = plus(BIAS_mps, truth.velocity_mps)
    return replace(truth, velocity_mps=velocity, travel_m=plus(was.travel_m or NOWHERE, velocity, dt_s))


def velocity_turned(truth: DvlTruth, was: DvlTruth, dt_s: float) -> DvlTruth:
    """The velocity of an instrument that was mounted a quarter turn off, and the way that belongs to it."""
    u, v, w = truth.velocity_mps
    velocity = (-v, u, w)
    return replace(truth, velocity_mps=velocity, travel_m=plus(was.travel_m or NOWHERE, velocity, dt_s))


def velocity_scaled(truth: DvlTruth, was: DvlTruth, dt_s: float) -> DvlTruth:
    """A velocity that is half as large again, as with the sound speed of another medium, and the way of it."""
    u, v, w = (SCALE * one for one in truth.velocity_mps)
    return replace(truth, velocity_mps=(u, v, w), travel_m=plus(was.travel_m or NOWHERE, (u, v, w), dt_s))


def velocity_frozen(truth: DvlTruth, _was: DvlTruth, _dt_s: float) -> DvlTruth:
    """The instrument measures no more: it repeats its last velocity, with new times."""
    return replace(truth, frozen=True)


def velocity_stuck(truth: DvlTruth, was: DvlTruth, dt_s: float) -> DvlTruth:
    """The tracking of the echo hangs: the velocity stays, while noise and times go on."""
    return replace(truth, velocity_mps=was.velocity_mps, travel_m=plus(was.travel_m or NOWHERE, was.velocity_mps, dt_s))


def false_lock(truth: DvlTruth, was: DvlTruth, _dt_s: float) -> DvlTruth:
    """The DVL is locked on something near that moves along: a cable, a plume of bubbles."""
    return replace(truth, velocity_mps=(0.0, 0.0, 0.0), travel_m=was.travel_m or NOWHERE, altitude_m=NEAR_m)


def depth_stuck(truth: DepthT, was: DepthT, _dt_s: float) -> DepthT:
    """The pressure sensor is clogged: it keeps the pressure that it had, whatever else its device measures."""
    return was if isinstance(truth, Pressure) else replace(truth, water_Pa=was.water_Pa)


def depth_scaled(truth: DepthT, _was: DepthT, _dt_s: float) -> DepthT:
    """The pressure of another range of the same part: what the water adds is taken for a fifth more."""
    if isinstance(truth, Pressure):
        return replace(truth, pressure_Pa=AIR_Pa + TOO_DEEP * (truth.pressure_Pa - AIR_Pa))
    return replace(truth, water_Pa=AIR_Pa + TOO_DEEP * (truth.water_Pa - AIR_Pa))


def gyro_scaled(truth: ImuTruth, _was: ImuTruth, _dt_s: float) -> ImuTruth:
    """Rates that are half as large again, as of another range of the gyroscope."""
    p, q, r = (SCALE * one for one in truth.rate_radps)
    return replace(truth, rate_radps=(p, q, r))


def gyro_turned(truth: ImuTruth, _was: ImuTruth, _dt_s: float) -> ImuTruth:
    """Rates by a quarter turn off about the vertical: another part than the accelerometer's, that came loose."""
    p, q, r = truth.rate_radps
    return replace(truth, rate_radps=(-q, p, r))


def gyro_frozen(truth: ImuTruth, was: ImuTruth, _dt_s: float) -> ImuTruth:
    """The gyroscope repeats its last rates, while the accelerometer goes on."""
    return replace(truth, rate_radps=was.rate_radps)


def gyro_offset(truth: ImuTruth, _was: ImuTruth, _dt_s: float) -> ImuTruth:
    """The offset of the gyroscope jumps, as when a solder joint gives."""
    return replace(truth, rate_radps=plus(truth.rate_radps, GYRO_OFFSET_radps))


def force_offset(truth: ImuTruth, _was: ImuTruth, _dt_s: float) -> ImuTruth:
    """The offset of the accelerometer jumps: gravity seems to come from the side."""
    return replace(truth, specific_force_mps2=plus(truth.specific_force_mps2, FORCE_OFFSET_mps2))


def range_scaled(truth: PingTruth, _was: PingTruth, _dt_s: float) -> PingTruth:
    """The echo sounder's ranges are half as large again, as with the sound speed of another medium."""
    return replace(truth, distance_m=None if truth.distance_m is None else SCALE * truth.distance_m)


def range_frozen(_truth: PingTruth, was: PingTruth, _dt_s: float) -> PingTruth:
    """The echo sounder repeats its last range, with new numbers."""
    return was


def range_short(truth: PingTruth, _was: PingTruth, _dt_s: float) -> PingTruth:
    """The echo sounder measures something above the floor."""
    found_m = truth.distance_m
    return replace(truth, distance_m=None if found_m is None else max(NEAR_m, found_m - SHORT_m))
