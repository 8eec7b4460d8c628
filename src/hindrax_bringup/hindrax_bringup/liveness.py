"""Heartbeats of the tool that supervises a stack, and of its processes: what `hindrax health` reads.

The pulse stops when the tool hangs, whatever its processes still do; the service manager learns of it too and starts
the tool again (sd_notify(3)). The file is locked for as long as the tool lives, as that of `stack_lock` is.
"""

import contextlib
import json
import math
import os
import socket
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Self

from hindrax_bringup.process_state import is_stopped
from hindrax_bringup.stack_lock import HEARTBEATS, locked, owned_document, runtime_folder
from hindrax_ros.heartbeat import beaten_s, beating

PERIOD_S = 1.0
DEAD_S = 5.0
LATE_S = 3.0
"""A process without a heartbeat for this long is reported."""
NOBODY = "no stack is up here; start one with `./hindrax up`"
STARTING = "starting"
PROCESSES_START = {STARTING: "waiting for the processes"}
"""Trouble of a stack whose processes are not up yet."""
NOTIFY = "NOTIFY_SOCKET"
NODES = ".nodes.pulse"
"""End of the name of a pulse file on the nodes of a stack; it begins with the id of the stack's tool."""


def notify(words: str, environment: Mapping[str, str] = os.environ) -> None:
    """Notify the service manager, if there is one: READY=1, WATCHDOG=1, STATUS=..."""
    address = environment.get(NOTIFY, "")
    if not address:
        return
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as out, contextlib.suppress(OSError):
        out.sendto(words.encode(), address.replace("@", "\0", 1) if address.startswith("@") else address)


