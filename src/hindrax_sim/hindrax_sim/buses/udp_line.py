"""The Ethernet side of a DVL: every sentence as a datagram, and commands back.

Defaults of the device: it sends from port 50000 to port 27000 and takes commands at 50000. Here both ends are this
machine. Source: docs.ceruleansonar.com, DVL-75, "The Ethernet Interface". Discovery is not emulated.
"""

from __future__ import annotations

import contextlib
import os
import socket
from typing import Self

from hindrax_core.errors import HindraxError, cause

HERE = "127.0.0.1"
TO_HOST, OF_DEVICE = 27000, 50000
LONGEST_LINE = 4096


class UdpLine:
    """Opens the serial port at `path` and forwards it to the network; call `turn` often."""

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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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
