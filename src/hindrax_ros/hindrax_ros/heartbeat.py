"""The heartbeat of a process: once a second the time, and its id, in a file that its supervisor named.

The supervisor and `health` read it. It needs no ROS and no port, so it reveals
a process that hangs in either. Time is that of the monotonic clock [s], which all processes of a machine share.
"""

import contextlib
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

VARIABLE = "HINDRAX_HEARTBEAT"
"""Environment variable with the path of the file; a process without it has no heartbeat."""
PERIOD_S = 1.0
MEMORY = ".memory"
"""End of the name of the file beside the heartbeat."""


class HeartbeatFile:
    """That of a process with this environment: beats at most once a second, however often it is asked to."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._file, self._due_s = -1, 0.0
        with contextlib.suppress(OSError):  # no file is named, or the supervisor has gone and its folder with it
            self._file = os.open(environment.get(VARIABLE, ""), os.O_WRONLY | os.O_CREAT, 0o600)

    def beat(self, now_s: float) -> None:
        """Say that the process lives."""
        if now_s < self._due_s or self._file < 0:
            return
        self._due_s = now_s + PERIOD_S
        with contextlib.suppress(OSError):  # a full disk does not end a process that thrusts
            os.pwrite(self._file, f"{now_s:020.3f} {os.getpid():10}".encode(), 0)


def beaten_s(path: Path) -> float | None:
    """Time of the last beat; None before the first."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return float(path.read_text(encoding="ascii").split()[0])
    return None


def beating(path: Path) -> int | None:
    """Process that beats; None before the first beat."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int(path.read_text(encoding="ascii").split()[1])
    return None


class Memory:
    """A few numbers that a process leaves to the one that its supervisor starts in its place, beside the heartbeat."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        named = environment.get(VARIABLE, "")
        self._path = Path(named + MEMORY) if named else None

    def recall(self, count: int) -> tuple[float, ...] | None:
        """Stored numbers; None where there are none, or not so many finite ones."""
        try:
            words = self._path.read_text(encoding="ascii").split() if self._path else []
            found = tuple(map(float, words))
        except (OSError, ValueError):
            return None
        return found if len(found) == count and all(map(math.isfinite, found)) else None

    def write(self, numbers: Sequence[float]) -> None:
        """Leave these instead of what was left before; a process that is killed meanwhile has left the ones before."""
        if self._path is None:
            return
        written = self._path.with_name(f"{self._path.name}.new")
        with contextlib.suppress(OSError):  # a full disk does not end a process that thrusts
            written.write_text(" ".join(map(repr, numbers)), encoding="ascii")
            written.replace(self._path)
