"""Line to a device that sends by itself: a serial port, or network datagrams with the same bytes."""

from __future__ import annotations

import contextlib
import socket
from typing import Protocol

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Send
from hindrax_core.errors import cause
from hindrax_core.events import Stamp
from hindrax_drivers.buses.clock import Clock, Meanwhile, nothing
from hindrax_drivers.buses.serial_port import SerialPort

UDP_PREFIX = "udp://"
LARGEST_DATAGRAM = 65536
MOST_AT_ONCE = 100
MOST_KEPT = 8


class Line(Protocol):
    """An open line. DeviceError when it is lost."""

    def read(self) -> tuple[bytes, Stamp]:
        """Return the bytes that have arrived, without waiting, and the time of the read."""

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep on the clock until bytes arrive, the time has come, or `clock.wake()` is called."""

    def send(self, order: Send) -> None:
        """Send bytes."""

    def close(self) -> None:
        """Close the line; closing twice is no error."""


def open_line(path: str, baud: int, clock: Clock) -> Line:
    """Open a serial port, or `udp://ADDRESS:PORT` to listen there. DeviceError says why it cannot be."""
    return UdpPort(path, clock) if path.startswith(UDP_PREFIX) else SerialPort(path, baud, clock)


class UdpPort:
    """Listens at a local address and answers the last sender; until there is one, commands are queued.

    A datagram ends a line of text, whether or not it says so. A DVL-75 sends to port 27000 from the port at which it
    takes commands. Source: docs.ceruleansonar.com, DVL-75, "The Ethernet Interface".
    """

    def __init__(self, path: str, clock: Clock) -> None:
        self._path, self._clock = path, clock
        self._device: tuple[str, int] | None = None
        self._kept: list[bytes] = []
        self._socket = _listening(path)

    def read(self) -> tuple[bytes, Stamp]:
        """Return the datagrams that have arrived."""
        stamp = self._clock.now()
        found = []
        try:
            with contextlib.suppress(BlockingIOError):
                for _ in range(MOST_AT_ONCE):
                    data, self._device = self._socket.recvfrom(LARGEST_DATAGRAM)
                    found.append(data if data.endswith(b"\n") else data + b"\n")
            self._send_kept()
        except OSError as error:
            raise self._lost(error) from error
        return b"".join(found), stamp

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until a datagram comes, or the time."""
        try:
            self._clock.sleep_until(until, self._socket.fileno(), meanwhile)
        except (OSError, ValueError) as error:
            raise self._lost(error) from error

    def send(self, order: Send) -> None:
        """Send to the device, or queue until its address is known."""
        self._kept = [*self._kept[-MOST_KEPT:], order.data]
        try:
            self._send_kept()
        except OSError as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _send_kept(self) -> None:
        while self._kept and self._device is not None:
            self._socket.sendto(self._kept.pop(0), self._device)

    def _lost(self, error: Exception) -> DeviceError:
        self.close()
        return DeviceError(f"{self._path}: lost ({error}); check network and cable")


def _listening(path: str) -> socket.socket:
    address, colon, port = path.removeprefix(UDP_PREFIX).rpartition(":")
    if not colon or not port.isdecimal() or not 0 < int(port) < 65536:
        raise DeviceError(f"{path}: wanted udp://ADDRESS:PORT, such as udp://0.0.0.0:27000")
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.setblocking(False)
    try:
        one.bind((address, int(port)))
    except OSError as error:
        one.close()
        raise DeviceError(
            f"{path}: cannot listen there ({cause(error)}); wanted an address of this machine, "
            "0.0.0.0 for all, and a port that no other program has"
        ) from error
    return one
