"""TE TSYS01: temperature to 0.1 K. Source: TE TSYS01 data sheet, "Commands", "PROM", "Temperature polynomial"."""

from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import DeviceError, Pause, Program, Write, WriteRead
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.knobs import knob
from hindrax_core.readings import Reading, Thermal
from hindrax_drivers.driver import Driver

ADDRESS = 0x77
RESET, CONVERT, ADC_READ, PROM_READ = 0x1E, 0x48, 0x00, 0xA0
CONVERSION_S = 0.01
LIMITS_C = (-40.0, 125.0)
WORDS = 8
POWERS = (-2e-21, 4e-16, -2e-11, 1e-6, -1.5e-2)
"""Factors of k4 to k0 with falling powers of the conversion over 256."""


@dataclass(frozen=True, slots=True)
class Tsys01Knobs:
    """How the thermometer is read."""

    period_s: float = knob(0.05, 0.05, 10.0, "time between two readings [s]")
    apart_K: float = knob(0.02, 0.001, 1.0, "two conversions of a reading that differ by more are damage [K]")


def temperature_C(conversion: int, k: Sequence[int]) -> float:
    """Temperature of a conversion, by the factors k0 to k4 of the part."""
    x = conversion / 256.0
    return sum(factor * k[4 - index] * x ** (4 - index) for index, factor in enumerate(POWERS))


class Tsys01:
    """The sensor at an address (0x77 where none is named)."""

    def __init__(self, knobs: Tsys01Knobs, address: int | None) -> None:
        self._knobs, self._address = knobs, ADDRESS if address is None else address
        self._k: tuple[int, ...] = ()
        self._words: list[bytes] = []
        self._turn, self._last = 0, -1

    @property
    def period_s(self) -> float:
        """Time between the starts of two cycles."""
        return self._knobs.period_s

    def _word(self, number: int) -> WriteRead:
        return WriteRead(self._address, bytes([PROM_READ + 2 * number]), 2)

    def configure(self) -> Program[Identity]:
        """Reset, and read the factors; the sum of all bytes of the PROM ends in zero."""
        yield Write(self._address, bytes([RESET]))
        yield Pause(CONVERSION_S)
        prom = b""
        for number in range(WORDS):
            prom += yield self._word(number)
        if sum(prom) & 0xFF or not any(prom):
            raise DeviceError(f"address {self._address:#04x}: found no PROM of a TSYS01, wanted bytes that add to 0")
        self._words = [prom[at : at + 2] for at in range(0, 2 * WORDS, 2)]
        self._k = tuple(int.from_bytes(word, "big") for word in reversed(self._words[1:6]))
        return Identity(f"TSYS01 at {self._address:#04x}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Convert twice, for there is no checksum; the reading is that of the second.

        A word of the PROM in turn tells whether it is still the same part.
        """
        found, self._turn = [], (self._turn + 1) % WORDS
        if (yield self._word(self._turn)) != self._words[self._turn]:
            raise DeviceError(f"address {self._address:#04x}: its PROM has changed; it may be another part")
        for _ in range(2):
            yield Write(self._address, bytes([CONVERT]))
            yield Pause(CONVERSION_S)
            found.append(int.from_bytes((yield WriteRead(self._address, bytes([ADC_READ]), 3)), "big"))
        if 0 in found:
            return [Rejected(stamp, "no conversion")]
        first, second = (temperature_C(one, self._k) for one in found)
        last, self._last = self._last, found[1]
        if found[0] == found[1] == last:  # the noise is tens of counts
            return [Rejected(stamp, "repeated")]
        if not LIMITS_C[0] < second < LIMITS_C[1]:
            return [Rejected(stamp, "range")]
        if abs(first - second) > self._knobs.apart_K:
            return [Rejected(stamp, "two conversions differ")]
        return [Stamped(stamp, Thermal(second))]


DRIVER = Driver(Tsys01Knobs, lambda knobs, mount, _vehicle: Tsys01(knobs, mount.address))
