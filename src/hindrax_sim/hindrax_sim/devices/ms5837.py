"""MS5837-30BA and -02BA as command models: PROM, conversions that take their time, an ADC that must not be hurried.

Truth goes in as pressure and temperature; the conversions that come out are the inverse of the datasheet's
compensation. Sources: TE MS5837-30BA rev C2 pages 7, 9, 11; MS5837-02BA pages 6, 7, 9.
"""

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal

from hindrax_core.readings import Pressure
from hindrax_sim.devices.emulator import Emulator, Part

RESET, PROM_FIRST, PROM_LAST, ADC_READ = 0x1E, 0xA0, 0xAE, 0x00
D1_FIRST, D2_LAST = 0x40, 0x5A
RELOAD_S = 0.0028
CONVERSION_S_PER_SAMPLE = 2.2e-6
FULL_SCALE = 0xFFFFFF

NOISE_Pa = {"30BA": (157.0, 84.0, 54.0, 38.0, 28.0, 20.0), "02BA": (11.0, 6.2, 4.2, 3.2, 2.2, 1.6)}
"""Datasheet, pressure output characteristics: resolution RMS at oversampling 256 to 8192."""
NOISE_C = 0.002

PROM_30BA = (0x9340, 0x88A6, 0x8E00, 0x4F68, 0x5752, 0x6816, 0x6622)
"""Calibration of the datasheet's example (C1 34982 ... C6 26146), product number 30BA26, with its checksum."""
PROM_02BA = (0x52A0, 0xB524, 0xABCD, 0x7183, 0x6CC2, 0x7B41, 0x6E05)
"""Calibration of the datasheet's example (C1 46372 ... C6 28165), product number 02BA21."""
OTHER_PROM = (0x1234, 0x5678, 0x9ABC, 0xDEF0, 0x1357, 0x9BDF, 0x2468, 0xACE0)


@dataclass(frozen=True, slots=True)
class _Conversion:
    begin_s: float
    end_s: float
    value: int


