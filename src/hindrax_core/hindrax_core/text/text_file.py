"""Files of text that are whole or as they were, and the question beforehand whether one can be written."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path

from hindrax_core.errors import HindraxError, UsageError, cause

NOTHING_BESIDE = (errno.EACCES, errno.EPERM, errno.EROFS, errno.EBUSY)
"""Of a folder that accepts no new file, or of a file that is a mount point."""
FAULT_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""With these the place is right and the work failed; any other error means that a wrong place was named."""
LEAST_ROOM_bytes = 1_000_000
"""More than any report, table or plot; the room that a place must have."""


def replace_text(file: Path, text: str) -> None:
    """Write a file atomically: a full disk, or a Ctrl-C, leaves the old content. OSError on failure."""
    target = file.resolve()
    if not target.exists() or target.is_file():  # a pipe or a terminal has nothing to keep
        try:
            _replace(target, text)
        except OSError as error:
            if error.errno not in NOTHING_BESIDE or not target.exists():
                raise
        else:
            return
    target.write_text(text, encoding="utf-8")


def _replace(target: Path, text: str) -> None:
    """Write a draft beside it, give it the owner and mode of what was there, and the name last."""
    draft = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with draft.open("x", encoding="utf-8") as stream:
            stream.write(text)
        if target.exists():
            was = target.stat()
            os.chown(draft, was.st_uid, was.st_gid)
            draft.chmod(stat.S_IMODE(was.st_mode))
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


def require_place(file: Path, option: str = "") -> None:
    """Try that a file can be written, before the work whose result it is to hold. The file stays as it was.

    Parameters
    ----------
    file
        Place of the result.
    option
        Option that named it, with a space, for the error; empty where the user named none.

    Raises
    ------
    UsageError, HindraxError
        Where it cannot be written, as of `writing`; the OSError of the system is its cause.
    """
    fresh = not file.exists()
    if not fresh and not (file.is_file() or file.is_dir()):
        return
    with writing(f"{option}{file}"), nothing_left(file):
        file.open("ab").close()
        disk = shutil.disk_usage(file.parent)
        if disk.total and disk.free < LEAST_ROOM_bytes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    if fresh:
        file.unlink(missing_ok=True)


@contextlib.contextmanager
def nothing_left(place: Path) -> Iterator[None]:
    """Remove a file, and empty folders down to it, that were not there before, when the block fails or is stopped."""
    fresh = [one for one in (place.absolute(), *place.absolute().parents) if not one.exists()]
    try:
        yield
    except BaseException:
        for one in fresh:
            with contextlib.suppress(OSError):  # a folder that holds more stays
                one.rmdir() if one.is_dir() else one.unlink()
        raise


@contextlib.contextmanager
def writing(place: Path | str, remedy: str = "make room or name another place") -> Iterator[None]:
    """Turn what goes wrong while a block writes into one sentence.

    Parameters
    ----------
    place
        What is written, for the error.
    remedy
        What the user can do.

    Yields
    ------
    None

    Raises
    ------
    UsageError
        For an OSError of the block, of a place that is not there, or where nobody may write.
    HindraxError
        For a disk that is full or fails.
    """
    try:
        yield
    except OSError as error:
        kind = HindraxError if error.errno in FAULT_OF_THE_DISK else UsageError
        raise kind(f"{place}: cannot be written ({cause(error)}); {remedy}") from error
