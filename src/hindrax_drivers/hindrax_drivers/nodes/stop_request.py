"""Stop without ROS: a connection to the dead man of a thruster output, answered when neutral is on the wire.

The address is an abstract socket with the process id of the dead man and its namespace (unix(7)): it needs no folder,
no disk and no setting, and vanishes with its process. To connect is the request, so there is nothing to parse; whoever
may run a program on this machine may stop a thruster. The answer is one line: `0` or `1` (neutral could not be
written), a space, and a sentence.
"""

from __future__ import annotations

import contextlib
import os
import re
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

PREFIX = "\0hindrax-deadman-"
NAMESPACE_OF_IDS = Path("/proc/self/ns/pid")
"""A container may share the network of its host, and with it the addresses, but has process ids of its own."""
SOCKETS = Path("/proc/net/unix")
WAITING = 8
ANSWER_S = 4.0
"""Longest wait for an answer: a node that does not obey is killed first, and the chip set up again."""
LONGEST_bytes = 4096


@dataclass(frozen=True, slots=True)
class StopAnswer:
    """Whether neutral is on the wire, and what the dead man did."""

    neutral: bool
    sentence: str


class StopRequests:
    """Stop requests to this process. `wake` is called from another thread when one has come."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """OSError where the address cannot be had."""
        self._wake = wake
        self._waiting: list[socket.socket] = []
        self._lock = threading.Lock()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(address(os.getpid()))
        self._listener.listen(WAITING)
        threading.Thread(target=self._accept, name="stop requests", daemon=True).start()

    @property
    def pending(self) -> bool:
        """Whether somebody waits for an answer."""
        return bool(self._waiting)

    def answer(self, sentence: str, *, neutral: bool) -> None:
        """Answer everybody who waits."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for one in waiting:
            with one, contextlib.suppress(OSError):  # it no longer waits
                one.settimeout(0.0)
                one.sendall(f"{0 if neutral else 1} {sentence}\n".encode()[:LONGEST_bytes])

    def close(self) -> None:
        """Take no more requests."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:  # closed
                return
            with self._lock:
                self._waiting.append(connection)
            self._wake()


def address(pid: int) -> str:
    """Address of the dead man with this process id."""
    found = re.search(r"\d+", str(NAMESPACE_OF_IDS.readlink()))
    return f"{PREFIX}{found[0] if found else ''}-{pid}"


def stop_thrust(pid: int, patience_s: float = ANSWER_S) -> StopAnswer | None:
    """Ask a process for neutral and wait for its answer; None where it is no dead man.

    One that is frozen or ends meanwhile gives an answer without neutral.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(patience_s)
        try:
            link.connect(address(pid))
        except OSError:
            return None
        line = b""
        try:
            while not line.endswith(b"\n") and (data := link.recv(LONGEST_bytes)):
                line += data
        except OSError:
            return StopAnswer(False, f"the dead man (process {pid}) gave no answer within {patience_s:g} s")
    code, _, sentence = line.decode(errors="replace").strip().partition(" ")
    return StopAnswer(code == "0", sentence or f"the dead man (process {pid}) has ended")


def dead_men(table: Path = SOCKETS) -> set[int]:
    """Process ids of the dead men on this machine."""
    try:
        text = table.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return set()
    ours = re.escape(address(0)[1:-1])
    return {int(number) for number in re.findall(rf"@{ours}(\d+)$", text, re.MULTILINE)}
