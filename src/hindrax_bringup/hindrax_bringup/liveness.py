"""The pulse of the tool that looks after a stack, and the heartbeats of its processes: what `hindrax health` reads.

The pulse stops when the tool hangs, whatever its processes still do; the service manager is told of it too and starts
the tool again (sd_notify(3)). The file is locked for as long as the tool lives, as that of `stack_lock` is.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import socket
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO

from hindrax_bringup.stack_lock import HEARTBEATS, owned, runtime_folder
from hindrax_ros.heartbeat import beaten_s

PERIOD_S = 1.0
DEAD_S = 5.0
LATE_S = 3.0
"""Without a heartbeat for this long a process is told of."""
NOBODY = "no stack is up here; start one with `./hindrax up`"
NOTIFY = "NOTIFY_SOCKET"


def notify(words: str, environment: Mapping[str, str] = os.environ) -> None:
    """Tell the service manager, where one listens: READY=1, WATCHDOG=1, STATUS=..."""
    address = environment.get(NOTIFY, "")
    if not address:
        return
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as out, contextlib.suppress(OSError):
        out.sendto(words.encode(), address.replace("@", "\0", 1) if address.startswith("@") else address)


class LivenessFile:
    """Beats at most once a second, however often it is asked to."""

    def __init__(self, path: Path) -> None:
        self._path, self._next_s = path, 0.0
        self._file: IO[str] | None = None

    def beat(self, status: str, troubles: Mapping[str, str]) -> None:
        """Say that the tool lives, what it does in a few words, and which nodes are unwell."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        self._next_s = now_s + PERIOD_S
        notify(f"WATCHDOG=1\nSTATUS={status}")
        with contextlib.suppress(OSError):  # the folder goes with the last session of its user; what flies flies on
            self._write({"at_s": now_s, "status": status, "troubles": dict(troubles)})

    def _write(self, beat: Mapping[str, object]) -> None:
        draft = self._path.with_suffix(".draft")
        file = draft.open("w", encoding="utf-8")
        # Locked and complete before it gets the name by which others look for it.
        fcntl.flock(file, fcntl.LOCK_EX)
        json.dump(beat, file)
        file.flush()
        draft.rename(self._path)
        self.close()
        self._file = file

    def close(self) -> None:
        """Give up the lock."""
        if self._file is not None:
            self._file.close()


@contextlib.contextmanager
def pulse() -> Iterator[LivenessFile]:
    """Yield the pulse of this process; it leaves nothing behind."""
    path = runtime_folder() / f"{os.getpid()}.pulse"
    notify("READY=1")
    made = LivenessFile(path)
    try:
        yield made
    finally:
        path.unlink(missing_ok=True)
        made.close()


def felt(folder: Path, now_s: float) -> tuple[bool, str]:
    """Whether every stack of this user lives and is well, and one sentence about each. Monotonic time [s]."""
    found = [one for path in sorted(folder.glob("*.pulse")) if (one := _felt(path, now_s)) is not None]
    if not found:
        return False, NOBODY
    return not any(unwell for _, unwell in found), "; ".join(unwell or status for status, unwell in found)


def _felt(path: Path, now_s: float) -> tuple[str, str] | None:
    """What the tool behind a pulse does, and what is wrong with it (empty when all is well); None without a tool."""
    try:
        with path.open(encoding="utf-8") as file:
            if not owned(file):
                path.unlink(missing_ok=True)
                return None
            beat = json.load(file)
    except (OSError, ValueError):  # it has just ended
        return None
    age_s = now_s - beat["at_s"]
    if not 0.0 <= age_s <= DEAD_S:
        return "", f"process {path.stem}: no pulse for {abs(age_s):.0f} s; end it and start it again"
    troubles = [f"{name}: {trouble}" for name, trouble in beat["troubles"].items() if trouble]
    return beat["status"], "; ".join([*silent(beats(path.parent, int(path.stem), now_s)), *troubles])


def beats(folder: Path, pid: int, now_s: float) -> dict[str, float]:
    """Seconds since the last heartbeat of each process that a tool has started; infinite before the first."""
    found = {}
    for path in sorted(folder.glob(f"{pid}-*{HEARTBEATS}/*")):
        last_s = beaten_s(path)
        found[path.name] = math.inf if last_s is None else now_s - last_s
    return found


def silent(ages_s: Mapping[str, float]) -> list[str]:
    """Return a sentence for each process whose heartbeat is not what it should be."""
    return [
        f"{name}: {'no heartbeat yet' if math.isinf(age_s) else f'no heartbeat for {age_s:.0f} s'}"
        for name, age_s in ages_s.items()
        if age_s > LATE_S
    ]
