"""The pulse of the tool that looks after a stack: for the service manager, and for `hindrax health`.

It stops when the tool hangs, whatever its processes still do; systemd then starts it again (sd_notify(3)).
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from hindrax_bringup.presence import runtime_folder

PERIOD_S = 1.0
DEAD_S = 5.0
NOTIFY = "NOTIFY_SOCKET"


def notify(words: str, environment: Mapping[str, str] = os.environ) -> None:
    """Tell the service manager, where one listens: READY=1, WATCHDOG=1, STATUS=..."""
    address = environment.get(NOTIFY, "")
    if not address:
        return
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as out, contextlib.suppress(OSError):
        out.sendto(words.encode(), address.replace("@", "\0", 1) if address.startswith("@") else address)


class Pulse:
    """Beats at most once a second, however often it is asked to."""

    def __init__(self, path: Path) -> None:
        self._path, self._next_s = path, 0.0

    def beat(self, status: str, troubles: Mapping[str, str]) -> None:
        """Say that the tool lives, what it does in a few words, and which nodes are unwell."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        self._next_s = now_s + PERIOD_S
        notify(f"WATCHDOG=1\nSTATUS={status}")
        draft = self._path.with_suffix(".draft")
        draft.write_text(json.dumps({"at_s": now_s, "status": status, "troubles": dict(troubles)}), encoding="utf-8")
        draft.rename(self._path)


@contextlib.contextmanager
def pulse() -> Iterator[Pulse]:
    """Yield the pulse of this process; it leaves nothing behind."""
    path = runtime_folder() / f"{os.getpid()}.pulse"
    notify("READY=1")
    try:
        yield Pulse(path)
    finally:
        path.unlink(missing_ok=True)


def felt(folder: Path, now_s: float) -> tuple[bool, str]:
    """Whether a stack of this user lives and is well, and one sentence about it. Time of the monotonic clock [s]."""
    told = "no stack is up here; start one with `./hindrax up`"
    for path in sorted(folder.glob("*.pulse")):
        with contextlib.suppress(OSError, ValueError):
            beat = json.loads(path.read_text(encoding="utf-8"))
            age_s = now_s - beat["at_s"]
            if not 0.0 <= age_s <= DEAD_S:
                told = f"process {path.stem}: no pulse for {abs(age_s):.0f} s; end it and start it again"
                continue
            unwell = [f"{name}: {trouble}" for name, trouble in beat["troubles"].items() if trouble]
            return not unwell, "; ".join(unwell) or beat["status"]
    return False, told
