"""Make a complete, indexed bag from an unfinished one, or a smaller bag from a complete one.

Beside the recorder, `python -m hindrax_bag.read.recovery FILE...` completes files in place: a recorder that was killed
leaves its last file without an index, which other readers refuse. Each such file is copied as far as it can be read,
and the copy takes its place. A file that is still written is left alone.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Metadata

from hindrax_bag.metadata import (
    NAME,
    Contents,
    channel_of,
    is_whole,
    metadata_text,
    parts,
    try_lock,
    write_metadata,
)
from hindrax_bag.read.bag_reader import EVERY, BagMessage, bag_files, beside_messages, messages
from hindrax_bag.read.mcap_records import BROKEN, Damage
from hindrax_bag.write.bag_writer import BagFile
from hindrax_bag.write.limits import free_bytes
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.text_file import nothing_left, writing

NICENESS = 10
SUFFIX, DAMAGED = ".completed", ".damaged"


@dataclass(frozen=True, slots=True)
class Recovered:
    """Result of a recovery: messages, folder, and damage."""

    output: Path
    messages: int
    lost_s: float
    notes: tuple[str, ...]
    unreadable: tuple[str, ...] = ()
    """Topics whose messages nobody can decode: neither in the bag, nor in its copy."""


def everything(_topic: str, _after_s: float) -> bool:
    """Keep all messages."""
    return True


def recover(
    bag: Path,
    output: Path,
    progress: Callable[[int], None] = lambda _count: None,
    keep: Callable[[str, float], bool] = everything,
) -> Recovered:
    """Copy every readable record of a bag into a new one.

    Parameters
    ----------
    bag
        Folder or file.
    output
        Folder of the copy, empty or new.
    progress
        Is told the number of messages from time to time.
    keep
        Chooses messages by topic, named as `messages` names it, and seconds since the first message of the bag.

    Returns
    -------
    Recovered
        What was copied, and what was lost.

    Raises
    ------
    UsageError
        When the output exists or the path is no bag.
    HindraxError
        When it cannot be written, or when what was written does not read back.
    """
    files = bag_files(bag)
    if output.exists() and any(output.iterdir() if output.is_dir() else [output]):
        raise UsageError(f"{output} exists already; name another folder with --out")
    copy = _Copy(progress, keep)
    with writing(output, "name another with --out"), nothing_left(output), _nothing_inside(output):
        output.mkdir(parents=True, exist_ok=True)
        contents = [copy.file(file, output / f"{output.name}_{number}.mcap") for number, file in enumerate(files)]
        (output / NAME).write_text(metadata_text(contents), encoding="utf-8")
        _require_same(output, copy.total)
    return Recovered(output, copy.total, copy.damage.lost_s, tuple(copy.damage.notes), tuple(copy.unreadable))


def _require_same(written: Path, count: int) -> None:
    """Read a copy back, with its checksums; HindraxError when it holds less than was written."""
    damage = Damage()
    found = sum(1 for _ in messages(written, damage=damage))
    if found != count or damage.notes:
        why = f" ({damage.notes[0]})" if damage.notes else ""
        raise HindraxError(f"{written}: {count} messages were written, {found} can be read back{why}; check the disk")


@contextlib.contextmanager
def _nothing_inside(folder: Path) -> Iterator[None]:
    """Empty a folder with a partial result: of an invalid bag, on a full disk, or after Ctrl-C."""
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def copy_of(source: Path, target: Path) -> tuple[Contents, Damage]:
    """Copy the readable part of a file into a new, complete one; returns its contents and the damage."""
    copy = _Copy(lambda _count: None, everything)
    return copy.file(source, target), copy.damage


class _Copy:
    """Copies files record by record."""

    def __init__(self, progress: Callable[[int], None], keep: Callable[[str, float], bool]) -> None:
        self.total, self.damage = 0, Damage()
        self.unreadable: list[str] = []
        self._begin: int | None = None
        self._progress, self._keep = progress, keep

    def file(self, source: Path, target: Path) -> Contents:
        """Copy the readable part of one file; other kinds of bag become MCAP, and compressed messages plain ones."""
        part = BagFile(target)
        for record in beside_messages(source):
            if isinstance(record, Attachment):
                part.attach(record.name, record.media_type, record.data, record.create_time)
            elif isinstance(record, Metadata):
                part.describe(record.name, record.metadata)
        for message in messages(source, damage=self.damage):
            self._message(part, message)
        part.close()
        return part.contents

    def _message(self, part: BagFile, message: BagMessage) -> None:
        if self._begin is None:
            self._begin = message.received
        if not self._keep(message.topic, (message.received - self._begin) / NS_PER_S):
            return
        form = message.form
        topic = form.channel.topic
        if not part.has(topic):
            encoding = form.schema.encoding if form.schema else ""
            part.open_channel(channel_of(form.channel, form.schema), form.definition, encoding)
            self._try_to_decode(message)
        part.write(topic, message.data, message.received, message.sent)
        self.total += 1
        if self.total % EVERY == 0:
            self._progress(self.total)

    def _try_to_decode(self, message: BagMessage) -> None:
        """Note a topic whose first message does not fit its definition: it is copied, and nobody can read it."""
        try:
            message.decoded()
        except (HindraxError, *BROKEN) as error:
            self.unreadable.append(message.topic)
            self.damage.notes.append(
                f"{message.topic}: its messages are not of {message.type} ({error.__cause__ or error}); copied unread"
            )


def begin_completion(files: Sequence[Path]) -> subprocess.Popen[bytes] | None:
    """Complete files in a separate process, so that the flight is not disturbed; None without files."""
    if not files:
        return None
    return subprocess.Popen([sys.executable, "-m", "hindrax_bag.read.recovery", *files])  # noqa: S603  # our own interpreter and module


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
    """Replace an unfinished file by a complete copy.

    One without any message is removed. Where more than the end is damaged, the file is kept beside its copy.

    Parameters
    ----------
    file
        Of a bag; one that is still written is left alone.

    Returns
    -------
    str
        A sentence about what was done, or why it was not.
    """
    target = file.with_name(file.name + SUFFIX)
    with file.open("rb") as stream:
        if not try_lock(stream):
            return f"{file}: is still being written, skipped"
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
    if sys.platform != "win32":
        os.nice(NICENESS)
    files = [Path(word) for word in sys.argv[1:]]
    for file in files:
        sys.stderr.write(f"{complete(file)}\n")
    for bag in {file.parent for file in files}:
        write_metadata(bag, {})
    return 0


if __name__ == "__main__":
    sys.exit(main())
