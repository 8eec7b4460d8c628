"""The line that enables the outputs of a PCA9685 (OE, active low), by libgpiod 2 where a vehicle has one.

Pull the line up: then the outputs are off until software enables them, and off again when the process that held the
line has died. A retriggerable timer between line and OE needs a pulse at least every 0.3 s: then the outputs are off
also when the process is frozen, or the computer (circuit in docs/explanation/safety.md).
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

from hindrax_core.bus_operations import DeviceError
from hindrax_core.vehicle import Output, chip_and_line
from hindrax_drivers.buses.clock import MOCK_PREFIX
from hindrax_drivers.buses.gpio import library, request_line

TRIGGER_S = 0.1


class EnableLine:
    """Enables the outputs as a whole. This one does nothing: its outputs are always enabled by their wiring."""

    def set(self, *, enabled: bool) -> None:
        """Enable or disable the outputs."""

    def written(self) -> None:
        """Take note that pulses were written: while they are, the outputs stay enabled."""

    def close(self) -> None:
        """Give the line back."""


class GpioLine(EnableLine):
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


class TimedLine(GpioLine):
    """A line that triggers a timer: one low pulse for each write while the outputs are enabled."""

    _enabled = False

    def set(self, *, enabled: bool) -> None:
        """Begin or end the pulses; without them the timer disables the outputs."""
        self._enabled = enabled
        self.written()

    def written(self) -> None:
        """Trigger the timer."""
        if self._enabled:
            self._request.set_value(self._line, self._value.ACTIVE)
            self._request.set_value(self._line, self._value.INACTIVE)


@contextlib.contextmanager
def outputs_enabled(output: Output, port: str) -> Iterator[None]:
    """Enable the outputs for a while; a timer behind the line is triggered as long as this process runs."""
    over = threading.Event()
    with contextlib.closing(open_enable_line(output, port)) as line:

        def trigger() -> None:
            while not over.wait(TRIGGER_S):
                line.written()

        line.set(enabled=True)
        thread = threading.Thread(target=trigger)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()
            line.set(enabled=False)


def open_enable_line(output: Output, port: str) -> EnableLine:
    """Open the line of an output; it has none in mock. DeviceError says what is wrong and the remedy."""
    if not output.enable_line or port.startswith(MOCK_PREFIX):
        return EnableLine()
    try:
        chip, line = chip_and_line(output.enable_line, "output.enable_line")
        return (TimedLine if output.enable_timer else GpioLine)(chip, line)
    except ValueError as error:
        raise DeviceError(str(error)) from error
