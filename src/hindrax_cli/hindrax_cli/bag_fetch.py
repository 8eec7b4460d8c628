"""Bags from the vehicle over ssh: resumed where a copy broke off, and verified by checksum.

The vehicle needs nothing but a shell, `find`, `tail` and `sha256sum`. Whatever answers in its place cannot write
anywhere but into new or partial files below the folder that was named: its names and sizes are data.
"""

import hashlib
import os
import re
import shlex
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.text.received_names import path_fault

BLOCK = 1 << 18
PARTIAL = ".part"
SSH_FAILED = 255
"""Exit code of ssh when it came to no connection."""
SSH = "ssh -o BatchMode=yes -o ConnectTimeout=10"
Progress = Callable[[str, int, int], None]
"""Called with a file, its bytes here so far, and its size."""


@dataclass(frozen=True, slots=True)
class Remote:
    """Source of bags: a folder on a host that is reached with a command, or on this machine without one."""

    command: tuple[str, ...]
    folder: str

    def shell(self, line: str) -> list[str]:
        """Words of the process that runs a shell line there."""
        return [*self.command, line] if self.command else ["sh", "-c", line]

    def ask(self, line: str) -> str:
        """Output of a shell line; HindraxError with the end of its stderr when it fails."""
        try:
            done = subprocess.run(  # noqa: S603  # quoted
                self.shell(line), capture_output=True, text=True, errors="surrogateescape", check=False
            )
        except OSError as error:
            remedy = "install it, or name another with --ssh"
            raise HindraxError(f"{self.command[0]}: cannot be run ({cause(error)}); {remedy}") from error
        if done.returncode != 0:
            silent = f"{self.shell('')[0]} printed nothing"
            words = (done.stderr.strip().splitlines() or [silent])[-1]
            remedy = "--remote names the folder"
            if self.command and done.returncode == SSH_FAILED:
                remedy = f"is it on the network, and does `ssh {self.command[-1]}` ask for no password?"
            raise HindraxError(f"{self.name}: cannot be read ({words}); {remedy}")
        return done.stdout

    @property
    def name(self) -> str:
        """Name for messages."""
        return ":".join((*self.command[-1:], self.folder))


def remote_of(host: str, folder: str, ssh: str | None) -> Remote:
    """Read where bags are fetched from.

    Parameters
    ----------
    host
        `name` or `user@name` as ssh takes it; with a slash: a folder of this machine.
    folder
        On the host, or within that folder.
    ssh
        Command in the place of `SSH`; None: that.

    Returns
    -------
    Remote
        How its commands are run, and the folder.

    Raises
    ------
    UsageError
        For an empty host, or one that ssh would take for an option.
    """
    if not host:
        raise UsageError("HOST is empty; name the vehicle, such as pi@rov.local, or a folder")
    if host.startswith("-") or not host.isprintable():
        raise UsageError(f"HOST: found {host!r}, wanted one as ssh takes it (pi@rov.local), or a folder (./-x)")
    if "/" in host:
        return Remote((), str(PurePosixPath(host) / folder) if folder else host)
    return Remote((*shlex.split(ssh or SSH), host), folder)


def fetch(remote: Remote, out: Path, progress: Progress) -> dict[Path, int]:
    """Copy all files below the remote folder that are not here yet.

    Parameters
    ----------
    remote
        Host and folder.
    out
        Folder here; files have the same place in it.
    progress
        Gets how far it is.

    Returns
    -------
    dict[Path, int]
        Every file, verified, with the number of its bytes that came this time.

    Raises
    ------
    HindraxError
        When there is none, when one cannot be had whole, or cannot be written here.
    """
    found = _listing(remote)
    if not found:
        raise HindraxError(f"{remote.name}: holds no file; --remote names the folder of the bags")
    try:
        return dict(_fetch_one(remote, name, size, out, progress) for name, size in found)
    except OSError as error:
        place = error.filename or out
        raise HindraxError(f"{place}: cannot be written ({cause(error)}); name another with --out") from error


def _listing(remote: Remote) -> list[tuple[str, int]]:
    """Names and sizes of all files there; HindraxError for a name of which no path may be made here."""
    line = f"cd -- {shlex.quote(remote.folder)} && find . -type f -printf '%s %P\\0'"
    pairs = [row.partition(" ") for row in remote.ask(line).split("\0") if row]
    for size, _, name in pairs:
        fault = path_fault(name) or ("" if size.isascii() and size.isdigit() else f"has a size of {size[:20]!r}")
        if fault:
            raise HindraxError(f"{remote.name}: found {name!r}, which {fault}; nothing was fetched, rename it there")
    return sorted((name, int(size)) for size, _, name in pairs)


def _place(out: Path, name: str) -> Path:
    """Path of a file here; HindraxError where a link would lead from it to somewhere else."""
    path = out
    for part in PurePosixPath(name).parts:
        path /= part
        if path.is_symlink():
            raise HindraxError(f"{path}: is a link, and files are fetched into none; remove it, or use another --out")
    return path


def _fetch_one(remote: Remote, name: str, size: int, out: Path, progress: Progress) -> tuple[Path, int]:
    target, partial = _place(out, name), _place(out, f"{name}{PARTIAL}")
    answer = remote.ask(f"sha256sum < {shlex.quote(remote.folder + '/' + name)}")
    wanted = answer.partition(" ")[0].strip()
    if not re.fullmatch(r"[0-9a-f]{64}", wanted):
        raise HindraxError(f"{name}: found {answer[:80]!r} for its checksum, wanted the one that sha256sum gives there")
    if target.is_file() and _hash(target) == wanted:
        return target, 0
    partial.parent.mkdir(parents=True, exist_ok=True)
    copied = _copy(remote, name, size, partial, progress)
    if _hash(partial) != wanted:
        # The part from an earlier try belongs to another file: fetch it again from its start.
        partial.unlink()
        copied = _copy(remote, name, size, partial, progress)
    if _hash(partial) != wanted:
        raise HindraxError(f"{name}: the checksum differs after copying; is it still being recorded?")
    partial.replace(target)
    return target, copied


def _copy(remote: Remote, name: str, size: int, partial: Path, progress: Progress) -> int:
    """Append what is missing; returns the bytes that came."""
    here = start = partial.stat().st_size if partial.exists() else 0
    line = f"tail -c +{start + 1} -- {shlex.quote(remote.folder + '/' + name)}"
    with (
        os.fdopen(os.open(partial, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666), "ab") as file,
        subprocess.Popen(remote.shell(line), stdout=subprocess.PIPE) as process,  # noqa: S603  # quoted above
    ):
        assert process.stdout is not None
        while block := process.stdout.read(BLOCK):
            here += len(block)
            if here > size:
                process.kill()
                raise HindraxError(f"{name}: more than its {size} bytes came; is it still being recorded?")
            file.write(block)
            progress(name, here, size)
    if process.returncode != 0:
        raise HindraxError(f"{name}: the copy stopped after {here} of {size} bytes; run it again to resume")
    return here - start


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
