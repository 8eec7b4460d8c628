"""Lines of a GPIO chip by libgpiod 2: one line alone, or a chip as a register bus of one bit per line."""

from __future__ import annotations

import importlib
import struct
from pathlib import Path
from typing import Any

from hindrax_core.bus_operations import EDGES, DeviceError, Read, Transaction, Write
from hindrax_core.errors import cause
from hindrax_drivers.buses.clock import SystemClock

GPIO_PREFIX = "gpio:"
DEVICES = Path("/dev")
CONSUMER = "hindrax"
BIASES = ("AS_IS", "PULL_UP", "PULL_DOWN")
_EDGE = struct.Struct(">Iq")


def library() -> Any:
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
    """Request one line. DeviceError says what is wrong and the remedy."""
    gpiod, path = library(), find_chip(chip)
    try:
        return gpiod.request_lines(path, consumer=CONSUMER, config={line: gpiod.LineSettings(**settings)})
    except OSError as error:
        raise DeviceError(
            f"GPIO {chip}:{line}: cannot be had ({cause(error)}); find who uses it with `gpioinfo`, and add "
            "the user to the group gpio"
        ) from error


class EdgeLines:
    """Lines beside a bus whose rising edges the kernel counts and stamps, at the addresses from EDGES on."""

    def __init__(self) -> None:
        self._requests: dict[int, Any] = {}
        self._newest: dict[int, tuple[int, int]] = {}

    def transfer(self, transaction: Transaction) -> bytes:
        """Watch a line, or tell count and time of its edges. DeviceError names what is wrong."""
        line = transaction.address - EDGES
        if isinstance(transaction, Write):
            self._watch(transaction.data.decode(errors="replace"), line)
            return b""
        if line not in self._requests:
            raise DeviceError(f"GPIO line {line}: wanted a line that is watched")
        request = self._requests[line]
        try:
            while request.wait_edge_events(0.0):
                event = request.read_edge_events()[-1]
                self._newest[line] = (event.line_seqno & 0xFFFFFFFF, event.timestamp_ns)
        except OSError as error:
            raise DeviceError(f"GPIO line {line}: cannot be read ({cause(error)})") from error
        return _EDGE.pack(*self._newest[line])

    def close(self) -> None:
        """Give the lines back."""
        for request in self._requests.values():
            request.release()
        self._requests.clear()

    def _watch(self, chip: str, line: int) -> None:
        if line in self._requests:
            self._requests.pop(line).release()
        kind = library().line
        wanted = {"direction": kind.Direction.INPUT, "edge_detection": kind.Edge.RISING}
        self._requests[line] = request_line(chip, line, event_clock=kind.Clock.REALTIME, **wanted)
        self._newest[line] = (0, 0)


class GpioBus(SystemClock):
    """A chip as a register bus; the address is the line.

    A write of one byte makes the line an input with a bias (0 none, 1 pull-up, 2 pull-down); a read gives its level.
    """

    def __init__(self, chip: str) -> None:
        super().__init__()
        self._chip = chip
        self._lines: dict[int, Any] = {}
        try:
            find_chip(chip)
        except DeviceError:
            self.close()
            raise

    def transfer(self, transaction: Transaction) -> bytes:
        """Set up or read one line. DeviceError names chip and line."""
        line = transaction.address
        if isinstance(transaction, Write):
            self._request(line, transaction.data[0])
            return b""
        if not isinstance(transaction, Read) or line not in self._lines:
            raise DeviceError(f"GPIO {self._chip}:{line}: wanted a line that is set up, and a plain read")
        try:
            return bytes([self._lines[line].get_value(line) == library().line.Value.ACTIVE])
        except OSError as error:
            raise DeviceError(f"GPIO {self._chip}:{line}: cannot be read ({cause(error)})") from error

    def close(self) -> None:
        """Give the lines back."""
        for request in self._lines.values():
            request.release()
        self._lines.clear()
        super().close()

    def _request(self, line: int, bias: int) -> None:
        if line in self._lines:
            self._lines.pop(line).release()
        kind = library().line
        settings = {"direction": kind.Direction.INPUT, "bias": getattr(kind.Bias, BIASES[bias])}
        self._lines[line] = request_line(self._chip, line, **settings)
