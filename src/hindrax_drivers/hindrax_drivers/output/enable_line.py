"""The line that enables the outputs of a PCA9685 (OE, active low), by libgpiod 2 where a vehicle has one.

Pull the line up: then the outputs are off until software enables them, and off again when the process that held the
line has died. A retriggerable timer between line and OE needs a pulse at least every 0.3 s: then the outputs are off
also when the process is frozen, or the computer (circuit in docs/explanation/safety.md).
"""

import contextlib
import threading
from collections.abc import Iterator

from hindrax_core.vehicle import Output, chip_and_line
from hindrax_drivers.buses.clock import MOCK_PREFIX
from hindrax_drivers.buses.gpio import library, request_line

TRIGGER_S = 0.1


class EnableLine:
    """A line that enables the outputs as a whole; without a name it does nothing: their wiring always enables them.

    `timed`: it triggers a timer, by one low pulse for each write while the outputs are enabled.
    """

    def __init__(self, name: str = "", *, timed: bool = False) -> None:
        self._timed, self._enabled, self._request = timed, False, None
        if name:
            chip, self._line = chip_and_line(name, "output.enable_line")
            kind = library().line
            self._level = {True: kind.Value.ACTIVE, False: kind.Value.INACTIVE}
            off = {"direction": kind.Direction.OUTPUT, "active_low": True, "output_value": kind.Value.INACTIVE}
            self._request = request_line(chip, self._line, **off)

    def set(self, *, enabled: bool) -> None:
        """Enable (low) or disable the outputs; a timer disables them once its pulses end."""
        self._enabled = enabled
        if self._timed:
            self.written()
        else:
            self._put(active=enabled)

    def written(self) -> None:
        """Take note that pulses were written: while they are, the outputs stay enabled."""
        if self._timed and self._enabled:
            self._put(active=True)
            self._put(active=False)

    def close(self) -> None:
        """Give the line back."""
        if self._request is not None:
            self._request.release()

    def _put(self, *, active: bool) -> None:
        if self._request is not None:
            self._request.set_value(self._line, self._level[active])


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
    """Open the line of an output; it has none in mock. DeviceError with cause and remedy."""
    if not output.enable_line or port.startswith(MOCK_PREFIX):
        return EnableLine()
    return EnableLine(output.enable_line, timed=output.enable_timer)
