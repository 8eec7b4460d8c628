"""Where other programs meet serial emulators: ptys at stable paths, and the Ethernet side of a DVL."""

import contextlib
import os
import pty
import socket
import termios
import tty
from pathlib import Path

from hindrax_core.errors import HindraxError, cause

HERE = "127.0.0.1"
TO_HOST, OF_DEVICE = 27000, 50000
LONGEST_LINE, READ_AT_MOST = 4096, 65536


class Pty:
    """A pty whose far end is linked at `path`. Bytes without a reader are lost, as on a wire."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, int] | None = None
        self.plug(in_place=True)

    def plug(self, *, in_place: bool) -> None:
        """Plug in, or unplug: programs at the far end then lose their port."""
        if in_place and self._ends is None:
            near, far = pty.openpty()
            tty.setraw(far)
            os.set_blocking(near, False)
            self._ends = (near, far)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(far))
        elif not in_place and self._ends is not None:
            self.path.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def write(self, data: bytes) -> None:
        """Send bytes to the far end. A full buffer was not read for seconds: its content is discarded.

        So the next program that opens the port starts with current data, as on a real port.
        """
        if self._ends is None:
            return
        near, far = self._ends
        try:
            os.write(near, data)
        except BlockingIOError:
            termios.tcflush(far, termios.TCIFLUSH)

    def read(self) -> bytes:
        """Return bytes from the far end."""
        if self._ends is None:
            return b""
        try:
            return os.read(self._ends[0], READ_AT_MOST)
        except OSError:
            return b""

    def close(self) -> None:
        """Unplug permanently."""
        self.plug(in_place=False)


class UdpLine:
    """A DVL on the network: every sentence of the serial port at `path` as a datagram, and commands back.

    Call `turn` often. Defaults of the device: it sends from port 50000 to port 27000 and takes commands at 50000. Here
    both ends are this machine. Source: docs.ceruleansonar.com, DVL-75, "The Ethernet Interface". No discovery.
    """

    def __init__(self, path: str, to_port: int = TO_HOST, own_port: int = OF_DEVICE) -> None:
        self._path, self._to = path, (HERE, to_port)
        self._rest = b""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((HERE, own_port))
            self._port = _opened(path)
        except OSError as error:
            self._socket.close()
            raise HindraxError(f"udp {own_port} for {path}: {cause(error)}; another mock may have it") from error

    def turn(self) -> None:
        """Forward received data in both directions."""
        for line in self._lines():
            with contextlib.suppress(OSError):  # no listener
                self._socket.sendto(line, self._to)
        with contextlib.suppress(OSError):  # no more data, or unplugged by a fault
            while True:
                os.write(self._port, self._socket.recv(LONGEST_LINE))

    def close(self) -> None:
        """Close port and socket."""
        with contextlib.suppress(OSError):
            os.close(self._port)
        self._socket.close()

    def _lines(self) -> list[bytes]:
        """Whole lines, with their ends."""
        *lines, rest = (self._rest + self._read()).split(b"\n")
        self._rest = rest[-LONGEST_LINE:]
        return [line + b"\n" for line in lines]

    def _read(self) -> bytes:
        try:
            data = os.read(self._port, LONGEST_LINE)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:  # unplugged by a fault: a new pty appears at the same path
            with contextlib.suppress(OSError):
                fresh = _opened(self._path)
                os.close(self._port)
                self._port = fresh
        return data


def _opened(path: str) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
