"""The mock's end of the socket: serves transactions, and tracks when all clients sleep, so that time can jump.

The mock's main loop owns the time; nothing here reads a clock:

    server = BusServer(path, bus.transfer, start)
    while running:
        server.serve(now, 0.0)                      # answer requests, wake clients that are due
        while server.busy() and patience:
            server.serve(now, 0.01)                 # time stands still while a client works
        now = min(next step of the plant, ...)      # no client is due before server.earliest_wakeup()
"""

import mmap
import os
import selectors
import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from hindrax_core.bus_operations import Transaction
from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.events import Stamp
from hindrax_drivers.buses import mock_protocol
from hindrax_drivers.buses.clock import EPOCH, LAST_STAMP
from hindrax_drivers.buses.mock_protocol import LARGEST_FRAME, Kind


@dataclass(slots=True, eq=False)
class _Client:
    link: socket.socket
    name: str = ""
    until: Stamp | None = None
    has_slept: bool = False
    unsent: deque[bytes] = field(default_factory=deque)


class BusServer:
    """A listening socket at `path`, the time page beside it, and the connected clients.

    `transfer(transaction, now)` does a transaction on the virtual bus and raises OSError as a kernel would.
    """

    def __init__(self, path: str, transfer: Callable[[Transaction, Stamp], bytes], now: Stamp = EPOCH) -> None:
        self._path, self._transfer, self._now = path, transfer, now
        self._clients: list[_Client] = []
        self._page = _make_page(path + mock_protocol.PAGE_SUFFIX)
        # One aligned store of eight bytes: `struct` would clear them first, and a reader could see that.
        self._time = memoryview(self._page).cast("q")
        self._set_time(now)
        self._listener = _listen(path)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def serve(self, now: Stamp, timeout_s: float = 0.0) -> int:
        """Set the time, wake clients that are due, answer requests.

        Parameters
        ----------
        now
            Time of the mock.
        timeout_s : [s]
            Longest wait for requests, of wall time.

        Returns
        -------
        int
            Number of clients that sent something.
        """
        self._set_time(now)
        for client in list(self._clients):
            if client.until is not None and client.until <= now:
                self._wake(client)
        ready = self._selector.select(timeout_s)
        for key, events in ready:
            self._on_event(key.data, events)
        return len(ready)

    def earliest_wakeup(self) -> Stamp:
        """Return the earliest wake-up time of the sleeping clients; LAST_STAMP when none sleeps."""
        return min((client.until for client in self._clients if client.until is not None), default=LAST_STAMP)

    def busy(self) -> list[str]:
        """Names of clients that are awake and have slept before: time should wait for them.

        A client that never sleeps on this clock, such as a diagnostic tool, does not hold up time.

        Returns
        -------
        list[str]
            As they have introduced themselves.
        """
        return [client.name for client in self._clients if client.has_slept and client.until is None]

    def no_longer_wait(self) -> None:
        """Let time advance without busy clients, until they sleep again."""
        for client in self._clients:
            client.has_slept = client.until is not None

    def clients(self) -> list[str]:
        """Names of all connected clients."""
        return [client.name for client in self._clients]

    def register(self, descriptor: int, on_readable: Callable[[], object]) -> None:
        """Call `on_readable` from `serve` when another descriptor is readable, such as that of a `FuseI2c`."""
        self._selector.register(descriptor, selectors.EVENT_READ, on_readable)

    def wake(self, name: str) -> None:
        """End the sleep of every client of this name: its serial port has bytes for it."""
        for client in list(self._clients):
            if client.name == name and client.until is not None:
                self._wake(client)

    def close(self) -> None:
        """Disconnect all clients; remove socket and page."""
        for client in list(self._clients):
            self._drop(client)
        self._selector.close()
        self._listener.close()
        self._time.release()
        self._page.close()
        for path in (self._path, self._path + mock_protocol.PAGE_SUFFIX):
            Path(path).unlink(missing_ok=True)

    def _set_time(self, now: Stamp) -> None:
        self._now = now
        self._time[0] = now

    def _wake(self, client: _Client) -> None:
        client.until = None
        self._send(client, mock_protocol.frame(Kind.TIME, mock_protocol.STAMP.pack(self._now)))

    def _on_event(self, client: _Client | Callable[[], object], events: int) -> None:
        if not isinstance(client, _Client):
            client()
            return
        if events & selectors.EVENT_WRITE:
            self._send(client)
        if events & selectors.EVENT_READ:
            self._receive(client)

    def _accept(self) -> None:
        link, _ = self._listener.accept()
        link.setblocking(False)
        client = _Client(link)
        self._clients.append(client)
        self._selector.register(link, selectors.EVENT_READ, client)

    def _receive(self, client: _Client) -> None:
        try:
            data = client.link.recv(LARGEST_FRAME)
            if data:
                self._handle(client, *mock_protocol.parse(data))
            else:
                self._drop(client)
        except BlockingIOError:
            return
        except (OSError, mock_protocol.ProtocolError):
            self._drop(client)

    def _handle(self, client: _Client, kind: Kind, body: bytes) -> None:
        if kind is Kind.TRANSFER:
            self._send(client, self._answer(mock_protocol.parse_transfer(body)))
        elif kind is Kind.SLEEP:
            client.has_slept, client.until = True, Stamp(mock_protocol.number(mock_protocol.STAMP, body))
            if client.until <= self._now:
                self._wake(client)
        elif kind is Kind.WAKE:
            if client.until is not None:
                self._wake(client)
        elif kind is Kind.HELLO:
            client.name = mock_protocol.parse_hello(body)
            self._wake(client)
        else:
            raise mock_protocol.ProtocolError(f"found {kind.name} from a client")

    def _answer(self, transaction: Transaction) -> bytes:
        try:
            return mock_protocol.frame(Kind.DATA, self._transfer(transaction, self._now))
        except OSError as error:
            return mock_protocol.frame(Kind.FAILED, mock_protocol.ERRNO.pack(error.errno or 0))

    def _send(self, client: _Client, *frames: bytes) -> None:
        """Send what the client accepts now and queue the rest, so that one stuck client cannot stop the mock."""
        client.unsent += frames
        try:
            while client.unsent:
                client.link.send(client.unsent[0])
                client.unsent.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self._drop(client)
            return
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.unsent else 0)
        if self._selector.get_key(client.link).events != events:
            self._selector.modify(client.link, events, client)

    def _drop(self, client: _Client) -> None:
        if client in self._clients:
            self._clients.remove(client)
            self._selector.unregister(client.link)
            client.link.close()


def _make_page(path: str) -> mmap.mmap:
    Path(path).unlink(missing_ok=True)
    try:
        with Path(path).open("x+b", buffering=0) as page:
            # Not only its length: on a full disk a page without a block ends whoever writes to it by SIGBUS.
            os.posix_fallocate(page.fileno(), 0, mock_protocol.PAGE_BYTES)
            return mmap.mmap(page.fileno(), mock_protocol.PAGE_BYTES)
    except OSError as error:
        Path(path).unlink(missing_ok=True)
        raise HindraxError(f"{path}: cannot be made ({cause(error)}); make room, or choose another place") from error


def _listen(path: str) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    Path(path).unlink(missing_ok=True)
    try:
        listener.bind(path)
    except OSError as error:
        listener.close()
        raise UsageError(f"{path}: cannot listen there ({cause(error)}); choose another place") from error
    listener.listen()
    listener.setblocking(False)
    return listener
