"""TI ADS1115 as a register model, behind a Blue Robotics Power Sense Module. Source: TI SBAS444E, section 9.6."""

import math

from hindrax_core.readings import Battery
from hindrax_sim.devices.emulator import Emulator, Part
from hindrax_sim.devices.ina226 import EMULATOR as SUPPLY

CONVERSION, CONFIGURATION, LOW, HIGH = range(4)
FULL_SCALE_V = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256, 0.256, 0.256)
RATE_Hz = (8, 16, 32, 64, 128, 250, 475, 860)
NOISE_V = 60e-6
AT_RESET = (0, 0x8583, 0x8000, 0x7FFF)
V_PER_V, A_PER_V, ZERO_V = 11.0, 37.8788, 0.33


class Ads1115(Part[Battery]):
    """One converter, with the module's current at AIN2 and its voltage at AIN3. Hung, its conversions never end."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__(Battery(14.8, 0.0), f"ads1115 {seed}")
        self.power_cycle(0.0)

    def power_cycle(self, _now_s: float) -> None:
        """Fault, and power-up: all registers as in the data sheet."""
        self._pointer, self._words = 0, list(AT_RESET)
        self._done_s = math.inf

    def write(self, data: bytes, now_s: float) -> None:
        """The register, and perhaps its two bytes; a configuration with OS starts a conversion."""
        self._pointer = data[0] & 3
        if len(data) < 3 or self._pointer == CONVERSION:
            return
        self._words[self._pointer] = int.from_bytes(data[1:3], "big")
        if self._pointer == CONFIGURATION and (data[1] & 0x80 or not data[1] & 1):
            self._begin(now_s, self._words[CONFIGURATION])

    def read(self, count: int, now_s: float) -> bytes:
        """The register last pointed at; OS is set while no conversion runs."""
        self._finish(now_s)
        found = self._words[self._pointer]
        if self._pointer == CONFIGURATION:
            found = found & 0x7FFF | (0x8000 if self._done_s == math.inf else 0)
        if self._disguised:
            found ^= 0x0A0A
        return found.to_bytes(2, "big")[:count].ljust(count, b"\xff")

    def _finish(self, now_s: float) -> None:
        if now_s < self._done_s or self._hung:
            return
        volts = self._volts(self._asked >> 12 & 7) + self._draw.gauss(0.0, NOISE_V)
        counts = 0x7FFF if self._saturated else round(volts / FULL_SCALE_V[self._asked >> 9 & 7] * 0x8000)
        self._words[CONVERSION] = max(-0x8000, min(0x7FFF, counts)) & 0xFFFF
        self._done_s = math.inf
        if not self._asked & 0x0100:
            self._begin(now_s, self._asked)

    def _begin(self, now_s: float, asked: int) -> None:
        self._asked = asked
        self._done_s = now_s + 1.0 / RATE_Hz[asked >> 5 & 7]

    def _volts(self, multiplexer: int) -> float:
        inputs = (0.0, 0.0, ZERO_V + self._truth.current_A / A_PER_V, self._truth.voltage_V / V_PER_V)
        plus, minus = ((0, 1), (0, 3), (1, 3), (2, 3), (0, None), (1, None), (2, None), (3, None))[multiplexer]
        return inputs[plus] - (0.0 if minus is None else inputs[minus])


EMULATOR = Emulator(Ads1115, SUPPLY.truth, SUPPLY.example, SUPPLY.agrees)
"""Its noise is a count, a millivolt and a half and five milliamperes: well within what the other one may be off."""
