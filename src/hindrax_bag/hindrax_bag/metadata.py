"""Files of a bag, their completeness, and metadata.yaml as rosbag2 of ROS 2 Jazzy writes it beside them (version 9)."""

import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import yaml
from mcap.reader import make_reader
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from mcap.writer import MCAP0_MAGIC

from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.topics import TOPICS, Quality, resolved

if sys.platform != "win32":
    import fcntl

METADATA_VERSION = 9
FOREVER = {"sec": 9223372036, "nsec": 854775807}
SHORTEST_FOREVER_S = 2_000_000_000
"""A duration this long is no limit: middlewares and versions of rosbag2 have several."""
NAME = "metadata.yaml"
OFFERED, TYPE_HASH = "offered_qos_profiles", "topic_type_hash"
COMPRESSED = (".zstd", ".zst", ".lz4")
"""Suffixes of a file that is compressed as a whole, behind its own: bag_0.mcap.zstd."""
DESCRIPTION = "hindrax"
"""Name of the metadata record in which the recorder describes the run."""
QUALITIES = {resolved(topic): topic.quality for topic in TOPICS}


@dataclass(frozen=True, slots=True)
class Channel:
    """One recorded topic: full name, type as `package/msg/Type`, qualities offered, RIHS01 hash (or empty)."""

    topic: str
    type: str
    offered: tuple[Quality, ...] = (Quality(),)
    type_hash: str = ""


@dataclass(slots=True)
class Contents:
    """Contents of one file of a bag: messages by topic, first and last time of receipt [ns], and its topics."""

    name: str
    counts: Counter[str] = field(default_factory=Counter)
    first: int = 0
    last: int = 0
    channels: tuple[Channel, ...] = ()

    @property
    def messages(self) -> int:
        """Number of messages in the file."""
        return self.counts.total()


def metadata_text(files: Sequence[Contents]) -> str:
    """Text of metadata.yaml for these files of a bag, in their order."""
    totals = sum((file.counts for file in files), Counter[str]())
    channels = {channel.topic: channel for file in files for channel in file.channels}
    held = [file for file in files if file.messages]
    first = min((file.first for file in held), default=0)
    last = max((file.last for file in held), default=0)
    information = {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": totals.total(),
        "topics_with_message_count": [_topic(one, totals[one.topic]) for one in channels.values()],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                "starting_time": {"nanoseconds_since_epoch": file.first},
                "duration": {"nanoseconds": file.last - file.first},
                "message_count": file.messages,
            }
            for file in files
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    return yaml.dump({"rosbag2_bagfile_information": information}, Dumper=_NoAliases, sort_keys=False)


def _topic(channel: Channel, count: int) -> dict[str, object]:
    return {
        "topic_metadata": {
            "name": channel.topic,
            "type": channel.type,
            "serialization_format": "cdr",
            OFFERED: [qos_map(one) for one in channel.offered],
            "type_description_hash": channel.type_hash,
        },
        "message_count": count,
    }


def qos_map(quality: Quality) -> dict[str, Any]:
    """Quality of service in the terms of rosbag2."""
    return {
        "history": "keep_last",
        "depth": quality.depth,
        "reliability": "reliable" if quality.reliable else "best_effort",
        "durability": "transient_local" if quality.latched else "volatile",
        "deadline": _duration(quality.deadline_s),
        "lifespan": _duration(quality.lifespan_s),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(FOREVER),
        "avoid_ros_namespace_conventions": False,
    }


def qualities_of(text: str) -> tuple[Quality, ...]:
    """Qualities from the text that rosbag2 writes to a channel; none if the text is unknown."""
    try:
        return tuple(_quality(one) for one in read_yaml(text, "qualities") or ())
    except (UsageError, AttributeError, KeyError, TypeError, ValueError):
        return ()


def _quality(found: Mapping[str, Any]) -> Quality:
    """Undo `qos_map`; versions before 9 wrote numbers for the names."""
    return Quality(
        reliable=found["reliability"] not in {"best_effort", 2},
        depth=int(found["depth"]) or Quality().depth,
        latched=found["durability"] in {"transient_local", 1},
        deadline_s=_seconds(found["deadline"]),
        lifespan_s=_seconds(found["lifespan"]),
    )


