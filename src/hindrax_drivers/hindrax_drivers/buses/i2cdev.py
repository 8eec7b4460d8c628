"""A Linux I2C adapter through smbus2, by I2C_RDWR alone: any length, repeated START, no SMBus emulation."""

import errno

from smbus2 import SMBus, i2c_msg

from hindrax_core.bus_operations import EDGES, DeviceError, Read, Transaction, WriteRead, wire_error
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.gpio import EdgeLines

_REMEDY = {
    errno.ENOENT: "no such bus; enable it with dtparam=i2c_arm=on in /boot/firmware/config.txt and reboot",
    errno.ENXIO: "the bus has no adapter; check the overlays in /boot/firmware/config.txt",
    errno.EACCES: "not allowed; add the user to the group i2c (sudo usermod -aG i2c $USER) and log in again",
    errno.EBUSY: "busy; another program holds the bus",
    errno.ENOTTY: "not an I2C bus; check the port in the vehicle file",
}


class Smbus2Bus(SystemClock):
    """An adapter such as /dev/i2c-1, and GPIO lines beside it; time is the system's."""

    def __init__(self, port: str) -> None:
        super().__init__()
        self._port, self._lines = port, EdgeLines(self._time)
        try:
            self._adapter = SMBus(port)
        except OSError as error:
            super().close()
            remedy = _REMEDY.get(error.errno or 0, str(error))
            raise DeviceError(f"{port}: {remedy}; `./hindrax doctor` lists the devices") from error

    def transfer(self, transaction: Transaction) -> bytes:
        """One I2C_RDWR call: START to STOP."""
        address = transaction.address
        if address >= EDGES:
            return self._lines.transfer(transaction)
        messages = []
        if not isinstance(transaction, Read):
            messages.append(i2c_msg.write(address, transaction.data))
        if isinstance(transaction, Read | WriteRead):
            messages.append(i2c_msg.read(address, transaction.count))
        try:
            self._adapter.i2c_rdwr(*messages)
        except OSError as error:
            raise wire_error(self._port, address, error.errno or 0) from error
        return bytes(messages[-1]) if isinstance(transaction, Read | WriteRead) else b""

    def close(self) -> None:
        """Close adapter, lines and alarm."""
        self._lines.close()
        self._adapter.close()
        super().close()
