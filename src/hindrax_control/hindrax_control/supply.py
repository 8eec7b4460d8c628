"""The supply voltage to reckon with: the measured one while it is measured, otherwise that of the vehicle file.

Pure: measurements are events, time is an argument. A voltage is as old as its arrival, whatever its sensor's clock
says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob


@dataclass(frozen=True, slots=True)
class SupplyKnobs:
    """How long a measured voltage counts."""

    silent_s: float = knob(10.0, 0.5, 600.0, "silence after which a measured supply voltage no longer counts [s]")


class Supply:
    """Supply of one vehicle, whose file says `nominal_V`."""

    def __init__(self, nominal_V: float, knobs: SupplyKnobs | None = None) -> None:
        self._nominal_V, self._knobs = nominal_V, knobs or SupplyKnobs()
        self._last: tuple[Stamp, float] | None = None

    def hear(self, voltage_V: float, now: Stamp) -> None:
        """Take a measurement; one that is not a voltage (a sensor with nothing wired to it says zero) says nothing."""
        if math.isfinite(voltage_V) and voltage_V > 0.0:
            self._last = (now, round(voltage_V, 1))

    def measured_V(self, now: Stamp) -> float | None:
        """Voltage to a tenth of a volt; None while there is none, or none any more."""
        if self._last is None or self._silence_s(now) > self._knobs.silent_s:
            return None
        return self._last[1]

    def complaint(self, now: Stamp) -> str:
        """Say that a sensor which was there has fallen silent; empty while all is well."""
        if self._last is None or self.measured_V(now) is not None:
            return ""
        return f"battery sensor silent for {self._silence_s(now):.0f} s: reckoning with {self._nominal_V:.1f} V"

    def words(self, now: Stamp) -> str:
        """Return the voltage in force and where it comes from, for an operator."""
        measured_V = self.measured_V(now)
        if measured_V is not None:
            return f"{measured_V:.1f} (measured)"
        why = "no battery sensor" if self._last is None else "the battery sensor is silent"
        return f"{self._nominal_V:.1f} (assumed, {why})"

    def _silence_s(self, now: Stamp) -> float:
        return seconds_between(self._last[0], now) if self._last is not None else math.inf
