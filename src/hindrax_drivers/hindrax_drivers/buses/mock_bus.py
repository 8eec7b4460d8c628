"""Bus and clock of mock hardware in another process, over a unix socket (see `mock_protocol`).

The mock runs faster than real time because clients sleep on its clock: a client that sleeps until a stamp tells the
mock that nothing will come from it before, so the mock may jump there. Time does not pass while a client works.
"""

import mmap
import select
import socket
import time
from pathlib import Path

from hindrax_core.bus_operations import DeviceError, Read, Transaction, WriteRead, pack_transaction, wire_error
from hindrax_core.errors import cause
from hindrax_core.events import Stamp
from hindrax_drivers.buses import mock_protocol
from hindrax_drivers.buses.clock import MOCK_PREFIX, Alarm, Meanwhile, nothing
from hindrax_drivers.buses.mock_protocol import LARGEST_FRAME, Kind

ANSWER_TIMEOUT_S = 5.0
RETRY_S = 0.2


class VirtualClock:
    """The clock of a mock; reading it costs no system call. When the mock goes away, time stands still.

    A lost mock is reconnected at every sleep and every transfer, so it may be restarted.
    """

    def __init__(self, path: str, name: str = "") -> None:
        self._path, self._name = path, name
        self._alarm = Alarm()
        self._stale_answers = 0
        self._socket: socket.socket | None = None
        try:
            self._connect()
        except OSError as error:
            self._alarm.close()
            raise DeviceError(
                f"{MOCK_PREFIX}{path}: no mock hardware answers ({cause(error)}); "
                "start it with `./hindrax mock`, or give the real port in the vehicle file"
            ) from error

    def now(self) -> Stamp:
        """Time of the mock."""
        return Stamp(self._page[0])

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        """Report this client as idle until then, and wait.

        Parameters
        ----------
        stamp, readable, meanwhile
            As of `Clock`.
        """
        if stamp <= self._page[0]:
            meanwhile()
            return
        try:
            try:
                self._send(mock_protocol.sleep(stamp))
            finally:
                meanwhile()  # also without a mock: its loss must be reported
            self._sleep(readable)
        except DeviceError:
            time.sleep(RETRY_S)

    def wake(self) -> None:
        """End the current or the next sleep."""
        self._alarm.set()

    def close(self) -> None:
        """Disconnect; the mock no longer waits for this client."""
        self._disconnect()
        self._alarm.close()

    def _sleep(self, readable: int | None) -> None:
        """Wait for the answer of the mock. When woken before, do not wait for the answer to the cancelled sleep."""
        link = self._connected()
        wanted = [link.fileno(), self._alarm.fileno()]
        while True:
            ready, _, _ = select.select(wanted if readable is None else [*wanted, readable], (), ())
            if self._alarm.fileno() in ready:
                self._alarm.clear()
            if link.fileno() in ready and self._receive(link) is not None:
                return
            if ready != [link.fileno()]:
                self._send(mock_protocol.frame(Kind.WAKE))
                self._stale_answers += 1
                return

    def _send(self, data: bytes) -> None:
        try:
            self._connected().sendall(data)
        except OSError as error:
            raise self._lost(error) from error

    def _answer(self) -> tuple[Kind, bytes]:
        link = self._connected()
        while (answer := self._receive(link)) is None:
            pass
        return answer

    def _receive(self, link: socket.socket) -> tuple[Kind, bytes] | None:
        """Receive an answer; None for one to a cancelled sleep."""
        try:
            data = link.recv(LARGEST_FRAME)
            answer = mock_protocol.parse(data) if data else None
        except (OSError, mock_protocol.ProtocolError) as error:
            raise self._lost(error) from error
        if answer is None:
            raise self._lost(None)
        if not self._stale_answers:
            return answer
        self._stale_answers -= 1
        return None

    def _connected(self) -> socket.socket:
        if self._socket is None:
            try:
                self._connect()
            except OSError as error:
                raise self._lost(error) from error
        assert self._socket is not None
        return self._socket

    def _connect(self) -> None:
        """Map the time page, one signed 64-bit integer [ns] whose aligned load cannot be torn, then connect."""
        with Path(self._path + mock_protocol.PAGE_SUFFIX).open("rb") as page:
            mapped = mmap.mmap(page.fileno(), mock_protocol.PAGE_BYTES, access=mmap.ACCESS_READ)
        self._page = memoryview(mapped).cast("q")
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        link.settimeout(ANSWER_TIMEOUT_S)
        self._stale_answers = 0
        try:
            link.connect(self._path)
            link.sendall(mock_protocol.hello(self._name))
        except OSError:
            link.close()
            raise
        self._socket = link
        self._answer()

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _lost(self, why: Exception | None) -> DeviceError:
        self._disconnect()
        return DeviceError(f"{MOCK_PREFIX}{self._path}: the mock hardware has gone ({why or 'it hung up'})")


class VirtualBus(VirtualClock):
    """The I2C bus of a mock, with its clock."""

    def transfer(self, transaction: Transaction) -> bytes:
        """Run one transaction on the mock."""
        self._send(mock_protocol.frame(Kind.TRANSFER, pack_transaction(transaction)))
        kind, body = self._answer()
        if kind is Kind.FAILED:
            code = mock_protocol.number(mock_protocol.ERRNO, body)
            raise wire_error(f"{MOCK_PREFIX}{self._path}", transaction.address, code)
        return body if isinstance(transaction, Read | WriteRead) else b""