class LivenessFile:
    """Beats at most once a second, however often it is asked to. A context manager that leaves nothing behind."""

    def __init__(self, path: Path) -> None:
        self._path, self._next_s = path, 0.0
        self._file: IO[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._path.unlink(missing_ok=True)
        self.close()

    def beat(
        self, status: str, troubles: Mapping[str, str], *, armed: bool = False, awaited: Collection[str] = ()
    ) -> None:
        """Write the heartbeat of the tool, at most once per `PERIOD_S`, and tell the service manager.

        Parameters
        ----------
        status
            What the tool does, such as "up".
        troubles
            Sentence about each node that is unhealthy, by name; empty sentences are well.
        armed
            Whether its vehicle may thrust.
        awaited
            Nodes that have to report, by name, before the stack of this tool is well.
        """
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        self._next_s = now_s + PERIOD_S
        notify(f"WATCHDOG=1\nSTATUS={status}")
        with contextlib.suppress(OSError):  # the folder goes with the last session of its user; what flies flies on
            beat = {"at_s": now_s, "status": status, "troubles": dict(troubles), "armed": armed}
            beat["awaited"] = list(awaited)
            file = locked(self._path, beat)
            self.close()
            self._file = file

    def close(self) -> None:
        """Give up the lock."""
        if self._file is not None:
            self._file.close()


def tool_liveness() -> LivenessFile:
    """Liveness file of this tool, whose stack is ready."""
    notify("READY=1")
    return LivenessFile(runtime_folder() / f"{os.getpid()}.pulse")


def nodes_liveness() -> LivenessFile:
    """Liveness file of the nodes of a stack, for a process that the tool of this stack has started."""
    return LivenessFile(runtime_folder() / f"{os.getppid()}{NODES}")


def stacks_well(folder: Path, now_s: float) -> tuple[bool, str]:
    """Whether every stack of this user lives and is well, and one sentence about each. Monotonic time [s]."""
    found = liveness_of_stacks(folder, now_s).values()
    if not found:
        return False, NOBODY
    return not any(unwell for _, unwell in found), "; ".join(unwell or status for status, unwell in found)


def liveness_of_stacks(folder: Path, now_s: float) -> dict[int, tuple[str, str]]:
    """Activity of each tool that supervises a stack, and problems of it or its nodes, by its process."""
    found: dict[int, list[_Liveness]] = {}
    for path in sorted(folder.glob("*.pulse")):  # that of the nodes first: what the tool does counts
        if (one := _liveness_of(path, now_s)) is not None:
            found.setdefault(_stack_of(path), []).append(one)
    return {pid: (files[-1].status, "; ".join(_troubles(files))) for pid, files in found.items()}


def _troubles(files: Sequence["_Liveness"]) -> list[str]:
    """Problems in the files of one stack, each once; first, which nodes have not reported yet."""
    troubles = dict.fromkeys(trouble for one in reversed(files) for trouble in one.troubles)
    reported = {name for one in files for name in one.reported}
    awaited = [name for one in files for name in one.awaited if name not in reported]
    waiting = [f"{STARTING}: waiting for {', '.join(awaited)}"] if awaited else []
    return [*waiting, *troubles]


def reported_armed(folder: Path, pid: int) -> bool:
    """Whether the safety monitor of a stack reports armed thrusters; one that is late or frozen reports none."""
    with contextlib.suppress(OSError, ValueError):
        beat = json.loads((folder / f"{pid}{NODES}").read_text(encoding="utf-8"))
        return bool(beat["armed"]) and time.monotonic() - beat["at_s"] <= LATE_S
    return False


def _stack_of(path: Path) -> int:
    return int(path.name.partition(".")[0])


@dataclass(frozen=True, slots=True)
class _Liveness:
    """What the file of one process says: activity, problems, nodes that it waits for, and those that have reported."""

    status: str
    troubles: Sequence[str]
    awaited: Sequence[str] = ()
    reported: Collection[str] = ()


def _liveness_of(path: Path, now_s: float) -> _Liveness | None:
    """Liveness of the process behind a file; None without a process."""
    if (beat := owned_document(path)) is None:
        return None
    age_s, pid, of_nodes = now_s - beat["at_s"], _stack_of(path), path.name.endswith(NODES)
    if not of_nodes and is_stopped(pid):
        return _Liveness("", [f"process {pid}: stopped, as by Ctrl-Z; nothing supervises it until `kill -CONT {pid}`"])
    reported = beat["troubles"] if of_nodes else ()
    if abs(age_s) > DEAD_S:  # it may beat after the time was read; a file of before a boot is far in the future
        who = f"safety monitor of process {pid}" if of_nodes else f"process {pid}"
        return _Liveness("", [f"{who}: no heartbeat for {abs(age_s):.0f} s; restart it"], reported=reported)
    troubles = [f"{name}: {trouble}" for name, trouble in beat["troubles"].items() if trouble]
    late = silent(beats(path.parent, pid, now_s))
    return _Liveness(beat["status"], [*late, *troubles], beat.get("awaited", ()), reported)


def beats(folder: Path, pid: int, now_s: float) -> dict[str, float]:
    """Age of the last heartbeat of each process that a tool has started.

    Parameters
    ----------
    folder
        Runtime folder of this user.
    pid
        Of the tool.
    now_s : [s]
        Of the monotonic clock.

    Returns
    -------
    dict[str, float]
        Seconds since the last heartbeat, by the name of the process; infinite before the first.
    """
    found = {}
    for path in sorted(folder.glob(f"{pid}-*{HEARTBEATS}/*")):
        if path.suffixes:  # what a process leaves to its successor
            continue
        last_s = beaten_s(path)
        found[path.name] = math.inf if last_s is None else now_s - last_s
    return found


def processes_of(folder: Path, pid: int) -> dict[str, int]:
    """Process behind each heartbeat of a stack, by its name; the dead man's is that of the thrusters."""
    paths = folder.glob(f"{pid}-*{HEARTBEATS}/*")
    return {path.name: found for path in paths if not path.suffixes and (found := beating(path)) is not None}


def silent(ages_s: Mapping[str, float]) -> list[str]:
    """Return a sentence for each process whose heartbeat is not what it should be."""
    return [
        f"{name}: {'no heartbeat yet' if math.isinf(age_s) else f'no heartbeat for {age_s:.0f} s'}"
        for name, age_s in ages_s.items()
        if age_s > LATE_S
    ]


def health_change(name: str, before: str | None, now: str) -> str:
    """Return a sentence if the health of a node has changed; numbers alone are no news.

    Parameters
    ----------
    name
        Of the node.
    before
        Its trouble as reported last, empty when it was well; None for a node of which nothing was known.
    now
        Its trouble now; empty when it is well.

    Returns
    -------
    str
        "name: trouble" or "name: ok"; empty where nothing is news.
    """
    if now:
        return f"{name}: {now}" if _words(now) != _words(before or "") else ""
    return f"{name}: ok" if before != "" else ""


def _words(text: str) -> str:
    return "".join(letter for letter in text if not (letter.isdigit() or letter in ".-+"))
