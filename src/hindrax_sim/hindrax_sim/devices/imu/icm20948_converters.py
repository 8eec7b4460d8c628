"""Sample clock, filters, scales and self test of the ICM-20948. Source: TDK DS-000189 r1.3, bank 2, tables 1 and 2."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from hindrax_core.vehicle import GRAVITY_mps2
from hindrax_sim.devices.imu.imu_signal import ImuSignal, LowPass

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
"""Samples that are made up for when nobody has looked for long: more than the FIFO holds."""

SAMPLE = struct.Struct(">6h")
SATURATED = SAMPLE.pack(32767, -32768, 32767, -32768, 32767, -32768)


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
    """What the self test adds [m/s^2, rad/s]: the response that the factory codes tell (eMD: 2620 * 1.01^(code-1))."""
    responses = [(axis, 2620.0 * 1.01 ** (code - 1)) for axis, code in zip((4, 2, 1), SELF_TEST_CODES, strict=True)]
    accel = (one / ACCEL_LSB_PER_G[0] * GRAVITY_mps2 if accel_switches & axis else 0.0 for axis, one in responses)
    gyro = (one / GYRO_LSB_PER_DPS[0] * DPS if gyro_switches & axis else 0.0 for axis, one in responses)
    return (*accel, *gyro)
