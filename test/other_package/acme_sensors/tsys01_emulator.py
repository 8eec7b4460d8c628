"""A TSYS01 as its data sheet describes it; the factors are those of its example."""

import math
from typing import Any

from hindrax_core.readings import Thermal
from hindrax_sim.devices.emulator import Emulator, Part

K = (40781, 32791, 36016, 24926, 28446)
"""k0 to k4."""
WORDS = (0, *reversed(K), 0x1234, 0x5600)
NOISE_K, CONVERSION_S, START_S = 0.002, 0.009, 0.003
WATER_C = 24.0


def _celsius(x: float) -> float:
    return -2e-21 * K[4] * x**4 + 4e-16 * K[3] * x**3 - 2e-11 * K[2] * x**2 + 1e-6 * K[1] * x - 1.5e-2 * K[0]


def conversion(temperature_C: float) -> int:
    """Conversion at a temperature, by bisection: the polynomial rises over the whole range."""
    low, high = 0.0, 65535.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _celsius(middle) < temperature_C else (low, middle)
    return round(256.0 * low)


class Tsys01(Part[Thermal]):
    """The part: `write` and `read` of its bus."""

    def __init__(self, seed: int) -> None:
        super().__init__(Thermal(WATER_C), f"tsys01 {seed}")
        data = b"".join(word.to_bytes(2, "big") for word in WORDS)
        self._prom = data[:-1] + bytes([-sum(data) & 0xFF])
        self._command, self._value, self._held, self._done_s, self._ready_s = 0, 0, 0, math.inf, -math.inf

    def write(self, data: bytes, now_s: float) -> None:
        """Commands are single bytes."""
        self._command = data[0] if data else self._command
        if self._command == 0x1E:
            self.power_cycle(now_s)
        elif self._command == 0x48:
            fresh = conversion(self._truth.temperature_C + self._draw.gauss(0.0, NOISE_K))
            self._held = self._held if self._hung and self._held else fresh
            self._value, self._done_s = 0xFFFFFF if self._saturated else self._held, now_s + CONVERSION_S

    def read(self, count: int, now_s: float) -> bytes:
        """Result of a conversion once, zero before it is complete; or a word of the PROM."""
        if self._command == 0x00:
            value = self._value if now_s >= self._done_s else 0
            self._done_s = math.inf
            return value.to_bytes(3, "big")[:count].ljust(count, b"\0")
        place = self._command - 0xA0
        if not 0 <= place <= 14 or now_s < self._ready_s:
            return bytes(count)
        word = self._prom[place : place + 2]
        return (bytes([word[0] ^ 0x55, word[1]]) if self._disguised else word)[:count].ljust(count, b"\0")

    def power_cycle(self, now_s: float) -> None:
        """Power-up: no conversion, and the PROM is loaded soon."""
        self._command, self._done_s, self._ready_s = 0, math.inf, now_s + START_S


def _agrees(truth: Thermal, reading: Any) -> bool:
    return bool(abs(reading.temperature_C - truth.temperature_C) < 0.1)


EMULATOR = Emulator(
    Tsys01,
    truth=lambda _world, _mounting: Thermal(WATER_C),
    example=lambda seconds: Thermal(15.0 + 3.0 * math.sin(0.05 * seconds)),
    agrees=_agrees,
    address=0x77,
)
