"""TI INA226: supply voltage and current by a shunt. Source: TI SBOS547 (June 2011), pages and tables named below.

The current is that of the shunt by Ohm's law; the chip's own current register is not needed (page 15, "simple current
shunt monitor"). One conversion is read twice, because nothing on this bus has a checksum and a current may leap.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import Pause, Program, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped, after
from hindrax_core.knobs import knob
from hindrax_core.readings import Battery, Reading
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.driver import Driver, RegisterPart

ADDRESS = 0x41
"""The chip's default is 0x40, which a PCA9685 has: bridge A0 to VS."""
CONFIGURATION, SHUNT, BUS, MASK_ENABLE, MANUFACTURER, DIE = 0x00, 0x01, 0x02, 0x06, 0xFE, 0xFF
IDENTITY, DIE_IDENTITY = 0x5449, 0x226
RESET = 0x8000
TRIGGERED = 0x4523
"""16 averages of 1.1 ms, shunt and bus voltage, once per order. Tables 6 to 9, pages 18 and 19."""
CONVERSION_S = 0.0393
"""Longest: 16 averages of two conversions of 1.21 ms, page 5, and a reserve for the oscillator."""
READY = 0x0008
V_PER_COUNT, SHUNT_V_PER_COUNT = 1.25e-3, 2.5e-6
"""Of the signed registers. Table 1, page 16."""
END_OF_SCALE = 0x7FFF


@dataclass(frozen=True, slots=True)
class Ina226Knobs:
    """Measurement of the supply."""

    period_s: float = knob(0.1, 0.05, 10.0, "time between two readings [s]")
    shunt_ohm: float = knob(0.0005, 1e-5, 1.0, "resistance of the shunt [ohm]")
    reversed: bool = knob(False, meaning="the shunt is wired in reverse")


class Ina226(RegisterPart):
    """The sensor at an address (0x41 where none is named)."""

    def __init__(self, knobs: Ina226Knobs, address: int | None = None) -> None:
        super().__init__(address, ADDRESS)
        self._knobs, self.period_s = knobs, knobs.period_s
        self._shunt_ohm = -knobs.shunt_ohm if knobs.reversed else knobs.shunt_ohm

    def configure(self) -> Program[Identity]:
        """Identify and reset."""
        maker = yield from self.word(MANUFACTURER)
        die = yield from self.word(DIE)
        if (maker, die >> 4) != (IDENTITY, DIE_IDENTITY):
            raise self.error(f"found ids {maker:#06x} {die:#06x}, wanted 0x5449 0x226x (INA226)")
        yield self._set(RESET)
        return Identity(f"INA226 at {self.address:#04x}, shunt {self._knobs.shunt_ohm * 1e3:g} mohm")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Convert once and read twice; the stamp is the middle of the conversion."""
        yield self._set(TRIGGERED)
        yield Pause(CONVERSION_S, max(0.0, self._knobs.period_s - CONVERSION_S))
        mask = yield from self.word(MASK_ENABLE)
        settings = yield from self.word(CONFIGURATION)
        if settings != TRIGGERED:
            raise self.error(f"lost its settings: found {settings:#06x}, wanted {TRIGGERED:#06x}")
        if not mask & READY:
            raise self.error(f"no conversion in {CONVERSION_S:g} s")
        raw, valid = b"", after(stamp, 0.5 * CONVERSION_S)
        for register in (SHUNT, BUS, SHUNT, BUS):
            raw += yield self.get(register, 2)
        shunt, bus = struct.unpack_from(">2h", raw)
        if raw[:4] != raw[4:]:
            return [Rejected(valid, reject(RejectCode.TWO_DIFFER), raw)]
        if abs(shunt) >= END_OF_SCALE or not 0 <= bus < END_OF_SCALE:
            return [Rejected(valid, reject(RejectCode.END_OF_SCALE), raw[:4])]
        return [Stamped(valid, Battery(bus * V_PER_COUNT, shunt * SHUNT_V_PER_COUNT / self._shunt_ohm))]

    def _set(self, value: int) -> Write:
        return self.set(CONFIGURATION, *value.to_bytes(2, "big"))


DRIVER = Driver(Ina226Knobs, lambda knobs, mount, _vehicle: Ina226(knobs, mount.address))
