"""From the truth at an inertial sensor to its converters: interpolation, filter, offset, noise, clock error.

Figures of noise and offset: TDK DS-000189 r1.3, tables 1 (gyroscope), 2 (accelerometer) and section 13 (magnetometer).
"""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass

import numpy as np

from hindrax_core.readings import Vec3, Vec6
from hindrax_core.vehicle import GRAVITY_mps2
from hindrax_sim.physics.geometry import six

GYRO_NOISE = math.radians(0.015)
"""Rate noise density [rad/s/sqrt(Hz)]."""
ACCEL_NOISE = 230e-6 * GRAVITY_mps2
"""Specific force noise density [m/s^2/sqrt(Hz)]."""
GYRO_OFFSET_radps = math.radians(5.0)
ACCEL_OFFSET_mps2 = 0.025 * GRAVITY_mps2
CLOCK_ERROR = 0.01

HISTORY = 512
NOISE_BLOCK = 6 * 256


@dataclass(frozen=True, slots=True)
class ImuTruth:
    """Output of an ideal sensor at this place, in the axes of the inertial sensor (the magnetic field too)."""

    specific_force_mps2: Vec3 = (0.0, 0.0, GRAVITY_mps2)
    rate_radps: Vec3 = (0.0, 0.0, 0.0)
    field_T: Vec3 = (20e-6, 0.0, -15e-6)
    temperature_C: float = 25.0


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of one part. `noise` scales the noise of the datasheet; 0 gives a noiseless sensor."""

    gyro_offset_radps: Vec3 = (0.0, 0.0, 0.0)
    accel_offset_mps2: Vec3 = (0.0, 0.0, 0.0)
    hard_iron_T: Vec3 = (0.0, 0.0, 0.0)
    clock_error: float = 0.0
    """Relative error of the sample period: positive samples too slowly."""
    noise: float = 1.0


def typical(seed: int) -> SensorErrors:
    """Draw the errors of a part: typical tolerances of the datasheet count as two standard deviations.

    The magnetometer is calibrated in its vehicle, with a residual of half a microtesla.
    """
    draw = random.Random(f"imu {seed}")  # noqa: S311  # noise, not secrets

    def three(sigma: float) -> Vec3:
        return (draw.gauss(0.0, sigma), draw.gauss(0.0, sigma), draw.gauss(0.0, sigma))

    return SensorErrors(
        three(GYRO_OFFSET_radps / 2.0), three(ACCEL_OFFSET_mps2 / 2.0), three(0.5e-6), draw.gauss(0.0, CLOCK_ERROR / 2)
    )


class LowPass:
    """A first-order filter, sampled: exact for an input that runs straight from one sample to the next."""

    def __init__(self, corner_Hz: float, period_s: float) -> None:
        lag_s = 1.0 / (math.tau * corner_Hz)
        self._decay = math.exp(-period_s / lag_s)
        self._lag = lag_s / period_s
        self.root_band = math.sqrt(math.pi / 2.0 * corner_Hz)
        """Root of the noise bandwidth [sqrt(Hz)]."""

    def step(self, old: float, before: float, now: float) -> float:
        """Output after one period, from the output and the input before it and the input now."""
        behind = self._lag * (now - before)
        return now - behind + (old - before + behind) * self._decay


class ImuSignal:
    """The analog side: a history of truths, and six filtered and noisy values at any time that moves forward."""

    def __init__(self, imperfections: SensorErrors, seed: int) -> None:
        self.imperfections = imperfections
        self.truth = ImuTruth()
        self._history: deque[tuple[float, Vec6]] = deque(maxlen=HISTORY)
        self._draw = np.random.default_rng([seed, 20948])
        self._noise: list[float] = []
        self._before: Vec6 | None = None
        self._filtered: Vec6 | None = None

    def set_truth(self, truth: ImuTruth, now_s: float) -> None:
        """Add the truth at a time; it is interpolated linearly."""
        self.truth = truth
        self._history.append((now_s, (*truth.specific_force_mps2, *truth.rate_radps)))

    def forget(self) -> None:
        """Restart the filter, as after a reset."""
        self._before = self._filtered = None

    def sample(self, t_s: float, accel: LowPass, gyro: LowPass) -> Vec6:
        """Specific force [m/s^2] and rate [rad/s] at a time, one period of the filters after the sample before."""
        now = self.at(t_s)
        before, old = self._before or now, self._filtered or now
        filters = (accel, accel, accel, gyro, gyro, gyro)
        filtered = six(one.step(*at) for one, *at in zip(filters, old, before, now, strict=True))
        self._before, self._filtered = now, filtered
        part = self.imperfections
        offsets = (*part.accel_offset_mps2, *part.gyro_offset_radps)
        sa, sg = part.noise * ACCEL_NOISE * accel.root_band, part.noise * GYRO_NOISE * gyro.root_band
        sigmas = (sa, sa, sa, sg, sg, sg)
        return six(x + o + s * self.normal() for x, o, s in zip(filtered, offsets, sigmas, strict=True))

    def at(self, t_s: float) -> Vec6:
        """Truth at a time: linear between two truths, constant before the first and after the last."""
        history = self._history
        if not history:
            return (*self.truth.specific_force_mps2, *self.truth.rate_radps)
        while len(history) > 1 and history[1][0] <= t_s:
            history.popleft()
        t0, first = history[0]
        if len(history) == 1 or t_s <= t0:
            return first
        t1, second = history[1]
        k = (t_s - t0) / (t1 - t0)
        return six(a + k * (b - a) for a, b in zip(first, second, strict=True))

    def normal(self) -> float:
        """One draw from a standard normal distribution."""
        if not self._noise:
            self._noise = self._draw.standard_normal(NOISE_BLOCK).tolist()
        return self._noise.pop()
