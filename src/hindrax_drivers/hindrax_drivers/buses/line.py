"""Line to a device that sends unprompted: a serial port, 8N1, or the same bytes in datagrams or over a connection."""

import contextlib
import errno
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import TypeAlias

import serial

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output, Send
from hindrax_core.errors import cause
from hindrax_core.events import Stamp, seconds_between
from hindrax_drivers.buses.clock import Clock, Meanwhile, nothing

Tap: TypeAlias = Callable[[Stamp, bool, bytes], None]
"""Called for every frame of the port: time, whether it was sent, bytes."""

BREAK_S = 0.001
WRITE_TIMEOUT_S = 1.0
AUTO_BAUD = b"U"  # 0x55: alternating bits, from which a device measures the line speed

_REMEDY = {
    errno.ENOENT: "no such port; check cable and power, and the udev rule that makes this name",
    errno.EACCES: "not allowed; add the user to the group dialout (sudo usermod -aG dialout $USER) and log in again",
    errno.EPERM: "not allowed; add the user to the group dialout (sudo usermod -aG dialout $USER) and log in again",
    errno.EAGAIN: "busy; another program has it open (find it with `fuser`)",
    errno.EBUSY: "busy; another program has it open (find it with `fuser`)",
    errno.ENOTTY: "not a serial port; check the port in the vehicle file",
    errno.EISDIR: "not a serial port but a directory; check the port in the vehicle file",
}

UDP_PREFIX, TCP_PREFIX = "udp://", "tcp:"
UDP_IN, UDP_OUT = "udpin:", "udpout:"
"""As programs of MAVLink name them: to listen for an autopilot, and to send to one that listens."""
CONNECT_S = 1.0
"""A device in the same network answers in milliseconds; who is not there is tried again."""
QUIET_S, PROBES = 2, 3
"""A connection without data is probed after so long, and is lost after so many probes, a second apart: pulled cables
send no farewell."""
LARGEST_DATAGRAM = 65536
MOST_AT_ONCE = 100
MOST_KEPT = 8
OWN_S = 3.0
"""Silence of a sender of datagrams after which another one may be the device."""


class Line(ABC):
    """An open line, waited on with a clock. DeviceError when it is lost: then reopen it."""

    def __init__(self, path: str, clock: Clock, port: serial.Serial | socket.socket, check: str) -> None:
        self._path, self._clock, self._descriptor, self._check = path, clock, port, check

    @abstractmethod
    def _receive(self) -> bytes:
        """Return the bytes that have arrived, without waiting."""

    @abstractmethod
    def _transmit(self, order: Send) -> None:
        """Send bytes."""

    def read(self) -> tuple[bytes, Stamp]:
        """Return the bytes that have arrived, without waiting, and a time by which they had."""
        with self._lost_on(OSError, TypeError):  # of pyserial, when it is closed
            data = self._receive()
        # A process that does not get the processor in between is late; a clock read before would be early, and a single
        # sample earlier than it was taken makes all others look late (`Timebase`).
        return data, self._clock.now()

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep on the clock until bytes arrive, the time has come, or `clock.wake()` is called."""
        with self._lost_on(OSError, ValueError):
            self._clock.sleep_until(until, self._descriptor.fileno(), meanwhile)

    def send(self, order: Send) -> None:
        """Send bytes; with `wake`, a serial port first sends a BREAK of 1 ms, waits 1 ms and sends 'U' (auto-baud)."""
        with self._lost_on(OSError):
            self._transmit(order)

    def send_all(self, outputs: Iterable[Output], tap: Tap) -> list[Output]:
        """Send, and tap, what is for the wire; returns the rest."""
        kept = list(outputs)
        for output in kept:
            if isinstance(output, Send):
                self.send(output)
                tap(self._clock.now(), True, output.data)
        return [output for output in kept if not isinstance(output, Send)]

    def close(self) -> None:
        """Close the line; closing twice is no error."""
        with contextlib.suppress(OSError):
            self._descriptor.close()

    @contextlib.contextmanager
    def _lost_on(self, *kinds: type[Exception]) -> Iterator[None]:
        try:
            yield
        except kinds as error:
            self.close()
            raise DeviceError(f"{self._path}: lost ({error}); check {self._check}") from error


def at_baud(path: str, baud: int) -> str:
    """Speed of a line, for sentences; Ethernet has none."""
    return "" if is_network(path) else f" at {baud} baud"


def is_network(path: str) -> bool:
    """Whether a port is an address in a network, which no file stands for."""
    return path.startswith((UDP_PREFIX, TCP_PREFIX, UDP_IN, UDP_OUT))


def open_line(path: str, baud: int, clock: Clock) -> Line:
    """Open a line to a serial device. DeviceError says why not.

    Parameters
    ----------
    path
        A serial port; `udp://ADDRESS:PORT` listens; `tcp://HOST:PORT` connects; `udpin:ADDRESS:PORT` listens for
        datagrams that are taken as they are; `udpout:HOST:PORT` sends to who listens.
    baud
        Of a serial port.
    clock
        For the stamps of what is read.

    Returns
    -------
    Line
        To be closed.
    """
    if path.startswith((UDP_PREFIX, UDP_IN)):
        return UdpPort(path, clock)
    if path.startswith(UDP_OUT):
        return UdpClient(path, clock)
    return TcpPort(path, clock) if path.startswith(TCP_PREFIX) else SerialPort(path, baud, clock)


class SerialPort(Line):
    """An open port, exclusive where the system supports that."""

    def __init__(self, path: str, baud: int, clock: Clock) -> None:
        self._port = _opened(path, baud)
        super().__init__(path, clock, self._port, "cable and power")

    def _receive(self) -> bytes:
        return bytes(self._port.read(65536))

    def _transmit(self, order: Send) -> None:
        if order.wake:
            self._break()
            self._port.write(AUTO_BAUD)
        self._port.write(order.data)

    def _break(self) -> None:
        """Send a BREAK, where the port can: most adapters at /dev/ttyACM* cannot, and a device may do without."""
        try:
            for on in (True, False):
                self._port.break_condition = on
                time.sleep(BREAK_S)
        except OSError as error:
            if error.errno != errno.EOPNOTSUPP:
                raise


class UdpPort(Line):
    """Listens at a local address and answers who sends there; until there is somebody, commands are queued.

    Of two senders the first is the device, and the other is not heard while that one speaks: two vehicles of the same
    number would be one in all that is received, and commands would go to both by turns.

    At `udp://` a datagram ends a line of text, even without a line end; at `udpin:` it is bytes. A DVL-75 sends to port
    27000 from the port at which it takes commands. Source: docs.ceruleansonar.com, DVL-75, "The Ethernet Interface".
    """

    def __init__(self, path: str, clock: Clock) -> None:
        self._socket = _listening(path)
        super().__init__(path, clock, self._socket, "network and cable")
        self._text = path.startswith(UDP_PREFIX)
        self._device: tuple[str, int] | None = None
        self._heard = Stamp(0)
        self._kept: list[bytes] = []

    def _receive(self) -> bytes:
        found = []
        with contextlib.suppress(BlockingIOError):
            for _ in range(MOST_AT_ONCE):
                data, sender = self._socket.recvfrom(LARGEST_DATAGRAM)
                now = self._clock.now()
                if sender != self._device and self._device and seconds_between(self._heard, now) < OWN_S:
                    continue
                self._device, self._heard = sender, now
                found.append(data + b"\n" if self._text and not data.endswith(b"\n") else data)
        self._send_kept()
        return b"".join(found)

    def _transmit(self, order: Send) -> None:
        self._kept = [*self._kept[-MOST_KEPT:], order.data]
        self._send_kept()

    def _send_kept(self) -> None:
        while self._kept and self._device is not None:
            self._socket.sendto(self._kept.pop(0), self._device)


class UdpClient(Line):
    """Sends datagrams to an address and receives what comes back: an autopilot's router, or its simulator."""

    def __init__(self, path: str, clock: Clock) -> None:
        host, port = _host_and_port(path, UDP_OUT, "udpout:HOST:PORT, such as udpout:192.168.2.2:14550")
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.connect(address)
        except OSError as error:
            raise DeviceError(f"{path}: cannot send there ({cause(error)}); check network and address") from error
        self._socket.setblocking(False)
        super().__init__(path, clock, self._socket, "network and power")

    def _receive(self) -> bytes:
        found: list[bytes] = []
        # Nobody listens there yet: the next datagram may find somebody.
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while len(found) < MOST_AT_ONCE:
                found.append(self._socket.recv(LARGEST_DATAGRAM))
        return b"".join(found)

    def _transmit(self, order: Send) -> None:
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            self._socket.send(order.data)


