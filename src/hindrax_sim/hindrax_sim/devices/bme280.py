"""Bosch BME280 as a register model. Source: Bosch BST-BME280-DS002-15 rev 1.6.

Truth goes in as pressure, temperature and humidity; the counts that come out are found by the integer compensation of
section 4.2.3 (pages 25 and 26), backwards: the formulas are those of the datasheet, shift by shift, since a driver has
to agree with them to the last bit, and no closed form inverts integer arithmetic. Each is monotone in its count, so a
search by halves finds the count in twenty steps. Names of constants are the datasheet's: T, P and H for dig_T1 and so
on.
"""

import math
import struct
from bisect import bisect_left

from hindrax_core.readings import Air
from hindrax_sim.devices.emulator import Emulator, Part

CALIBRATION, CHIP_ID, RESET, CALIBRATION_H, CTRL_HUM, STATUS, CTRL_MEAS, CONFIG, DATA = (
    *(0x88, 0xD0, 0xE0, 0xE1, 0xF2),
    *(0xF3, 0xF4, 0xF5, 0xF7),
)
BME280, BMP180 = 0x60, 0x55
START_UP_S = 0.002
SKIPPED_20, SKIPPED_16 = 0x80000, 0x8000
NOISE_Pa, NOISE_C, NOISE_PERCENT = 1.6, 0.004, 0.02
"""Pages 12 and 13, tables 2 to 4: RMS noise without filter, at medium oversampling."""
T = (27504, 26435, -1000)
P = (36477, -10685, 3024, 2855, 140, -7, 15500, -14600, 6000)
"""The example of BST-BMP280-DS001-11, section 3.12."""
H = (75, 362, 0, 313, 50, 30)
LOW = struct.pack("<H2hH8hxB", *T, *P, H[0])
HIGH = struct.pack("<hBbBbb", *H[1:3], H[3] >> 4, (H[3] & 15) | (H[4] & 15) << 4, H[4] >> 4, H[5])
"""Registers 0x88 to 0xA1, and 0xE1 to 0xE7, where H4 and H5 share a byte (table 16)."""
TIMES = (0, 1, 2, 4, 8, 16, 16, 16)
"""Oversampling by its setting."""


