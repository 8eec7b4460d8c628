"""A leak probe on a GPIO line: Blue Robotics SOS, the leak input of a Navigator, or any switch.

Source: ArduSub, parameters LEAK1_LOGIC (0, its default: "low if dry") and LEAK1_PIN (27 of a Navigator).
With the line pulled towards wet, a broken cable is reported as a leak: the harmless one of the two mistakes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import DeviceError, Program, Read, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.knobs import choice, knob
from hindrax_core.readings import Leak, Reading
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.driver import Driver

LINE = 27
"""The leak input of a Navigator."""
BIASES = ("none", "pull-up", "pull-down")
RESTLESS_LOOKS = 20


@dataclass(frozen=True, slots=True)
class SosLeakKnobs:
    """Wiring and debouncing of the probe."""

    period_s: float = knob(0.1, 0.01, 1.0, "time between two samples [s]")
    wet_level: str = choice("high", ("high", "low"), "level of the line when the probe is wet")
    bias: str = choice("pull-up", BIASES, "resistor of the GPIO; towards wet, a broken cable is reported as a leak")
    looks: int = knob(5, 1, 100, "equal samples in a row before a level is accepted [-]")


class SosLeak:
    """The probe at a line of a chip (27 where none is named); see `GpioBus` for what is written and read."""

    def __init__(self, knobs: SosLeakKnobs, line: int | None = None) -> None:
        self._knobs, self._line, self.period_s = knobs, LINE if line is None else line, knobs.period_s
        self._level = self._same = self._restless = 0

    def configure(self) -> Program[Identity]:
        """Make the line an input with its bias."""
        yield Write(self._line, bytes([BIASES.index(self._knobs.bias)]))
        self._level, self._same, self._restless = -1, 0, 0
        return Identity(f"leak probe at line {self._line}, wet when {self._knobs.wet_level}, bias {self._knobs.bias}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Look; a level counts once it was the same for some looks in a row; DeviceError where it never settles."""
        raw = yield Read(self._line, 1)
        first, changed = self._level < 0, raw[0] != self._level
        self._level, self._same = raw[0], 1 if changed else self._same + 1
        if self._same >= self._knobs.looks:
            self._restless = 0
            return [Stamped(stamp, Leak((raw[0] == 1) == (self._knobs.wet_level == "high")))]
        self._restless += 1
        if self._restless > RESTLESS_LOOKS + self._knobs.looks:
            raise DeviceError(f"line {self._line}: changes all the time; a floating line, or another signal")
        return [Rejected(stamp, reject(RejectCode.CHANGED), raw)] if changed and not first else []


DRIVER = Driver(SosLeakKnobs, lambda knobs, mount, _vehicle: SosLeak(knobs, mount.address))
