"""Files of a bag, their completeness, and metadata.yaml from the summaries at their ends."""

from __future__ import annotations

import fcntl
import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from mcap.reader import make_reader
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from mcap.writer import MCAP0_MAGIC

from hindrax_bag.metadata import NAME, OFFERED, TYPE_HASH, Channel, Contents, metadata_text, qualities_of
from hindrax_core.topics import TOPICS, Quality, resolved

DESCRIPTION = "hindrax"
"""Name of the metadata record in which the recorder describes the run."""
QUALITIES = {resolved(topic): topic.quality for topic in TOPICS}


def parts(folder: Path) -> list[Path]:
    """MCAP files of a bag folder in the order of their numbers."""
    return sorted(folder.glob("*.mcap"), key=part_number)


def part_number(path: Path) -> tuple[int, str]:
    """Number at the end of the name of a file of a bag, 0 without one; and the name."""
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isdigit() else 0, path.name)


def is_whole(file: Path) -> bool:
    """Whether a file is complete, by its last bytes."""
    with file.open("rb") as stream:
        stream.seek(max(0, file.stat().st_size - len(MCAP0_MAGIC)))
        return stream.read() == MCAP0_MAGIC


def try_lock(stream: IO[Any] | int) -> bool:
    """Lock an open file or folder until it is closed; False if another process holds the lock."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def channel_of(record: ChannelRecord, schema: Schema | None) -> Channel:
    """Topic as declared in a file; without a declared quality, that of our table."""
    offered = qualities_of(record.metadata.get(OFFERED, "")) or (QUALITIES.get(record.topic, Quality()),)
    return Channel(record.topic, schema.name if schema else "", offered, record.metadata.get(TYPE_HASH, ""))


def contents_of(file: Path) -> Contents:
    """Contents of a complete file, from its summary."""
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        return Contents(file.name)
    told = summary.statistics
    channels = tuple(channel_of(one, summary.schemas.get(one.schema_id)) for one in summary.channels.values())
    counts = Counter({summary.channels[number].topic: count for number, count in told.channel_message_counts.items()})
    return Contents(file.name, counts, told.message_start_time, told.message_end_time, channels)


def write_metadata(folder: Path, known: Mapping[str, Contents]) -> None:
    """Write metadata.yaml for the complete files of a bag; those in `known`, by name, are not read again.

    It is on the disk before it has its name: a power cut leaves none, or a whole one.
    """
    whole = [known.get(file.name) or contents_of(file) for file in parts(folder) if is_whole(file)]
    fresh = folder / f"{NAME}.fresh"
    with fresh.open("w", encoding="utf-8") as out:
        out.write(metadata_text(whole))
        out.flush()
        os.fsync(out.fileno())
    fresh.replace(folder / NAME)
