"""Files that stand for the I2C bus of a mock: known by their entry in the mount table."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeAlias

from hindrax_core.bus_operations import Transaction
from hindrax_core.events import Stamp

Transfer: TypeAlias = Callable[[Transaction, Stamp], bytes]
"""Does a transaction at a time; raises OSError as a kernel would."""
SOURCE = "hindrax-i2c"
"""Shown in the mount table; by it a mount that was left behind by a killed process is known."""


class MountedFile(Protocol):
    """What serves such a file, in the loop of the mock."""

    def fileno(self) -> int:
        """Descriptor that is readable when a request waits."""

    def serve(self, timeout_s: float = 0.0) -> int:
        """Answer all requests that wait; returns their number."""

    def close(self) -> None:
        """Take the file away."""


def is_mounted(path: Path) -> bool:
    """Whether such a file is mounted, perhaps without a server: a killed process leaves its mount behind."""
    with contextlib.suppress(OSError):  # no such mounts
        mounts = Path("/proc/self/mounts").read_text(encoding="utf-8").splitlines()
        return any(line.split()[:2] == [SOURCE, str(path)] for line in mounts)
    return False
