"""Lines of a GPIO chip by libgpiod 2: one line alone, or a chip as a register bus of one bit per line."""

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

from hindrax_core.bus_operations import EDGE, EDGES, DeviceError, Read, Transaction, Write
from hindrax_core.errors import cause
from hindrax_core.stack_time import StackTime
from hindrax_drivers.buses.clock import SystemClock

GPIO_PREFIX = "gpio:"
DEVICES = Path("/dev")
CONSUMER = "hindrax"
BIASES = ("AS_IS", "PULL_UP", "PULL_DOWN")


def library() -> ModuleType:
    """Return libgpiod; DeviceError with the remedy where it is missing."""
    try:
        return importlib.import_module("gpiod")
    except ImportError as error:
        raise DeviceError("GPIO: needs libgpiod 2 for Python; pip install 'gpiod>=2'") from error


def find_chip(chip: str) -> str:
    """Path of a chip by label, name or path: the numbers of chips change between kernels. DeviceError: none such."""
    labels = []
    for path in sorted(DEVICES.glob("gpiochip*")):
        try:
            with library().Chip(str(path)) as opened:
                info = opened.get_info()
        except OSError as error:
            raise DeviceError(f"GPIO {path}: {cause(error)}; add the user to the group gpio") from error
        if chip in (info.label, info.name, str(path)):
            return str(path)
        labels.append(info.label)
    raise DeviceError(f"GPIO: found the chips {', '.join(labels) or 'none'}, wanted {chip!r}; see `gpiodetect`")


def request_line(chip: str, line: int, **settings: Any) -> Any:
    """Request one line.

    Parameters
    ----------
    chip, line
        Of the kernel.
    **settings
        As gpiod has them.

    Returns
    -------
    Any
        The request of gpiod.

    Raises
    ------
    DeviceError
        With cause and remedy.
    """
    gpiod, path = library(), find_chip(chip)
    try:
        return gpiod.request_lines(path, consumer=CONSUMER, config={line: gpiod.LineSettings(**settings)})
    except OSError as error:
        raise DeviceError(
            f"GPIO {chip}:{line}: cannot be requested ({cause(error)}); find who uses it with `gpioinfo`, and add "
            "the user to the group gpio"
        ) from error


class InputLines(dict[int, Any]):
    """Requested input lines, by number."""

    def request(self, chip: str, line: int, **settings: Any) -> None:
        """Request a line, given back before where it is ours. DeviceError with cause and remedy.

        Parameters
        ----------
        chip, line, **settings
            As of `request_line`.
        """
        if line in self:
            self.pop(line).release()
        self[line] = request_line(chip, line, direction=library().line.Direction.INPUT, **settings)

    def close(self) -> None:
        """Give the lines back."""
        for request in self.values():
            request.release()
        self.clear()


class EdgeLines:
    """Lines beside a bus whose rising edges the kernel counts and stamps, at the addresses from EDGES on.

    The kernel stamps by the monotonic clock: by the wall clock, a step too small to restart a stack would part the
    edges from the samples that they announce.
    """

    def __init__(self, time: StackTime) -> None:
        self._time, self._lines = time, InputLines()
        self._newest: dict[int, tuple[int, int]] = {}
        self.close = self._lines.close

    def transfer(self, transaction: Transaction) -> bytes:
        """Watch a line, or return count and time of its edges. DeviceError with the cause."""
        line = transaction.address - EDGES
        if isinstance(transaction, Write):
            kind, chip = library().line, transaction.data.decode(errors="replace")
            self._lines.request(chip, line, edge_detection=kind.Edge.RISING, event_clock=kind.Clock.MONOTONIC)
            self._newest[line] = (0, 0)
            return b""
        if line not in self._lines:
            raise DeviceError(f"GPIO line {line}: wanted a line that is watched")
        request = self._lines[line]
        try:
            while request.wait_edge_events(0.0):
                event = request.read_edge_events()[-1]
                self._newest[line] = (event.line_seqno & 0xFFFFFFFF, self._time.at(event.timestamp_ns))
        except OSError as error:
            raise DeviceError(f"GPIO line {line}: cannot be read ({cause(error)})") from error
        return EDGE.pack(*self._newest[line])


class GpioBus(SystemClock):
    """A chip as a register bus; the address is the line.

    A write of one byte makes the line an input with a bias (0 none, 1 pull-up, 2 pull-down); a read gives its level.
    """

    def __init__(self, chip: str) -> None:
        super().__init__()
        self._chip, self._lines = chip, InputLines()
        try:
            find_chip(chip)
        except DeviceError:
            self.close()
            raise

    def transfer(self, transaction: Transaction) -> bytes:
        """Set up or read one line. DeviceError names chip and line."""
        line = transaction.address
        if isinstance(transaction, Write):
            bias = BIASES[transaction.data[0]]
            self._lines.request(self._chip, line, bias=getattr(library().line.Bias, bias))
            return b""
        if not isinstance(transaction, Read) or line not in self._lines:
            raise DeviceError(f"GPIO {self._chip}:{line}: wanted a line that is set up, and a plain read")
        try:
            return bytes([self._lines[line].get_value(line) == library().line.Value.ACTIVE])
        except OSError as error:
            raise DeviceError(f"GPIO {self._chip}:{line}: cannot be read ({cause(error)})") from error

    def close(self) -> None:
        """Give the lines back."""
        self._lines.close()
        super().close()
