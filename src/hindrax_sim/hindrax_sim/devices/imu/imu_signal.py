"""From the truth at an inertial sensor to the samples of the ICM-20948: interpolation, errors, filters, clock, scales.

Source: TDK DS-000189 r1.3, tables 1 (gyroscope) and 2 (accelerometer), section 13 (magnetometer), bank 2.
"""

import math
import random
import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3, Vec6, vec6

GYRO_NOISE = math.radians(0.015)
"""Rate noise density [rad/s/sqrt(Hz)]."""
ACCEL_NOISE = 230e-6 * GRAVITY_mps2
"""Specific force noise density [m/s^2/sqrt(Hz)]."""
GYRO_OFFSET_radps = math.radians(5.0)
ACCEL_OFFSET_mps2 = 0.025 * GRAVITY_mps2
CLOCK_ERROR = 0.01

GYRO_SMPLRT_DIV, GYRO_CONFIG_1, GYRO_CONFIG_2 = 0x00, 0x01, 0x02
ACCEL_SMPLRT_DIV_1, ACCEL_CONFIG, ACCEL_CONFIG_2 = 0x10, 0x14, 0x15
BASE_RATE_Hz = 1125.0
GYRO_CORNER_Hz = (196.6, 151.8, 119.5, 51.2, 23.9, 11.6, 5.7, 361.4)
ACCEL_CORNER_Hz = (246.0, 246.0, 111.4, 50.4, 23.9, 11.5, 5.7, 473.0)
UNFILTERED_Hz = 1200.0
DPS = math.radians(1.0)
GYRO_LSB_PER_DPS = (131.0, 65.5, 32.8, 16.4)
ACCEL_LSB_PER_G = (16384.0, 8192.0, 4096.0, 2048.0)
SELF_TEST_CODES = bytes((98, 103, 95))
LOOK_BACK = 64
"""Samples that are made up for when nothing was read for long: more than the FIFO holds."""

SAMPLE = struct.Struct(">6h")
SATURATED = SAMPLE.pack(32767, -32768, 32767, -32768, 32767, -32768)

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

    Parameters
    ----------
    seed
        Of the draws.

    Returns
    -------
    SensorErrors
        Offsets and clock error; the noise is that of the datasheet.
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
        """Advance the filter by one period.

        Parameters
        ----------
        old, before
            Output and input one period ago.
        now
            Input now.

        Returns
        -------
        float
            Output now, in the unit of the input.
        """
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
        """Take one sample, filtered and with the errors of the part.

        Parameters
        ----------
        t_s : [s]
            One period of the filters after the sample before.
        accel, gyro
            Filters of the two.

        Returns
        -------
        Vec6
            Specific force [m/s^2] and rate [rad/s], in the axes of the chip.
        """
        now = self.at(t_s)
        before, old = self._before or now, self._filtered or now
        filters = (accel, accel, accel, gyro, gyro, gyro)
        filtered = vec6(one.step(*at) for one, *at in zip(filters, old, before, now, strict=True))
        self._before, self._filtered = now, filtered
        part = self.imperfections
        offsets = (*part.accel_offset_mps2, *part.gyro_offset_radps)
        sa, sg = part.noise * ACCEL_NOISE * accel.root_band, part.noise * GYRO_NOISE * gyro.root_band
        sigmas = (sa, sa, sa, sg, sg, sg)
        return vec6(x + o + s * self.normal() for x, o, s in zip(filtered, offsets, sigmas, strict=True))

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
        return vec6(a + k * (b - a) for a, b in zip(first, second, strict=True))

    def normal(self) -> float:
        """One draw from a standard normal distribution."""
        if not self._noise:
            self._noise = self._draw.standard_normal(NOISE_BLOCK).tolist()
        return self._noise.pop()


