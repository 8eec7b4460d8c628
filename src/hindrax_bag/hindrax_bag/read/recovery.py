"""Make a complete, indexed bag from an unfinished one, or a smaller bag from a complete one."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Message, Metadata, Schema
from mcap.records import Channel as ChannelRecord

from hindrax_bag.bag_index import channel_of
from hindrax_bag.definitions import share_lookup
from hindrax_bag.metadata import NAME, Channel, Contents, metadata_text
from hindrax_bag.read.bag_reader import EVERY, bag_files
from hindrax_bag.read.mcap_records import Damage, records
from hindrax_bag.read.sqlite_file import rows
from hindrax_bag.write.bag_file import BagFile
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.text_file import writing


@dataclass(frozen=True, slots=True)
class Recovered:
    """Result of a recovery: messages, folder, and damage."""

    output: Path
    messages: int
    lost_s: float
    notes: tuple[str, ...]


def everything(_topic: str, _after_s: float) -> bool:
    """Keep all messages."""
    return True


def recover(
    bag: Path,
    output: Path,
    progress: Callable[[int], None] = lambda _count: None,
    keep: Callable[[str, float], bool] = everything,
) -> Recovered:
    """Copy every readable record of a bag into a new one; `progress` gets the number of messages from time to time.

    `keep` chooses messages by topic and seconds since the first message of the bag.

    UsageError when the output exists or the bag is none; HindraxError when it cannot be written.
    """
    files = bag_files(bag)
    if output.exists() and any(output.iterdir() if output.is_dir() else [output]):
        raise UsageError(f"{output} exists already; name another folder with --out")
    damage = Damage()
    copy = _Copy(damage, progress, keep)
    with writing(output, "name another with --out"), _nothing_left(output):
        output.mkdir(parents=True, exist_ok=True)
        _copy_all(copy, files, output)
    return Recovered(output, copy.total, damage.lost_s, tuple(damage.notes))


def _copy_all(copy: _Copy, files: Sequence[Path], output: Path) -> None:
    for number, file in enumerate(files):
        copy.file(file, output / f"{output.name}_{number}.mcap")
    copy.finish(output)


@contextlib.contextmanager
def _nothing_left(folder: Path) -> Iterator[None]:
    """Remove a folder that holds a part only: of a bag that is none, on a full disk, or after Ctrl-C."""
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def copy_of(source: Path, target: Path) -> tuple[Contents, Damage]:
    """Copy the readable part of a file into a new, complete one; returns its contents and the damage."""
    damage = Damage()
    return _Copy(damage, lambda _count: None, everything).file(source, target), damage


class _Copy:
    """Copies files record by record and collects their contents for metadata.yaml."""

    def __init__(self, damage: Damage, progress: Callable[[int], None], keep: Callable[[str, float], bool]) -> None:
        self.total = 0
        self._begin: int | None = None
        self._damage, self._progress, self._keep = damage, progress, keep
        self._noted: dict[str, tuple[Channel, str, str]] = {}
        self._files: list[Contents] = []

    def file(self, source: Path, target: Path) -> Contents:
        """Copy the readable part of one file; a file of an sqlite3 bag becomes MCAP."""
        part = BagFile(target)
        if source.suffix == ".db3":
            self._rows(source, part)
        else:
            self._records(source, part)
        part.close()
        self._files.append(part.contents)
        return part.contents

    def _rows(self, source: Path, part: BagFile) -> None:
        for topic, schema, _, data, stamp in rows(source, None, share_lookup):
            if topic not in self._noted:
                self._channel(ChannelRecord(schema.id, topic, "cdr", {}, schema.id), schema)
            self._message(part, topic, data, stamp, stamp)

    def _records(self, source: Path, part: BagFile) -> None:
        schemas: dict[int, Schema] = {}
        topics: dict[int, str] = {}
        for record in records(source, self._damage):
            if isinstance(record, Message):
                self._message(part, topics.get(record.channel_id), record.data, record.log_time, record.publish_time)
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, ChannelRecord):
                topics[record.id] = self._channel(record, schemas.get(record.schema_id))
            elif isinstance(record, Attachment):
                part.attach(record.name, record.media_type, record.data, record.create_time)
            elif isinstance(record, Metadata):
                part.describe(record.name, record.metadata)

    def finish(self, output: Path) -> None:
        """Write metadata.yaml."""
        (output / NAME).write_text(metadata_text(self._files), encoding="utf-8")

    def _message(self, part: BagFile, topic: str | None, data: bytes, received: int, sent: int) -> None:
        if self._begin is None:
            self._begin = received
        if topic is None or not self._keep(topic, (received - self._begin) / NS_PER_S):
            return
        if not part.has(topic):
            self._open(part, topic)
        part.write(topic, data, received, sent)
        self.total += 1
        if self.total % EVERY == 0:
            self._progress(self.total)

    def _channel(self, record: ChannelRecord, schema: Schema | None) -> str:
        """Record a channel; it is opened with the first of its messages that is kept."""
        channel = channel_of(record, schema)
        text = schema.data.decode("utf-8", "replace") if schema else ""
        self._noted[record.topic] = (channel, text, schema.encoding if schema else "")
        return record.topic

    def _open(self, part: BagFile, topic: str) -> None:
        channel, text, encoding = self._noted[topic]
        part.open_channel(channel, text, encoding)
