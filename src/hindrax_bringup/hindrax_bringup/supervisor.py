"""Starts processes in groups of their own, starts them again when they die, and ends every one of them.

Whatever happens to the tool (Ctrl-C, an exception, SIGTERM), `close` runs: SIGINT to each group, then SIGTERM, then
SIGKILL, always by the id of a process that was started here. If the tool itself is killed outright, the kernel sends
SIGINT to each child (PR_SET_PDEATHSIG), so that none is orphaned.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from hindrax_bringup.system import Process
from hindrax_core.errors import HindraxError

PR_SET_PDEATHSIG = 1
PATIENCE_S = (5.0, 2.0, 2.0)
RESTARTS_AT_MOST = 5
_libc = ctypes.CDLL(None)


@dataclass(slots=True)
class Child:
    """A process that was started here."""

    process: Process
    arguments: tuple[str, ...]
    handle: subprocess.Popen[bytes]
    restarts: int = 0
    ended: bool = False


@dataclass(slots=True)
class Supervisor:
    """Owner of the processes of one run; use it as a context manager."""

    logs: Path
    environment: Mapping[str, str]
    children: dict[str, Child] = field(default_factory=dict)

    def __enter__(self) -> Self:
        """Make the folder of logs."""
        self.logs.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        """End everything."""
        self.close()

    def start(self, process: Process, arguments: Sequence[str] = (), *, pipe: bool = False) -> Child:
        """Start one process; its output goes to `logs/NAME.log`, or its stdout to a pipe."""
        words = tuple(arguments)
        child = Child(process, words, self._spawn(process, words, pipe=pipe))
        self.children[process.name] = child
        return child

    def _spawn(self, process: Process, arguments: Sequence[str], *, pipe: bool = False) -> subprocess.Popen[bytes]:
        with (self.logs / f"{process.name}.log").open("ab") as log:
            return subprocess.Popen(  # noqa: S603  # our own interpreter and our own modules
                [sys.executable, "-m", process.module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if pipe else log,
                stderr=log,
                env=dict(self.environment),
                preexec_fn=_in_a_group_of_its_own,  # noqa: PLW1509  # no threads here, and nothing else can set the death signal
            )

    def check(self) -> list[str]:
        """Look after the processes: start again what died, and say so, one sentence each."""
        return [said for child in self.children.values() if (said := self._check(child))]

    def _check(self, child: Child) -> str:
        code = child.handle.poll()
        if code is None or child.ended:
            return ""
        how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        where = self.logs / f"{child.process.name}.log"
        if not child.process.restart or child.restarts >= RESTARTS_AT_MOST:
            child.ended = True
            return f"{child.process.name} {how} and stays down; its log is {where}"
        child.restarts += 1
        child.handle = self._spawn(child.process, child.arguments)
        return f"{child.process.name} {how}; started again (see {where})"

    def require(self) -> None:
        """Raise HindraxError, with its last words, if a process is down for good."""
        for name, child in self.children.items():
            if child.ended:
                words = last_words(self.logs / f"{name}.log")
                raise HindraxError(
                    f"{name}: the process has ended for good; {words}; look into {self.logs}, start again"
                )

    def stop(self, name: str) -> None:
        """End one process in an orderly way."""
        child = self.children.pop(name, None)
        if child is not None:
            _end([child])

    def close(self) -> None:
        """End all processes, the vehicle's before the mock's, and leave none behind."""
        children = list(self.children.values())
        self.children.clear()
        _end([child for child in children if child.process.restart])
        _end([child for child in children if not child.process.restart])


def last_words(log: Path) -> str:
    """Last line that a process wrote to its log."""
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines() if log.is_file() else []
    return f"its last words: {lines[-1]}" if lines else f"its log {log} is empty"


def _in_a_group_of_its_own() -> None:
    os.setpgid(0, 0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGINT)


def _end(children: Sequence[Child]) -> None:
    for number, patience in zip((signal.SIGINT, signal.SIGTERM, signal.SIGKILL), PATIENCE_S, strict=True):
        alive = [child for child in children if child.handle.poll() is None]
        for child in alive:
            _signal(child, number)
        deadline = time.monotonic() + patience
        for child in alive:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.handle.wait(max(0.0, deadline - time.monotonic()))
    for child in children:
        # What a killed process may have left in its group.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.handle.pid, signal.SIGKILL)


def _signal(child: Child, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        child.handle.send_signal(number)
