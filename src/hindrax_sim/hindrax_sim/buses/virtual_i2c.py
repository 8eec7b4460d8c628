"""The virtual I2C bus: register emulators at addresses."""

from hindrax_core.bus_operations import Read, Transaction, Write
from hindrax_core.events import Stamp, to_s
from hindrax_sim.devices.emulator import NackError, RegisterEmulator


class VirtualI2c:
    """Several emulators on one pair of wires. Errors are OSError with the errno that Linux would give."""

    def __init__(self) -> None:
        self._devices: dict[int, RegisterEmulator] = {}

    def attach(self, address: int, device: RegisterEmulator) -> None:
        """Attach a device at an address; ValueError where another one is."""
        if address in self._devices:
            raise ValueError(f"address {address:#04x}: is taken by {self._devices[address]!r}")
        self._devices[address] = device

    def transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        """Run one transaction; raises OSError (NackError, BusStuckError)."""
        device, now_s = self._devices.get(transaction.address), to_s(now)
        if device is None:
            raise NackError
        if not isinstance(transaction, Read):
            device.write(transaction.data, now_s)
        return b"" if isinstance(transaction, Write) else device.read(transaction.count, now_s)
