"""The register bus: one transaction at a time, with the clock that goes with it; `ports` opens one."""

from __future__ import annotations

import errno
import os
from typing import Protocol

from hindrax_core.bus_operations import DeviceError, Transaction
from hindrax_drivers.buses.clock import Clock

_MEANING = {
    errno.EREMOTEIO: "no acknowledge: not wired, not powered, or another address",
    errno.ENXIO: "no acknowledge: not wired, not powered, or another address",
    errno.ETIMEDOUT: "timeout: the bus is held low; power-cycle its devices and check the pull-ups",
    errno.EAGAIN: "arbitration lost: another master or a short circuit on the bus",
}


class RegisterBus(Clock, Protocol):
    """An I2C bus and its clock. Not for use by two threads at once, except `wake()` and `now()`."""

    def transfer(self, transaction: Transaction) -> bytes:
        """Run one transaction and return the bytes read (empty for a write).

        DeviceError names port, address and error on a missing acknowledge, a stuck bus and a lost adapter.
        """


def wire_error(port: str, address: int, code: int) -> DeviceError:
    """Describe a failed transaction in one sentence: port, address, error name, likely cause."""
    name = errno.errorcode.get(code, "error")
    return DeviceError(f"{port} address {address:#04x}: {_MEANING.get(code, os.strerror(code))} ({name}, {code})")
