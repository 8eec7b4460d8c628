"""Interface of an emulator on a register bus, and the two bus errors."""

from __future__ import annotations

import errno
import os
from typing import Protocol


class RegisterEmulator(Protocol):
    """A device at an address. Time is an argument; NackError refuses a transfer as a silent device would."""

    def write(self, data: bytes, now_s: float) -> None:
        """Bytes of one write, after the address."""

    def read(self, count: int, now_s: float) -> bytes:
        """Return `count` bytes for a read."""


class NackError(OSError):
    """No acknowledge, which a kernel reports as EREMOTEIO."""

    def __init__(self) -> None:
        super().__init__(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))


class BusStuckError(OSError):
    """A line is held low, which a kernel reports as ETIMEDOUT."""

    def __init__(self) -> None:
        super().__init__(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
