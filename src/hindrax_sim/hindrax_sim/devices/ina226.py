"""TI INA226 as a register model. Source: TI SBOS547 (June 2011), register maps of pages 17 to 24."""

import math

from hindrax_core.readings import Battery
from hindrax_sim.devices.emulator import Emulator, Part

CONFIGURATION, SHUNT, BUS, POWER, CURRENT, CALIBRATION, MASK_ENABLE, LIMIT = range(8)
MANUFACTURER, DIE = 0xFE, 0xFF
INA226, INA219_LIKE = (0x5449, 0x2260), (0x0000, 0x0000)
AVERAGES = (1, 4, 16, 64, 128, 256, 512, 1024)
CONVERSION_S = (140e-6, 204e-6, 332e-6, 588e-6, 1.1e-3, 2.116e-3, 4.156e-3, 8.244e-3)
READY = 0x0008
NOISE_V, NOISE_SHUNT_V = 1e-3, 3e-6
SHUNT_ohm = 0.0005


class Ina226(Part[Battery]):
    """One part across a shunt of half a milliohm, converting all the time after power-up.

    Disguised, it has no registers of identity, as an INA219; what saturates is the current.
    """

    def __init__(self, seed: int = 0) -> None:
        super().__init__(Battery(14.8, 0.0), f"ina226 {seed}")
        self.power_cycle(0.0)

    def write(self, data: bytes, now_s: float) -> None:
        """The register, and perhaps its two bytes."""
        self._pointer, value = data[0], int.from_bytes(data[1:3], "big")
        if len(data) < 3:
            return
        if self._pointer == CONFIGURATION:
            self._configure(value, now_s)
        elif self._pointer in (CALIBRATION, MASK_ENABLE, LIMIT):
            self._words[self._pointer] = value

    def read(self, count: int, now_s: float) -> bytes:
        """The register last pointed at; reading mask and enable clears its flag of a conversion."""
        self._convert(now_s)
        ids = INA219_LIKE if self._disguised else INA226
        known = self._words | {MANUFACTURER: ids[0], DIE: ids[1]}
        found = known.get(self._pointer, 0)
        if self._pointer == MASK_ENABLE:
            self._words[MASK_ENABLE] &= ~READY
        return found.to_bytes(2, "big")[:count].ljust(count, b"\xff")

    def _configure(self, value: int, now_s: float) -> None:
        if value & 0x8000:
            self.power_cycle(now_s)
            return
        self._words[CONFIGURATION] = value & 0x0FFF | 0x4000
        self._words[MASK_ENABLE] &= ~READY
        self._begin(now_s)

    def _begin(self, now_s: float) -> None:
        word = self._words[CONFIGURATION]
        kinds = (word & 2) // 2 * CONVERSION_S[word >> 6 & 7] + (word & 1) * CONVERSION_S[word >> 3 & 7]
        self._done_s = now_s + AVERAGES[word >> 9 & 7] * kinds if kinds else math.inf

    def _convert(self, now_s: float) -> None:
        if now_s < self._done_s or self._hung:
            return
        word = self._words[CONFIGURATION]
        if word & 1:
            volts = self._truth.current_A * SHUNT_ohm + self._draw.gauss(0.0, NOISE_SHUNT_V)
            shunt = 0x7FFF if self._saturated else max(-0x8000, min(0x7FFF, round(volts / 2.5e-6)))
            self._words[SHUNT] = shunt & 0xFFFF
            self._words[CURRENT] = shunt * self._words[CALIBRATION] // 2048 & 0xFFFF
        if word & 2:
            volts = self._truth.voltage_V + self._draw.gauss(0.0, NOISE_V)
            self._words[BUS] = max(0, min(0x7FFF, round(volts / 1.25e-3)))
        current = self._words[CURRENT] - (self._words[CURRENT] >> 15 << 16)
        self._words[POWER] = abs(current) * self._words[BUS] // 20_000 & 0xFFFF
        self._words[MASK_ENABLE] |= READY
        self._done_s = math.inf
        if word & 4:
            self._begin(now_s)

    def power_cycle(self, now_s: float) -> None:
        """Fault, reset and power-up: all registers as in table 2."""
        self._pointer = 0
        self._words = dict.fromkeys(range(8), 0) | {CONFIGURATION: 0x4127}
        self._begin(now_s)


def _agrees(truth: Battery, reading: Battery) -> bool:
    """Noise is a millivolt and some milliamperes; the truth moves by less in a conversion."""
    off = abs(reading.voltage_V - truth.voltage_V), abs(reading.current_A - truth.current_A)
    return bool(off[0] < 0.05 and off[1] < 0.2)


EMULATOR = Emulator(
    make=Ina226,
    truth=lambda world, _at: Battery(world.supply_V, world.supply_A),
    example=lambda seconds: Battery(15.6 - 0.01 * seconds, 8.0 + 6.0 * math.sin(0.5 * seconds)),
    agrees=_agrees,
)