class Ms5837(Part[Pressure]):
    """One part at 0x76. `noise` scales the noise of the datasheet. Disguised, its memory is no MS5837's."""

    def __init__(self, model: Literal["30BA", "02BA"] = "30BA", seed: int = 0, noise: float = 1.0) -> None:
        super().__init__(Pressure(101_325.0, 20.0), f"ms5837 {seed}")
        self.prom: tuple[int, ...] = PROM_30BA if model == "30BA" else PROM_02BA
        self._model, self._noise = model, noise
        self._held = {0: 0, 1: 0}
        self._solved = (math.nan, 0)
        self.power_cycle(0.0)

    def power_cycle(self, now_s: float) -> None:
        """Clear command and conversion; reload the PROM."""
        self._command = -1
        self._conversion: _Conversion | None = None
        self._loaded_s = now_s + RELOAD_S

    def write(self, data: bytes, now_s: float) -> None:
        """One command byte. A command during a conversion spoils it, and is itself ignored."""
        if not data:
            return
        command, running = data[0], self._conversion
        if command == RESET:
            self.power_cycle(now_s)
        elif running is not None and running.begin_s <= now_s < running.end_s and command != ADC_READ:
            self._conversion = None
        elif command in range(D1_FIRST, D2_LAST + 1, 2):
            self._convert(command, now_s)
        self._command = command

    def read(self, count: int, now_s: float) -> bytes:
        """Answer to the last command; nothing but zeros without one."""
        if self._command == ADC_READ:
            # Zero when it is read early, which spoils it, or twice.
            conversion, self._conversion = self._conversion, None
            value = conversion.value if conversion is not None and now_s >= conversion.end_s else 0
            return value.to_bytes(3, "big")[:count].ljust(count, b"\0")
        if PROM_FIRST <= self._command <= PROM_LAST and now_s >= self._loaded_s:
            words = OTHER_PROM if self._disguised else (*self.prom, 0)
            word = words[(self._command - PROM_FIRST) // 2]
            return word.to_bytes(2, "big")[:count].ljust(count, b"\0")
        return bytes(count)

    def _convert(self, command: int, now_s: float) -> None:
        kind, osr = command >> 4 & 1, (command & 0x0F) >> 1
        if not self._hung or not self._held[kind]:
            self._held[kind] = self._made(kind, osr)
        duration_s = CONVERSION_S_PER_SAMPLE * (256 << osr)
        value = FULL_SCALE if self._saturated and not kind else self._held[kind]
        self._conversion = _Conversion(now_s, now_s + duration_s, value)

    # ---- the datasheet's compensation, backwards

    def _made(self, kind: int, osr: int) -> int:
        """Temperature conversion, or pressure conversion at the true temperature, in the middle of its step."""
        if kind:
            lsb_C = self.prom[6] / (1 << 23) / 100.0
            return _clip(self._ideal_d2() + self._noise * NOISE_C / lsb_C * self._draw.gauss(0.0, 1.0))
        noise_Pa = self._noise * NOISE_Pa[self._model][osr] * self._draw.gauss(0.0, 1.0)
        step_Pa, shift = (10.0, 13) if self._model == "30BA" else (1.0, 15)
        _, offset, sensitivity = _forward(self._model, self.prom, self._ideal_d2())
        pressure = (self._truth.pressure_Pa + noise_Pa) / step_Pa + 0.5
        return _clip((pressure * (1 << shift) + offset) * (1 << 21) / sensitivity)

    def _ideal_d2(self) -> int:
        """D2 whose compensated temperature is the truth: as far into the step of 0.01 C as the truth is."""
        celsius = self._truth.temperature_C
        if celsius != self._solved[0]:
            wanted = celsius * 100.0 + 0.5
            low, high = self._lowest_d2(math.floor(wanted)), self._lowest_d2(math.floor(wanted) + 1)
            self._solved = (celsius, round(low + (wanted % 1.0) * (high - 1 - low)))
        return self._solved[1]

    def _lowest_d2(self, temperature: int) -> int:
        """Lowest D2 that gives at least this temperature [0.01 C]."""
        return bisect_left(range(FULL_SCALE), temperature, key=lambda d2: _forward(self._model, self.prom, d2)[0])


def _forward(model: str, prom: tuple[int, ...], d2: int) -> tuple[int, int, int]:
    """Temperature [0.01 C], OFF2 and SENS2 as the datasheets compute them, in integers."""
    _, c1, c2, c3, c4, c5, c6 = prom[:7]
    dt = d2 - c5 * 2**8
    first = 2000 + dt * c6 // 2**23
    below, far_below = first - 2000, first + 1500
    ti = offset_i = sensitivity_i = 0
    if model == "02BA":
        offset, sensitivity = c2 * 2**17 + c4 * dt // 2**6, c1 * 2**16 + c3 * dt // 2**7
        if below < 0:
            ti, offset_i, sensitivity_i = 11 * dt**2 // 2**35, 31 * below**2 // 2**3, 63 * below**2 // 2**5
        return first - ti, offset - offset_i, sensitivity - sensitivity_i
    offset, sensitivity = c2 * 2**16 + c4 * dt // 2**7, c1 * 2**15 + c3 * dt // 2**8
    if below >= 0:
        ti, offset_i = 2 * dt**2 // 2**37, below**2 // 2**4
    else:
        ti, offset_i, sensitivity_i = 3 * dt**2 // 2**33, 3 * below**2 // 2, 5 * below**2 // 2**3
        if far_below < 0:
            offset_i, sensitivity_i = offset_i + 7 * far_below**2, sensitivity_i + 4 * far_below**2
    return first - ti, offset - offset_i, sensitivity - sensitivity_i


def _clip(value: float) -> int:
    return max(1, min(FULL_SCALE, round(value)))


def _agrees(truth: Pressure, reading: Pressure) -> bool:
    """Noise is some tens of pascals; the rest is damage that looks like a wave, and that no check can detect."""
    near = abs(reading.pressure_Pa - truth.pressure_Pa) < 1_000.0
    return near and bool(abs(reading.temperature_C - truth.temperature_C) < 2.0)


EMULATOR = Emulator(
    lambda seed: Ms5837(seed=seed),
    lambda world, at: Pressure(world.pressure_Pa(at), 24.0),
    lambda seconds: Pressure(110_000.0 + 1_500.0 * math.sin(0.3 * seconds), 24.0),
    _agrees,
    address=0x76,  # data sheet, I2C interface: 111011x with CSB
)
