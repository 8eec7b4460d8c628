"""Stacks of this machine: each has a lock file by which commands in other terminals find it.

The file is locked for as long as the tool that wrote it lives, so a file that can be locked was left by a tool that
was killed; the next process that finds it removes it.
"""

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

from hindrax_bringup import ros_graph
from hindrax_core.errors import UsageError
from hindrax_core.topics import NAMESPACE
from hindrax_core.vehicle import load_vehicle

FOLDER = "HINDRAX_RUNTIME_DIR"
"""Environment variable that moves the folder; by default it is below XDG_RUNTIME_DIR, or in /tmp per user."""

CLONE = "HINDRAX_ROOT"
"""Environment variable with the folder of the clone whose tool runs, as `./hindrax` sets it."""

UP = "up"
"""Purpose of a stack that waits for an operator; others (a pool test) know themselves what to do."""

HEARTBEATS = ".beats"
"""End of the name of a folder with the heartbeats of a tool's processes; it begins with the id of the tool."""


@dataclass(frozen=True, slots=True)
class StackLock:
    """A running stack: its process, its clock (mock or system), and the settings of its ROS graph."""

    pid: int
    mock: bool
    vehicle: str
    folder: str
    graph: Mapping[str, str] = field(default_factory=dict)
    ports: Mapping[str, str] = field(default_factory=dict)
    purpose: str = UP
    namespace: str = NAMESPACE
    bag: str = ""
    """Folder of the bag; empty: no bag."""
    started_s: float = field(default_factory=time.monotonic)
    """Time of its announcement, by the monotonic clock."""
    clone: str = ""
    """Folder of the clone whose tool has started it; empty: not known."""

    @property
    def waits_for_operator(self) -> bool:
        """Whether it does nothing by itself."""
        return self.purpose == UP

    @property
    def domain(self) -> str:
        """Its ROS_DOMAIN_ID."""
        return self.graph.get(ros_graph.DOMAIN, "0")

    @property
    def whole_title(self) -> str:
        """Description by which nobody takes it for another: vehicle, mock or real, domain, process, folder."""
        kind = "mock" if self.mock else "real"
        space = "" if self.namespace == NAMESPACE else f" {self.namespace}"
        where = f"ROS domain {self.domain}, process {self.pid}"
        return f"{vehicle_name(self.vehicle)} ({kind}){space}, {where}, {self.folder or 'no folder'}"

    @property
    def title(self) -> str:
        """Short description."""
        kind = "mock vehicle" if self.mock else "vehicle"
        purpose = "" if self.purpose == UP else f"{self.purpose}, "
        space = "" if self.namespace == NAMESPACE else f" {self.namespace}"
        return f"{purpose}{kind}{space}, ROS domain {self.domain}, process {self.pid}"


def runtime_folder() -> Path:
    """Folder of files that exist only while a tool runs, private to this user; made if it is not there."""
    runtime_place().mkdir(mode=0o700, parents=True, exist_ok=True)
    return runtime_place()


def runtime_place() -> Path:
    """Where that folder is, for who only looks; UsageError where it belongs to another user.

    systemd takes the folder of a service away while the service restarts.

    Returns
    -------
    Path
        As HINDRAX_RUNTIME_DIR names it, else below XDG_RUNTIME_DIR, else in /tmp per user; it may not exist.

    Raises
    ------
    UsageError
        Where the folder, or a link in its place, is another user's.
    """
    named = os.environ.get(FOLDER)
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if named:
        folder = Path(named)
    elif session and os.access(session, os.W_OK):
        folder = Path(session) / "hindrax"
    else:
        folder = Path(f"/tmp/hindrax-{os.getuid()}")  # noqa: S108  # per user, and not readable by others
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        # A link counts as well as the folder behind it: in /tmp anybody can make one that leads to a folder of ours.
        if {folder.lstat().st_uid, folder.stat().st_uid} != {os.getuid()}:
            raise UsageError(f"{folder}: belongs to another user; name a folder of your own in {FOLDER}")
    return folder


