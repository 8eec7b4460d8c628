"""Complete unfinished files of bags in place: `python -m hindrax_bag.read.completion FILE...`, beside the recorder.

A recorder that was killed leaves its last file without an index, which other readers refuse. Each such file is copied
as far as it can be read, and the copy takes its place. A file that is still written is left alone.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from hindrax_bag.bag_index import is_whole, parts, try_lock, write_metadata
from hindrax_bag.read.recovery import copy_of
from hindrax_bag.write.limits import free_bytes
from hindrax_core.errors import HindraxError

NICENESS = 10
SUFFIX = ".completed"
DAMAGED = ".damaged"


def begin_completion(files: Sequence[Path]) -> subprocess.Popen[bytes] | None:
    """Complete files in a separate process, so that the flight is not disturbed; None without files."""
    if not files:
        return None
    return subprocess.Popen([sys.executable, "-m", "hindrax_bag.read.completion", *files])  # noqa: S603  # our own interpreter and module


def unfinished_files(folder: Path) -> list[Path]:
    """Unfinished files of all bags in a folder and in the folders below it, but for bags that are being recorded."""
    bags = {file.parent for file in folder.rglob("*.mcap")}
    return [file for bag in sorted(bags) if _at_rest(bag) for file in parts(bag) if not is_whole(file)]


def _at_rest(bag: Path) -> bool:
    number = os.open(bag, os.O_RDONLY)
    try:
        return try_lock(number)
    finally:
        os.close(number)


def complete(file: Path) -> str:
    """Replace an unfinished file by a complete copy; returns a sentence about it.

    One without any message is removed. Where more than the end is damaged, the file is kept beside its copy.
    """
    target = file.with_name(file.name + SUFFIX)
    with file.open("rb") as stream:
        if not try_lock(stream):
            return f"{file}: is still written, left alone"
        try:
            return f"{file}: was left unfinished; {_replaced(file, target)}"
        except (HindraxError, OSError) as error:
            return f"{file}: was left unfinished and cannot be completed ({error}); try ./hindrax bag recover"
        finally:
            target.unlink(missing_ok=True)


def _replaced(file: Path, target: Path) -> str:
    free, wanted = free_bytes(file.parent), file.stat().st_size
    if free < wanted:
        raise HindraxError(f"{free // 1_000_000} MB are free, {wanted // 1_000_000} MB are wanted for a copy")
    target.unlink(missing_ok=True)
    contents, damage = copy_of(file, target)
    if damage.left_out:
        os.link(file, file.with_name(file.name + DAMAGED))
    if not file.exists():
        return "dropped meanwhile"
    if not contents.messages:
        file.unlink()
        return "removed, as it holds no message"
    target.replace(file)
    return f"completed, {contents.messages} messages"


def main() -> int:
    """Complete the files that are named, and write metadata.yaml of their bags."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    files = [Path(word) for word in sys.argv[1:]]
    for file in files:
        sys.stderr.write(f"{complete(file)}\n")
    for bag in {file.parent for file in files}:
        write_metadata(bag, {})
    return 0


if __name__ == "__main__":
    sys.exit(main())
