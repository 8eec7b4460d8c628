"""Supply voltage for the allocation: measured while a battery sensor is heard, else nominal.

Pure: measurements are events, time is an argument. The age of a voltage counts from its arrival, whatever its
sensor's clock says.
"""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob

PLAUSIBLE = (0.25, 2.0)
"""Plausible measurements, as fractions of the nominal voltage."""


@dataclass(frozen=True, slots=True)
class SupplyKnobs:
    """Validity of a measured voltage."""

    silent_s: float = knob(10.0, 0.5, 600.0, "silence after which a measured supply voltage no longer counts [s]")


class SupplyVoltage:
    """Supply voltage of one vehicle with the nominal voltage `nominal_V`."""

    def __init__(self, nominal_V: float, knobs: SupplyKnobs | None = None) -> None:
        self._nominal_V, self._knobs = nominal_V, knobs or SupplyKnobs()
        self._last: tuple[Stamp, float] | None = None

    def tune(self, knobs: SupplyKnobs) -> None:
        """Use other knobs from now on."""
        self._knobs = knobs

    def update(self, voltage_V: float, now: Stamp) -> str:
        """Set the measured voltage; returns the reason if it is implausible. Zero (an unwired sensor) is ignored."""
        if voltage_V == 0.0:
            return ""
        low, high = (part * self._nominal_V for part in PLAUSIBLE)
        if not low <= voltage_V <= high:
            return f"found {voltage_V:g} V, wanted {low:g} to {high:g} V"
        self._last = (now, round(voltage_V, 1))
        return ""

    def measured_V(self, now: Stamp) -> float | None:
        """Measured voltage, rounded to 0.1 V; None without a recent measurement."""
        if self._last is None or seconds_between(self._last[0], now) > self._knobs.silent_s:
            return None
        return self._last[1]

    def silence_warning(self, now: Stamp) -> str:
        """Warning that the battery sensor has fallen silent; else empty."""
        if self._last is None or self.measured_V(now) is not None:
            return ""
        silent_s = seconds_between(self._last[0], now)
        return f"battery sensor silent for {silent_s:.0f} s: reckoning with {self._nominal_V:.1f} V"

    def status_text(self, now: Stamp) -> str:
        """Voltage in use and its origin, for the operator."""
        measured_V = self.measured_V(now)
        if measured_V is not None:
            return f"{measured_V:.1f} (measured)"
        why = "no battery sensor" if self._last is None else "the battery sensor is silent"
        return f"{self._nominal_V:.1f} (assumed, {why})"
