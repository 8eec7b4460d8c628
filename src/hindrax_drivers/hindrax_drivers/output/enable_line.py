"""The line that enables the outputs of a PCA9685 (OE, active low), by libgpiod 2 where a vehicle has one.

Pull the line up: then the outputs are off until software enables them, and off again when the process that held the
line has died.
"""

from __future__ import annotations

from typing import Protocol

from hindrax_core.bus_operations import DeviceError
from hindrax_core.vehicle import chip_and_line
from hindrax_drivers.buses.gpio import library, request_line


class EnableLine(Protocol):
    """Enables the outputs as a whole."""

    def set(self, *, enabled: bool) -> None:
        """Enable or disable the outputs."""

    def close(self) -> None:
        """Give the line back."""


class NoLine:
    """An output that is always enabled by its wiring."""

    def set(self, *, enabled: bool) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class GpioLine:
    """One line of a chip, found by the label or name of the chip."""

    def __init__(self, chip: str, line: int) -> None:
        self._value, self._line = library().line.Value, line
        self._request = request_line(
            chip,
            line,
            direction=library().line.Direction.OUTPUT,
            active_low=True,
            output_value=self._value.INACTIVE,
        )

    def set(self, *, enabled: bool) -> None:
        """Low enables."""
        self._request.set_value(self._line, self._value.ACTIVE if enabled else self._value.INACTIVE)

    def close(self) -> None:
        """Give the line back."""
        self._request.release()


def open_enable_line(name: str) -> EnableLine:
    """Open "CHIP:LINE"; an empty name is no line at all. DeviceError says what is wrong and the remedy."""
    if not name:
        return NoLine()
    try:
        return GpioLine(*chip_and_line(name, "output.enable_line"))
    except ValueError as error:
        raise DeviceError(str(error)) from error