class Converters:
    """Makes samples of 12 bytes (accel x, y, z, gyro x, y, z) on a clock of its own."""

    def __init__(self, signal: ImuSignal) -> None:
        self._signal = signal
        self._last = SAMPLE.pack(0, 0, 0, 0, 0, 0)
        self.hung = self.saturated = False
        self.configure(bytes(128))
        self.stop()

    def configure(self, bank2: bytes | bytearray) -> None:
        """Set rates, scales, filters and self-test switches from the registers of bank 2."""
        gyro, accel = bank2[GYRO_CONFIG_1], bank2[ACCEL_CONFIG]
        error = 1.0 + self._signal.imperfections.clock_error
        gyro_divider = 1 + bank2[GYRO_SMPLRT_DIV] if gyro & 1 else 1
        accel_divider = 1 + (bank2[ACCEL_SMPLRT_DIV_1] << 8 & 0xF00 | bank2[ACCEL_SMPLRT_DIV_1 + 1]) if accel & 1 else 1
        self.period_s = gyro_divider / BASE_RATE_Hz * error
        self._accel_every = max(1, round(accel_divider / gyro_divider))
        self._gyro_filter = LowPass(GYRO_CORNER_Hz[gyro >> 3 & 7] if gyro & 1 else UNFILTERED_Hz, self.period_s)
        self._accel_filter = LowPass(ACCEL_CORNER_Hz[accel >> 3 & 7] if accel & 1 else UNFILTERED_Hz, self.period_s)
        a, g = ACCEL_LSB_PER_G[accel >> 1 & 3] / GRAVITY_mps2, GYRO_LSB_PER_DPS[gyro >> 1 & 3] / DPS
        self._lsb = (a, a, a, g, g, g)
        self._self_test = _self_test(bank2[ACCEL_CONFIG_2] >> 2, bank2[GYRO_CONFIG_2] >> 3)

    def start(self, at_s: float) -> None:
        """Wake up: the first sample follows one period after this time."""
        self._next_s, self._count = at_s + self.period_s, 0
        self._signal.forget()

    def stop(self) -> None:
        """Go to sleep."""
        self._next_s, self._count = math.inf, 0

    def advance(self, now_s: float) -> Iterator[tuple[float, bytes]]:
        """All samples that have become due with their times [s], oldest first; after a long time only the newest."""
        behind = (now_s - self._next_s) / self.period_s
        if behind > LOOK_BACK:
            skipped = int(behind) - LOOK_BACK
            self._next_s += skipped * self.period_s
            self._count += skipped
            self._signal.forget()
        while self._next_s <= now_s:
            yield self._next_s, self._make(self._next_s)
            self._next_s += self.period_s

    def _make(self, t_s: float) -> bytes:
        values = self._signal.sample(t_s, self._accel_filter, self._gyro_filter)
        if self.hung:
            return self._last
        if self.saturated:
            return SATURATED
        counts = (lsb * (value + more) for lsb, value, more in zip(self._lsb, values, self._self_test, strict=True))
        sample = SAMPLE.pack(*map(_cut, counts))
        if self._count % self._accel_every:
            sample = self._last[:6] + sample[6:]
        self._count += 1
        self._last = sample
        return sample


def _cut(counts: float) -> int:
    """Nearest 16-bit count; saturates at the ends."""
    return round(counts) if -32768.0 < counts < 32767.0 else (32767 if counts > 0.0 else -32768)


def _self_test(accel_switches: int, gyro_switches: int) -> tuple[float, ...]:
    """Addition by the self test [m/s^2, rad/s]: the response of the factory codes (eMD: 2620 * 1.01^(code-1))."""
    responses = [(axis, 2620.0 * 1.01 ** (code - 1)) for axis, code in zip((4, 2, 1), SELF_TEST_CODES, strict=True)]
    accel = (one / ACCEL_LSB_PER_G[0] * GRAVITY_mps2 if accel_switches & axis else 0.0 for axis, one in responses)
    gyro = (one / GYRO_LSB_PER_DPS[0] * DPS if gyro_switches & axis else 0.0 for axis, one in responses)
    return (*accel, *gyro)
