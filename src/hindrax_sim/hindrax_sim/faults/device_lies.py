"""Devices that lie: they work, their data is plausible, and it is wrong. What they measure is not what is true."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from hindrax_core.readings import Vec3
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.imu.imu_signal import ImuTruth
from hindrax_sim.devices.ms5837 import WaterTruth
from hindrax_sim.devices.ping1d import PingTruth
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled

NEAR_m, SHORT_m = 0.3, 0.5
GYRO_OFFSET_radps: Vec3 = (math.radians(40.0), 0.0, 0.0)
FORCE_OFFSET_mps2: Vec3 = (0.0, 3.0, 0.0)
SensorFault: TypeAlias = Callable[[Any, float], Any]
"""Makes what a device takes for the truth at a time of what is true."""


class SensorFaultInjector:
    """Tells a device the truth, or while a lie is scheduled that."""

    def __init__(self, schedule: Sequence[Scheduled[SensorFault]]) -> None:
        self._schedule = FaultSchedule(schedule) if schedule else None

    def told(self, truth: Any, now_s: float) -> Any:
        """Return what the device measures now."""
        if self._schedule is None:
            return truth
        self._schedule.advance(now_s)
        for lie in self._schedule.active:
            truth = lie(truth, now_s)
        return truth


class VelocityBias:
    """A velocity with an offset forward: this share of the true one, and the offset."""

    def __init__(self, share: float = 1.0, bias_mps: Vec3 = (0.25, 0.0, 0.0)) -> None:
        self._share, self._bias_mps = share, bias_mps
        self._last_s = math.nan
        self._covered_m: Vec3 = (0.0, 0.0, 0.0)

    def __call__(self, truth: DvlTruth, now_s: float) -> DvlTruth:
        """Cover the way that belongs to the velocity."""
        if math.isnan(self._last_s):
            self._last_s, self._covered_m = now_s, truth.travel_m or (0.0, 0.0, 0.0)
        velocity = _sum(self._bias_mps, truth.velocity_mps, self._share)
        self._covered_m = _sum(self._covered_m, velocity, now_s - self._last_s)
        self._last_s = now_s
        return replace(truth, velocity_mps=velocity, travel_m=self._covered_m)


class FalseLock(VelocityBias):
    """The DVL is locked on something near that moves along: a cable, a plume of bubbles."""

    def __init__(self) -> None:
        super().__init__(0.0, (0.0, 0.0, 0.0))

    def __call__(self, truth: DvlTruth, now_s: float) -> DvlTruth:
        """Hear no motion, and a floor that is near."""
        return replace(super().__call__(truth, now_s), altitude_m=NEAR_m)


class DepthStuck:
    """The pressure sensor is clogged: it keeps the pressure that it had."""

    def __init__(self) -> None:
        self._kept: WaterTruth | None = None

    def __call__(self, truth: WaterTruth, _now_s: float) -> WaterTruth:
        """Keep the first."""
        self._kept = self._kept or truth
        return self._kept


def velocity_frozen(truth: DvlTruth, _now_s: float) -> DvlTruth:
    """The instrument measures no more: it repeats its last velocity, with new times."""
    return replace(truth, frozen=True)


def gyro_offset(truth: ImuTruth, _now_s: float) -> ImuTruth:
    """The offset of the gyroscope jumps, as when a solder joint gives."""
    return replace(truth, rate_radps=_sum(truth.rate_radps, GYRO_OFFSET_radps))


def force_offset(truth: ImuTruth, _now_s: float) -> ImuTruth:
    """The offset of the accelerometer jumps: gravity seems to come from the side."""
    return replace(truth, specific_force_mps2=_sum(truth.specific_force_mps2, FORCE_OFFSET_mps2))


def range_short(truth: PingTruth, _now_s: float) -> PingTruth:
    """The echo sounder hears something above the floor."""
    found_m = truth.distance_m
    return replace(truth, distance_m=None if found_m is None else max(NEAR_m, found_m - SHORT_m))


def _sum(one: Vec3, other: Vec3, times: float = 1.0) -> Vec3:
    x, y, z = (a + times * b for a, b in zip(one, other, strict=True))
    return (x, y, z)
