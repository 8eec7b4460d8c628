"""The line that enables the outputs of a PCA9685 (OE, active low), by libgpiod 2 where a vehicle has one.

Pull the line up: then the outputs are off until software enables them, and off again when the process that held the
line has died.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any, Protocol

from hindrax_core.bus_operations import DeviceError

CONSUMER = "hindrax thrusters"
DEVICES = Path("/dev")


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
    """One line of a chip that is found by its label or name, because the numbers of chips change between kernels."""

    def __init__(self, chip: str, line: int) -> None:
        self._gpiod = _gpiod()
        self._line = line
        settings = self._gpiod.LineSettings(
            direction=self._gpiod.line.Direction.OUTPUT,
            active_low=True,
            output_value=self._gpiod.line.Value.INACTIVE,
        )
        path = self._find(chip)
        try:
            self._request = self._gpiod.request_lines(path, consumer=CONSUMER, config={line: settings})
        except OSError as error:
            raise DeviceError(
                f"output.enable_line {chip}:{line}: cannot be had ({error.strerror or error}); "
                "find who uses it with `gpioinfo`, and add the user to the group gpio"
            ) from error

    def set(self, *, enabled: bool) -> None:
        """Low enables."""
        value = self._gpiod.line.Value
        self._request.set_value(self._line, value.ACTIVE if enabled else value.INACTIVE)

    def close(self) -> None:
        """Give the line back."""
        self._request.release()

    def _find(self, chip: str) -> str:
        labels = []
        for path in sorted(DEVICES.glob("gpiochip*")):
            with self._gpiod.Chip(str(path)) as opened:
                info = opened.get_info()
            if chip in (info.label, info.name, str(path)):
                return str(path)
            labels.append(info.label)
        found = ", ".join(labels) or "none"
        raise DeviceError(f"output.enable_line: found the chips {found}, wanted {chip!r}; see `gpiodetect`")


def open_enable_line(name: str) -> EnableLine:
    """Open "CHIP:LINE"; an empty name is no line at all. DeviceError says what is wrong and the remedy."""
    if not name:
        return NoLine()
    chip, _, line = name.rpartition(":")
    if not chip or not line.isdecimal():
        raise DeviceError(f"output.enable_line: found {name!r}, wanted CHIP:LINE, such as pinctrl-bcm2711:26")
    return GpioLine(chip, int(line))


def _gpiod() -> Any:
    try:
        return importlib.import_module("gpiod")
    except ImportError as error:
        raise DeviceError("output.enable_line: needs libgpiod 2 for Python; pip install 'gpiod>=2'") from error