class TcpPort(Line):
    """A connection to a device that listens, such as a Water Linked DVL at port 16171."""

    def __init__(self, path: str, clock: Clock) -> None:
        self._socket = _connected(path)
        super().__init__(path, clock, self._socket, "network and power")

    def _receive(self) -> bytes:
        try:
            data = self._socket.recv(LARGEST_DATAGRAM)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError("the device has closed the connection")
        return data

    def _transmit(self, order: Send) -> None:
        self._socket.sendall(order.data)


def _host_and_port(path: str, prefix: str, wanted: str) -> tuple[str, int]:
    host, colon, port = path.removeprefix(prefix).removeprefix("//").rpartition(":")
    if not colon or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise DeviceError(f"{path}: wanted {wanted}")
    return host.strip("[]"), int(port)


def _connected(path: str) -> socket.socket:
    host, port = _host_and_port(path, TCP_PREFIX, "tcp://HOST:PORT, such as tcp://192.168.2.95:16171")
    try:
        one = socket.create_connection((host, port), timeout=CONNECT_S)
    except OSError as error:
        raise DeviceError(
            f"{path}: cannot connect ({cause(error)}); check power and network of the device, and its address in the"
            " vehicle file"
        ) from error
    one.setblocking(False)
    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    one.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in ((socket.TCP_KEEPIDLE, QUIET_S), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, PROBES)):
        one.setsockopt(socket.IPPROTO_TCP, option, value)
    return one


def _opened(path: str, baud: int) -> serial.Serial:
    try:
        port = serial.Serial(path, baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
    except (OSError, ValueError) as error:
        remedy = _REMEDY.get(_code(error), f"cannot be opened ({error})")
        raise DeviceError(f"{path}: {remedy}; `./hindrax doctor` lists the devices") from error
    with contextlib.suppress(ValueError, OSError, NotImplementedError):
        port.set_low_latency_mode(True)  # FTDI adapters otherwise hold bytes back for 16 ms
    return port


def _code(error: Exception) -> int:
    """Errno of a failed opening; pyserial hides it in a chain of exceptions of its own, or in their text."""
    one: BaseException | None = error
    while one is not None:
        if one.args and isinstance(one.args[0], int):
            return one.args[0]
        one = one.__context__
    return errno.EAGAIN if "exclusively lock" in str(error) else 0


def _listening(path: str) -> socket.socket:
    address, colon, port = path.removeprefix(UDP_PREFIX).removeprefix(UDP_IN).rpartition(":")
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
