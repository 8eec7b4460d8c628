"""Processes on this machine as the kernel sees them: which ones are stopped, and which one is a child of which."""

import contextlib
import os
import select
import signal
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hindrax_bringup.stack_lock import FOLDER

PROC = Path("/proc")
LOOK_S = 0.05
STOPPED = "T"
"""State of a process that a signal has stopped; one that a debugger holds is in state t (proc_pid_stat(5))."""


def is_stopped(pid: int) -> bool:
    """Whether a signal has stopped it: it does nothing until it is continued or killed."""
    try:
        stat = (PROC / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    # The name, in parentheses, may hold anything, parentheses too.
    return stat.rpartition(") ")[2].startswith(STOPPED)


def descendants(pid: int) -> list[int]:
    """Every process below this one, its children first."""
    found = list(_children(pid))
    for child in list(found):
        found += descendants(child)
    return found


def _children(pid: int) -> Iterator[int]:
    with contextlib.suppress(OSError):
        for task in (PROC / str(pid) / "task").iterdir():
            with contextlib.suppress(OSError):
                yield from (int(word) for word in (task / "children").read_text(encoding="ascii").split())


@dataclass(frozen=True, slots=True)
class Running:
    """A process: id, parent, owner, words, where it would look for running stacks (empty: in the usual place), name.

    A forked process has the words of its parent, and a name of its own.
    """

    pid: int
    parent: int
    owner: int
    words: str
    place: str = ""
    name: str = ""


def running() -> Iterator[Running]:
    """Every process that can be seen."""
    for folder in PROC.iterdir():
        if not folder.name.isdigit():
            continue
        try:
            words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
            name = (folder / "comm").read_text(errors="replace").strip()
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            owner = folder.stat().st_uid
        except (OSError, IndexError, ValueError):  # it has ended meanwhile
            continue
        yield Running(int(folder.name), parent, owner, words, _place(folder), name)


def _place(process: Path) -> str:
    with contextlib.suppress(OSError):  # another user's, or it has ended meanwhile
        for setting in (process / "environ").read_bytes().split(b"\0"):
            name, _, value = setting.decode(errors="replace").partition("=")
            if name == FOLDER:
                return value
    return ""


class HeldProcesses:
    """Processes that are not our own children, by handles that never mean another one later (pidfd)."""

    def __init__(self, pids: Iterable[int]) -> None:
        self._handles: dict[int, int] = {}
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                self._handles[pid] = os.pidfd_open(pid)

    def kill(self, patience_s: float) -> None:
        """Kill them and let go; those that do not stand still may end by themselves for so long."""
        deadline = time.monotonic() + patience_s
        while (at_work := self._at_work()) and time.monotonic() < deadline:
            select.select(at_work, (), (), LOOK_S)
        for handle in self._handles.values():
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
            os.close(handle)
        self._handles.clear()

    def _at_work(self) -> list[int]:
        # A handle is readable as soon as its process has ended.
        ended, _, _ = select.select(list(self._handles.values()), (), (), 0.0)
        return [one for pid, one in self._handles.items() if one not in ended and not is_stopped(pid)]
