"""Where other programs meet serial emulators: ptys at stable paths, and the Ethernet side of a DVL."""

import contextlib
import os
import pty
import socket
import termios
import tty
from pathlib import Path

from hindrax_core.errors import HindraxError, cause
from hindrax_drivers.buses.line import TCP_PREFIX, UDP_PREFIX

HERE = "127.0.0.1"
TO_HOST, OF_DEVICE, SERVED = 27000, 50000, 16171
AUTOPILOT_SERVED = 5760
"""TCP port of the first serial line of ArduPilot's simulators."""
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

        Parameters
        ----------
        data
            Discarded too while the port is unplugged.
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


class UdpEnd:
    """A DVL on the network, in place of a pty: each of its sentences is a datagram, and commands come back.

    Defaults of the device: it sends from port 50000 to port 27000 and takes commands at 50000. Here both ends are this
    machine. Source: docs.ceruleansonar.com, DVL-75, "The Ethernet Interface". No discovery.
    """

    def __init__(self, to_port: int = TO_HOST, own_port: int = OF_DEVICE) -> None:
        self.path, self._to = f"{UDP_PREFIX}0.0.0.0:{to_port}", (HERE, to_port)
        self._rest, self._in_place = b"", True
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((HERE, own_port))
        except OSError as error:
            self._socket.close()
            raise HindraxError(f"udp {own_port} for a DVL: {cause(error)}; another mock may have it") from error

    def plug(self, *, in_place: bool) -> None:
        """Plug in, or unplug: nothing passes then."""
        self._in_place = in_place

    def write(self, data: bytes) -> None:
        """Send whole lines, with their ends."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[-LONGEST_LINE:]
        for line in lines if self._in_place else ():
            with contextlib.suppress(OSError):  # no listener
                self._socket.sendto(line + b"\n", self._to)

    def read(self) -> bytes:
        """Return the commands that have arrived."""
        found = b""
        with contextlib.suppress(OSError):  # no more data
            while True:
                found += self._socket.recv(LONGEST_LINE)
        return found if self._in_place else b""

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpEnd:
    """A device that serves TCP, in place of a pty: it sends to every client, and takes commands of each.

    Source: docs.waterlinked.com, "DVL A50/A125 TCP JSON API", section "Overview".
    """

    def __init__(self, port: int = SERVED) -> None:
        self.path = f"{TCP_PREFIX}//{HERE}:{port}"
        self._clients: list[socket.socket] = []
        self._listener: socket.socket | None = None
        self._port = port
        self.plug(in_place=True)

    def plug(self, *, in_place: bool) -> None:
        """Plug in, or unplug: clients then lose their connection; HindraxError where the TCP port is taken."""
        if in_place and self._listener is None:
            try:
                self._listener = socket.create_server((HERE, self._port))
            except OSError as error:
                raise HindraxError(
                    f"tcp {self._port} for a device: {cause(error)}; another mock, or a SITL, may have it"
                ) from error
            self._listener.setblocking(False)
        elif not in_place:
            self.close()

    def write(self, data: bytes) -> None:
        """Send to every client; one that does not read is disconnected."""
        self._accept()
        for client in list(self._clients):
            try:
                client.sendall(data)
            except OSError:
                self._drop(client)

    def read(self) -> bytes:
        """Return the commands of all clients."""
        self._accept()
        found = b""
        for client in list(self._clients):
            try:
                data = client.recv(LONGEST_LINE)
            except BlockingIOError:
                continue
            except OSError:  # it went without a farewell
                data = b""
            found += data
            if not data:
                self._drop(client)
        return found

    def _accept(self) -> None:
        if self._listener is None:
            return
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            self._clients.append(client)

    def _drop(self, client: socket.socket) -> None:
        client.close()
        self._clients.remove(client)

    def close(self) -> None:
        """Close all sockets."""
        for one in (*self._clients, *filter(None, [self._listener])):
            one.close()
        self._clients, self._listener = [], None
