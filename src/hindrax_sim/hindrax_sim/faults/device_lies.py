"""Devices that lie: they work, their data is plausible, and it is wrong. What they measure is not what is true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

from hindrax_core.readings import Vec3
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.imu.imu_signal import ImuTruth
from hindrax_sim.devices.ms5837 import WaterTruth
from hindrax_sim.devices.ping1d import PingTruth
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled

NEAR_m = 0.3


class SensorFault(Protocol):
    """What a device takes for the truth while it lies."""

    def __call__(self, truth: Any, now_s: float) -> Any:
        """Return the truth with the lie in it."""


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


class _FalseVelocity:
    """A velocity that is not the true one; `_velocity` tells which."""

    def __init__(self) -> None:
        self._last_s = math.nan
        self._covered_m: Vec3 = (0.0, 0.0, 0.0)

    def __call__(self, truth: DvlTruth, now_s: float) -> DvlTruth:
        if math.isnan(self._last_s):
            self._last_s, self._covered_m = now_s, truth.travel_m or (0.0, 0.0, 0.0)
        velocity = self._velocity(truth.velocity_mps)
        self._covered_m = _sum(self._covered_m, velocity, now_s - self._last_s)
        self._last_s = now_s
        return replace(truth, velocity_mps=velocity, travel_m=self._covered_m)

    def _velocity(self, true_mps: Vec3) -> Vec3:
        raise NotImplementedError


class VelocityBias(_FalseVelocity):
    """A velocity with an offset forward."""

    BIAS_mps = (0.25, 0.0, 0.0)

    def _velocity(self, true_mps: Vec3) -> Vec3:
        return _sum(true_mps, self.BIAS_mps)


class VelocityFrozen:
    """The instrument repeats its last velocity, with new times."""

    def __call__(self, truth: DvlTruth, now_s: float) -> DvlTruth:
        """Measure no more."""
        del now_s
        return replace(truth, frozen=True)


class FalseLock(_FalseVelocity):
    """The DVL is locked on something near that moves along: a cable, a plume of bubbles."""

    def __call__(self, truth: DvlTruth, now_s: float) -> DvlTruth:
        """Hear no motion, and a floor that is near."""
        return replace(super().__call__(truth, now_s), altitude_m=NEAR_m)

    def _velocity(self, true_mps: Vec3) -> Vec3:
        del true_mps
        return (0.0, 0.0, 0.0)


class GyroOffset:
    """The offset of the gyroscope jumps, as when a solder joint gives."""

    OFFSET_radps = (math.radians(40.0), 0.0, 0.0)

    def __call__(self, truth: ImuTruth, now_s: float) -> ImuTruth:
        """Turn on."""
        del now_s
        return replace(truth, rate_radps=_sum(truth.rate_radps, self.OFFSET_radps))


class ForceOffset:
    """The offset of the accelerometer jumps: gravity seems to come from the side."""

    OFFSET_mps2 = (0.0, 3.0, 0.0)

    def __call__(self, truth: ImuTruth, now_s: float) -> ImuTruth:
        """Push to starboard."""
        del now_s
        return replace(truth, specific_force_mps2=_sum(truth.specific_force_mps2, self.OFFSET_mps2))


class DepthStuck:
    """The pressure sensor is clogged: it keeps the pressure that it had."""

    def __init__(self) -> None:
        self._kept: WaterTruth | None = None

    def __call__(self, truth: WaterTruth, now_s: float) -> WaterTruth:
        """Keep the first."""
        del now_s
        self._kept = self._kept or truth
        return self._kept


class RangeShort:
    """The echo sounder hears something above the floor."""

    SHORT_m = 0.5

    def __call__(self, truth: PingTruth, now_s: float) -> PingTruth:
        """Shorten the range."""
        del now_s
        return replace(
            truth, distance_m=None if truth.distance_m is None else max(NEAR_m, truth.distance_m - self.SHORT_m)
        )


def _sum(one: Vec3, other: Vec3, times: float = 1.0) -> Vec3:
    x, y, z = (a + times * b for a, b in zip(one, other, strict=True))
    return (x, y, z)