def _seconds(found: Mapping[str, int]) -> float:
    return 0.0 if found["sec"] >= SHORTEST_FOREVER_S else found["sec"] + found["nsec"] / NS_PER_S


def channel_metadata(channel: Channel) -> dict[str, str]:
    """Metadata that rosbag2 writes to a channel inside an MCAP file."""
    return {
        OFFERED: yaml.dump([qos_map(one) for one in channel.offered], Dumper=_NoAliases, sort_keys=False),
        TYPE_HASH: channel.type_hash,
    }


def _duration(seconds: float) -> dict[str, int]:
    return {"sec": int(seconds), "nsec": round(seconds % 1.0 * 1e9)} if seconds else dict(FOREVER)


class _NoAliases(yaml.SafeDumper):
    def ignore_aliases(self, _data: object) -> bool:
        return True


def parts(folder: Path) -> list[Path]:
    """MCAP files of a bag folder in the order of their numbers."""
    return sorted(folder.glob("*.mcap"), key=part_number)


def part_number(path: Path) -> tuple[int, str]:
    """Number at the end of the name of a file of a bag, 0 without one; and the name."""
    stem = Path(path.stem).stem if path.suffix in COMPRESSED else path.stem
    number = stem.rpartition("_")[2]
    return (int(number) if number.isdigit() else 0, path.name)


def missing_parts(found: Sequence[Path]) -> tuple[str, ...]:
    """Files of a bag that metadata.yaml has and its folder lacks.

    Parameters
    ----------
    found
        Those that are there, at least one.

    Returns
    -------
    tuple[str, ...]
        Names; none where as many are there under other names: a bag that was renamed, or compressed since.
    """
    try:
        text = (found[0].parent / NAME).read_text(encoding="utf-8")
        names = [str(name) for name in read_yaml(text, NAME)["rosbag2_bagfile_information"]["relative_file_paths"]]
    except (UsageError, OSError, ValueError, LookupError, TypeError):
        return ()
    there = {file.name for file in found}
    return tuple(name for name in names if name not in there) if len(names) > len(found) else ()


def is_whole(file: Path) -> bool:
    """Whether a file is complete, by its last bytes."""
    with file.open("rb") as stream:
        stream.seek(max(0, file.stat().st_size - len(MCAP0_MAGIC)))
        return stream.read() == MCAP0_MAGIC


def try_lock(stream: IO[bytes] | IO[str] | int) -> bool:
    """Lock an open file or folder until it is closed; False if another process holds the lock."""
    # On Windows no recorder runs against which a bag would have to be locked.
    if sys.platform != "win32":
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def lock(stream: IO[bytes] | IO[str]) -> None:
    """Lock an open file until it is closed; wait for whoever has it locked."""
    if sys.platform != "win32":
        fcntl.flock(stream, fcntl.LOCK_EX)


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
    stats = summary.statistics
    channels = tuple(channel_of(one, summary.schemas.get(one.schema_id)) for one in summary.channels.values())
    counts = Counter({summary.channels[number].topic: count for number, count in stats.channel_message_counts.items()})
    return Contents(file.name, counts, stats.message_start_time, stats.message_end_time, channels)


def write_metadata(folder: Path, known: Mapping[str, Contents]) -> None:
    """Write metadata.yaml for the complete files of a bag.

    It is on the disk before it has its name: a power cut leaves none, or a whole one.

    Parameters
    ----------
    folder
        The bag.
    known
        Contents of files, by name, which are not read again.
    """
    whole: list[Contents] = []
    for file in parts(folder):
        with suppress(FileNotFoundError):  # another process completes or drops what an earlier recorder left
            whole += [known.get(file.name) or contents_of(file)] if is_whole(file) else []
    fresh = folder / f"{NAME}.fresh"
    with fresh.open("w", encoding="utf-8") as out:
        out.write(metadata_text(whole))
        out.flush()
        os.fsync(out.fileno())
    fresh.replace(folder / NAME)
