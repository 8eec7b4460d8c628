"""Bus and clock of mock hardware in another process, over a unix socket (`protocol` says what is spoken).

Sleeping on the mock's clock is what makes it run faster than real time: a client that sleeps until a stamp tells the
mock that nothing will come from it before, so the mock may jump there. Time does not pass while a client works.
"""

from __future__ import annotations

import mmap
import select
import socket
import time
from collections import deque
from pathlib import Path

from hindrax_core.bus import DeviceError, Read, Transaction, WriteRead
from hindrax_core.events import Stamp
from hindrax_drivers.buses import protocol
from hindrax_drivers.buses.bus import wire_error
from hindrax_drivers.buses.clock import MOCK_PREFIX, Alarm, Meanwhile, nothing
from hindrax_drivers.buses.protocol import Frames, Kind

ANSWER_TIMEOUT_S = 5.0
RETRY_S = 0.2


class VirtualClock:
    """The clock of a mock; reading it costs no system call. When the mock goes away, time stands still.

    A lost mock is looked for again at every sleep and every transfer, so it may be restarted.
    """

    def __init__(self, path: str, name: str = "") -> None:
        self._path, self._name = path, name
        self._alarm = Alarm()
        self._frames, self._heard, self._owed = Frames(), deque[tuple[Kind, bytes]](), 0
        self._socket: socket.socket | None = None
        try:
            self._page = _map_page(path)
            self._connect()
        except OSError as error:
            self._alarm.close()
            raise DeviceError(
                f"{MOCK_PREFIX}{path}: no mock hardware answers ({error.strerror or error}); "
                "start it with `./hindrax mock`, or give the real port in the vehicle file"
            ) from error

    def now(self) -> Stamp:
        """Time of the mock."""
        return Stamp(self._page[0])

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        """Tell the mock that this client is idle until then, and wait."""
        if stamp <= self._page[0]:
            meanwhile()
            return
        try:
            try:
                self._send(protocol.sleep(stamp))
            finally:
                meanwhile()  # also without a mock: that it has gone is to be told
            self._sleep(readable)
        except DeviceError:
            time.sleep(RETRY_S)

    def wake(self) -> None:
        """End the current or the next sleep."""
        self._alarm.ring()

    def close(self) -> None:
        """Hang up; the mock no longer waits for this client."""
        self._hang_up()
        self._alarm.close()

    def _sleep(self, readable: int | None) -> None:
        """Until the mock answers. Who is needed before does not wait for the answer to the sleep that is cut short."""
        link = self._connected()
        wanted = [link.fileno(), self._alarm.fileno()]
        while not self._heard:
            ready, _, _ = select.select(wanted if readable is None else [*wanted, readable], (), ())
            if self._alarm.fileno() in ready:
                self._alarm.hush()
            if link.fileno() in ready:
                self._hear(link)
            if not self._heard and ready != [link.fileno()]:
                self._send(protocol.frame(Kind.WAKE))
                self._owed += 1
                return
        self._heard.clear()

    def _ask(self, question: bytes) -> tuple[Kind, bytes]:
        self._connected()
        self._send(question)
        return self._answer()

    def _send(self, data: bytes) -> None:
        try:
            self._connected().sendall(data)
        except OSError as error:
            raise self._lost(error) from error

    def _answer(self) -> tuple[Kind, bytes]:
        link = self._connected()
        while not self._heard:
            self._hear(link)
        return self._heard.popleft()

    def _hear(self, link: socket.socket) -> None:
        """Take what has come; answers to sleeps that were cut short are for nobody any more."""
        try:
            data = link.recv(65536)
            if not data:
                raise self._lost(None)
            self._heard += self._frames.feed(data)
        except (OSError, protocol.ProtocolError) as error:
            raise self._lost(error) from error
        while self._owed and self._heard:
            self._heard.popleft()
            self._owed -= 1

    def _connected(self) -> socket.socket:
        if self._socket is None:
            try:
                self._page = _map_page(self._path)
                self._connect()
            except OSError as error:
                raise self._lost(error) from error
        assert self._socket is not None
        return self._socket

    def _connect(self) -> None:
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        link.settimeout(ANSWER_TIMEOUT_S)
        self._frames, self._owed = Frames(), 0
        self._heard.clear()
        try:
            link.connect(self._path)
            link.sendall(protocol.hello(self._name))
        except OSError:
            link.close()
            raise
        self._socket = link
        self._answer()

    def _hang_up(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _lost(self, why: Exception | None) -> DeviceError:
        self._hang_up()
        return DeviceError(f"{MOCK_PREFIX}{self._path}: the mock hardware has gone ({why or 'it hung up'})")


class VirtualBus(VirtualClock):
    """The I2C bus of a mock, with its clock."""

    def transfer(self, transaction: Transaction) -> bytes:
        """Ask the mock to do one transaction."""
        kind, body = self._ask(protocol.transfer(transaction))
        if kind is Kind.FAILED:
            raise wire_error(f"{MOCK_PREFIX}{self._path}", transaction.address, protocol.parse_i32(body))
        return body if isinstance(transaction, Read | WriteRead) else b""


def _map_page(path: str) -> memoryview:
    """Map the mock's time page as one signed 64-bit integer [ns]; an aligned load cannot be torn."""
    with Path(path + protocol.PAGE_SUFFIX).open("rb") as page:
        return memoryview(mmap.mmap(page.fileno(), protocol.PAGE_BYTES, access=mmap.ACCESS_READ)).cast("q")