class Bme280(Part[Air]):
    """One part, asleep until a measurement is wanted. Disguised, it is a BMP180; what saturates is the pressure."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__(Air(101_325.0, 30.0, 0.4), f"bme280 {seed}")
        self._data = bytes(8)
        self.power_cycle(0.0)

    def write(self, data: bytes, now_s: float) -> None:
        """Pairs of register and value; the first byte alone is what a read starts from."""
        self._pointer = data[0]
        for register, value in zip(data[::2], data[1::2], strict=False):
            self._set(register, value, now_s)

    def read(self, count: int, now_s: float) -> bytes:
        """Bytes from the register on."""
        self._finish(now_s)
        low = LOW if now_s >= self._awake_s else bytes(26)
        registers: dict[int, int] = {}
        for at, block in ((CALIBRATION, low), (CALIBRATION_H, HIGH), (DATA, self._data)):
            registers |= dict(enumerate(block, at))
        registers |= {CHIP_ID: BMP180 if self._disguised else BME280, CONFIG: self._config}
        registers |= {CTRL_HUM: self._ctrl_hum, CTRL_MEAS: self._ctrl_meas}
        registers[STATUS] = 0x08 * (now_s < self._done_s) + 0x01 * (now_s < self._awake_s)
        return bytes(registers.get(self._pointer + index, 0) for index in range(count))

    def _set(self, register: int, value: int, now_s: float) -> None:
        if register == RESET and value == 0xB6:
            self.power_cycle(now_s)
        elif register == CTRL_HUM:
            self._ctrl_hum = value & 0x07
        elif register == CONFIG:
            self._config = value
        elif register == CTRL_MEAS:
            self._ctrl_meas, self._osrs_h = value, self._ctrl_hum
            if value & 3:
                self._done_s, self._waiting = now_s + self._measurement_s(), True

    def _measurement_s(self) -> float:
        """Typical duration, section 9.1."""
        t, p, h = (TIMES[bits & 7] for bits in (self._ctrl_meas >> 5, self._ctrl_meas >> 2, self._osrs_h))
        return 1e-3 * (1.0 + 2.0 * t + (2.0 * p + 0.5 if p else 0.0) + (2.0 * h + 0.5 if h else 0.0))

    def _finish(self, now_s: float) -> None:
        """Put the finished measurement into the registers; forced mode falls asleep, normal mode goes on."""
        if not self._waiting or now_s < self._done_s:
            return
        normal = self._ctrl_meas & 3 == 3
        self._waiting = normal
        if normal:
            self._done_s = now_s + self._measurement_s()
        else:
            self._ctrl_meas &= ~3
        if not self._hung:
            self._data = self._measured()

    def _measured(self) -> bytes:
        """Eight bytes of data: temperature first, since both others are compensated by its `fine` value (t_fine).

        Pressure falls as its count grows, so the search runs over the count from the top down.
        """
        noise, truth = self._draw.gauss, self._truth
        top, celsius = 1 << 20, truth.temperature_C + noise(0.0, NOISE_C)
        t = bisect_left(range(top - 1), celsius, key=lambda raw: _fine(raw) * 5 / 25600)
        fine, pascals = _fine(t), truth.pressure_Pa + noise(0.0, NOISE_Pa)
        p = top - bisect_left(range(top - 1), pascals, key=lambda raw: _pressure_Pa(top - raw, fine))
        percent = 100.0 * truth.humidity + noise(0.0, NOISE_PERCENT)
        h = bisect_left(range(0xFFFF), percent, key=lambda raw: _percent(raw, fine))
        if self._saturated:
            p = 0
        t = t if self._ctrl_meas >> 5 else SKIPPED_20
        p = p if self._ctrl_meas >> 2 & 7 else SKIPPED_20
        h = h if self._osrs_h else SKIPPED_16
        return (p << 4).to_bytes(3, "big") + (t << 4).to_bytes(3, "big") + h.to_bytes(2, "big")

    def power_cycle(self, now_s: float) -> None:
        """Fault, and power-up: settings are lost, the calibration is loaded again."""
        self._pointer = self._ctrl_hum = self._osrs_h = self._ctrl_meas = self._config = 0
        self._waiting, self._done_s, self._awake_s = False, now_s, now_s + 0.9 * START_UP_S


def _fine(raw: int) -> int:
    """t_fine, temperature in 1/5120 degree; the datasheet's BME280_compensate_T_int32."""
    t1, t2, t3 = T
    first = ((raw >> 3) - (t1 << 1)) * t2 >> 11
    return first + ((((raw >> 4) - t1) ** 2 >> 12) * t3 >> 14)


def _pressure_Pa(raw: int, fine: int) -> float:
    """BME280_compensate_P_int64, whose result is in 1/256 Pa."""
    p1, p2, p3, p4, p5, p6, p7, p8, p9 = P
    one = fine - 128000
    two = one * one * p6 + (one * p5 << 17) + (p4 << 35)
    one = ((1 << 47) + (one * one * p3 >> 8) + (one * p2 << 12)) * p1 >> 33
    p = (((1048576 - raw) << 31) - two) * 3125 // one
    return ((p + (p9 * (p >> 13) * (p >> 13) >> 25) + (p8 * p >> 19) >> 8) + (p7 << 4)) / 256.0


def _percent(raw: int, fine: int) -> float:
    """bme280_compensate_H_int32, whose result is in 1/1024 %."""
    h1, h2, h3, h4, h5, h6 = H
    v = fine - 76800
    gain = ((((v * h6 >> 10) * ((v * h3 >> 11) + 32768) >> 10) + 2097152) * h2 + 8192) >> 14
    v = ((raw << 14) - (h4 << 20) - h5 * v + 16384 >> 15) * gain
    v -= ((v >> 15) * (v >> 15) >> 7) * h1 >> 4
    return min(100.0, max(0.0, (v >> 12) / 1024.0))


def _agrees(truth: Air, reading: Air) -> bool:
    """Noise is some pascals; the rest is corruption too small to be distinguished from weather."""
    near = abs(reading.pressure_Pa - truth.pressure_Pa) < 400.0 and abs(reading.humidity - truth.humidity) < 0.08
    return near and bool(abs(reading.temperature_C - truth.temperature_C) < 1.5)


EMULATOR = Emulator(
    Bme280,
    truth=lambda world, _at: Air(101_325.0, 30.0, 0.9 if world.water_in_hull else 0.4),
    example=lambda seconds: Air(101_325.0 - 50.0 * math.sin(0.1 * seconds), 30.0 + 0.02 * seconds, 0.4),
    agrees=_agrees,
)
