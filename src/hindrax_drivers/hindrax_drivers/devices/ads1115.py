"""TI ADS1115 behind a power sense module: supply voltage and current. Source: TI SBAS444E (2018), pages below.

Gains of a Blue Robotics Power Sense Module, as ArduSub has them: 11 V per volt; 37.8788 A per volt above 0.33 V. The
channels are those of a Blue Robotics Navigator. Nothing here has a checksum: a conversion is read twice.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import Pause, Program
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped, after
from hindrax_core.knobs import knob
from hindrax_core.readings import Battery, Reading
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.driver import Driver, RegisterPart

ADDRESS = 0x48
CONVERSION, CONFIGURATION, LOW_THRESHOLD = 0x00, 0x01, 0x02
IDLE, SINGLE_4096_mV_128_Hz = 0x8000, 0x4383
"""Single shot of one channel against ground, 4.096 V, 128 a second, no comparator. Table 8, page 28."""
CONVERSION_S = 0.0090
"""1/128 s, the oscillator's 10 % (page 8), and 30 us to wake."""
V_PER_COUNT = 125e-6
"""Table 3, page 17."""
END_OF_SCALE = 0x7FFF
THRESHOLDS_AT_RESET = (0x8000, 0x7FFF)
"""Table 9, page 29: the part has no register of identity, but nothing else has these."""


@dataclass(frozen=True, slots=True)
class Ads1115Knobs:
    """Wiring and scale of the power sense module."""

    period_s: float = knob(0.1, 0.03, 10.0, "time between two readings [s]")
    voltage_channel: int = knob(3, 0, 3, "input with the divided supply voltage [-]")
    current_channel: int = knob(2, 0, 3, "input with the current [-]")
    volt_per_volt: float = knob(11.0, 1.0, 1000.0, "supply voltage per volt at the input [V/V]")
    ampere_per_volt: float = knob(37.8788, 0.01, 1e4, "current per volt at the input [A/V]")
    zero_current_V: float = knob(0.33, -4.0, 4.0, "voltage at the input without current [V]")


class Ads1115(RegisterPart):
    """The converter at an address (0x48 where none is named)."""

    def __init__(self, knobs: Ads1115Knobs, address: int | None = None) -> None:
        super().__init__(address, ADDRESS)
        self._knobs, self.period_s = knobs, knobs.period_s

    def configure(self) -> Program[Identity]:
        """Read the thresholds, the only registers that identify the part."""
        found = (yield from self.word(LOW_THRESHOLD)), (yield from self.word(LOW_THRESHOLD + 1))
        if found != THRESHOLDS_AT_RESET:
            raise self.error(f"found thresholds {found[0]:#06x} {found[1]:#06x}, wanted 0x8000 0x7fff (ADS1115)")
        knobs = self._knobs
        inputs = f"voltage at AIN{knobs.voltage_channel}, current at AIN{knobs.current_channel}"
        return Identity(f"ADS1115 at {self.address:#04x}, {inputs}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Convert voltage and current; the stamp is between the two."""
        knobs = self._knobs
        raw = (yield from self._convert(knobs.voltage_channel)) + (yield from self._convert(knobs.current_channel))
        voltage, voltage_again, current, current_again = struct.unpack(">4h", raw)
        valid = after(stamp, CONVERSION_S)
        if (voltage, current) != (voltage_again, current_again):
            return [Rejected(valid, reject(RejectCode.TWO_DIFFER), raw)]
        if max(voltage, current) >= END_OF_SCALE:
            return [Rejected(valid, reject(RejectCode.END_OF_SCALE), raw)]
        volts, amperes = voltage * V_PER_COUNT, current * V_PER_COUNT
        current_A = (amperes - knobs.zero_current_V) * knobs.ampere_per_volt
        return [Stamped(valid, Battery(volts * knobs.volt_per_volt, current_A))]

    def _convert(self, channel: int) -> Program[bytes]:
        """One conversion, read twice."""
        wanted = SINGLE_4096_mV_128_Hz | channel << 12
        yield self.set(CONFIGURATION, *(IDLE | wanted).to_bytes(2, "big"))
        yield Pause(CONVERSION_S)
        found = yield from self.word(CONFIGURATION)
        if found != IDLE | wanted:
            raise self.error(f"found settings {found:#06x}, wanted {IDLE | wanted:#06x}: not done, or lost")
        return (yield self.get(CONVERSION, 2)) + (yield self.get(CONVERSION, 2))


DRIVER = Driver(Ads1115Knobs, lambda knobs, mount, _vehicle: Ads1115(knobs, mount.address))
