"""The register bus as a port: one transaction at a time, with the clock that goes with it."""

from __future__ import annotations

import errno
import os
from typing import Protocol

from hindrax_core.bus import DeviceError, Transaction
from hindrax_drivers.buses.clock import MOCK_PREFIX, Clock

_MEANING = {
    errno.EREMOTEIO: "no acknowledge: not wired, not powered, or another address",
    errno.ENXIO: "no acknowledge: not wired, not powered, or another address",
    errno.ETIMEDOUT: "timeout: the bus is held low; power-cycle its devices and check the pull-ups",
    errno.EAGAIN: "arbitration lost: another master or a short circuit on the bus",
}


class RegisterBus(Clock, Protocol):
    """An I2C bus and its clock. Not for use by two threads at once, except `wake()` and `now()`."""

    def transfer(self, transaction: Transaction) -> bytes:
        """Do one transaction and return the bytes read (empty for a write).

        DeviceError names port, address and error on a missing acknowledge, a stuck bus and a lost adapter.
        """


def open_bus(port: str, name: str = "") -> RegisterBus:
    """Open "/dev/i2c-1" (Linux) or "mock:/path/to/socket" (mock hardware, always asked for by name).

    DeviceError says what is missing and the remedy.
    """
    if port.startswith(MOCK_PREFIX):
        from hindrax_drivers.buses.virtual import VirtualBus  # noqa: PLC0415 - `virtual` implements RegisterBus

        return VirtualBus(port.removeprefix(MOCK_PREFIX), name)
    from hindrax_drivers.buses.i2cdev import Smbus2Bus  # noqa: PLC0415 - smbus2 is not needed for mock hardware

    return Smbus2Bus(port)


def wire_error(port: str, address: int, code: int) -> DeviceError:
    """Put a failed transaction into one sentence: port, address, error name, likely cause."""
    name = errno.errorcode.get(code, "error")
    return DeviceError(f"{port} address {address:#04x}: {_MEANING.get(code, os.strerror(code))} ({name}, {code})")
