"""The virtual I2C bus: register emulators at addresses, a log, and wire faults."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from hindrax_core.bus_operations import Read, Transaction, Write
from hindrax_core.events import Stamp, to_s
from hindrax_sim.devices.emulator import NackError, RegisterEmulator

LOG_LENGTH = 4096


@dataclass(frozen=True, slots=True)
class Logged:
    """One transaction on the wire; `error` is an errno, 0 for success."""

    stamp: Stamp
    transaction: Transaction
    answer: bytes
    error: int = 0


class VirtualI2c:
    """Several emulators on one pair of wires. Errors are OSError with the errno that Linux would give."""

    def __init__(self) -> None:
        self._devices: dict[int, RegisterEmulator] = {}
        self.log: deque[Logged] = deque(maxlen=LOG_LENGTH)

    def attach(self, address: int, device: RegisterEmulator) -> None:
        """Attach a device at an address."""
        if address in self._devices:
            raise ValueError(f"address {address:#04x}: is taken by {self._devices[address]!r}")
        self._devices[address] = device

    def transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        """Run one transaction; raises OSError (NackError, BusStuckError)."""
        try:
            answer = self._do(transaction, to_s(now))
        except OSError as error:
            self.log.append(Logged(now, transaction, b"", error.errno or 0))
            raise
        self.log.append(Logged(now, transaction, answer))
        return answer

    def _do(self, transaction: Transaction, now_s: float) -> bytes:
        device = self._devices.get(transaction.address)
        if device is None:
            raise NackError
        if not isinstance(transaction, Read):
            device.write(transaction.data, now_s)
        if isinstance(transaction, Write):
            return b""
        return device.read(transaction.count, now_s)