@contextlib.contextmanager
def announced(lock: StackLock) -> Iterator[Path]:
    """Leave the file for as long as the stack runs."""
    path = runtime_folder() / f"{lock.pid}.json"
    with locked(path, asdict(lock)):
        try:
            yield path
        finally:
            path.unlink(missing_ok=True)


def locked(path: Path, document: Mapping[str, object]) -> IO[str]:
    """Write a document and lock it until the file is closed, at the latest by the end of this process.

    Parameters
    ----------
    path
        Name that it gets once it is locked and complete: who looks never sees half of it.
    document
        Written as JSON.

    Returns
    -------
    IO[str]
        The open file, which holds the lock.

    Raises
    ------
    OSError
        Names the file, and leaves nothing.
    """
    draft = path.with_suffix(".draft")
    try:
        file = draft.open("w", encoding="utf-8")
        # Locked and complete before it gets the name by which others look for it.
        fcntl.flock(file, fcntl.LOCK_EX)
        json.dump(document, file)
        file.flush()
        draft.rename(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from error
    return file


def stacks() -> list[StackLock]:
    """Every stack of this user that runs now, the oldest first."""
    found = filter(None, map(_read, runtime_place().glob("*.json")))
    return sorted(found, key=lambda one: one.started_s)


def vehicle_stack() -> StackLock | None:
    """Return the stack of this user that controls the real output; a mock controls none."""
    return next((one for one in stacks() if not one.mock), None)


def _read(path: Path) -> StackLock | None:
    with contextlib.suppress(TypeError):  # of another version
        return None if (document := owned_document(path)) is None else StackLock(**document)
    return None


def owned_document(path: Path) -> Any:
    """Content of a lock file; None where its tool no longer holds it, and then the file is removed."""
    with contextlib.suppress(OSError, ValueError):
        while True:
            with path.open(encoding="utf-8") as file:
                try:
                    fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
                except BlockingIOError:
                    return json.load(file)
                # A heartbeat puts another file in this place, and then gives up the lock of the one opened here.
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                    path.unlink(missing_ok=True)
                    return None
    return None


def choose(found: list[StackLock], pid: int | None) -> StackLock | None:
    """Pick the stack that is meant: by its process, the only one, or the only one that waits for an operator.

    Parameters
    ----------
    found
        Stacks that run now.
    pid
        Process of the one that was named; None: none was.

    Returns
    -------
    StackLock | None
        None when none is announced.

    Raises
    ------
    UsageError
        Where no stack has this process, or several may be meant; lists them.
    """
    if pid is not None:
        mine = [one for one in found if one.pid == pid]
        if not mine:
            raise UsageError(f"--stack {pid}: no such stack; {_listed(found)}")
        return mine[0]
    waiting = [one for one in found if one.waits_for_operator]
    if len(waiting) == 1:
        return waiting[0]
    if len(found) > 1:
        raise UsageError(f"found {len(found)} stacks, wanted one: add --stack PID; {_listed(found)}")
    return found[0] if found else None


def require_meant(stack: StackLock, environment: Mapping[str, str]) -> None:
    """UsageError for a stack that a terminal can mean only by its number: of another domain, or of another clone."""
    domain, clone = ros_graph.exported_domain(environment), environment.get(CLONE, "")
    others = []
    if domain is not None and str(domain) != stack.domain:
        others.append(f"is in ROS domain {stack.domain}, and {ros_graph.DOMAIN}={domain} is set here")
    if clone and stack.clone and os.path.realpath(clone) != os.path.realpath(stack.clone):
        others.append(f"is of the clone {stack.clone}")
    if others:
        found = f"found {stack.whole_title}, which {' and '.join(others)}"
        raise UsageError(f"{found}; if you mean it, add --stack {stack.pid}")


def vehicle_name(file: str) -> str:
    """Name in a vehicle file; the file where it cannot be read."""
    try:
        return load_vehicle(file).name
    except UsageError:
        return file


def _listed(found: list[StackLock]) -> str:
    return "; ".join(f"{one.pid} ({one.title})" for one in found) or "none is up, start one with `./hindrax up`"
