"""One MCAP file of a bag while it is written."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from hindrax_bag.mcap_writer import McapWriter
from hindrax_bag.metadata import Channel, Contents, channel_metadata

LIBRARY = "hindrax"


class Part:
    """Writes one file: ROS 2 profile, zstd chunks with checksums, index at the end.

    A file is never overwritten: FileExistsError.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._numbers: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        self._mcap = McapWriter(self._file, LIBRARY)

    @property
    def size_bytes(self) -> int:
        """Bytes written so far; the open chunk is not among them."""
        return self._file.tell()

    @property
    def contents(self) -> Contents:
        """What was written so far; the open chunk is not among it."""
        mcap = self._mcap
        counts = Counter({topic: mcap.count(number) for topic, number in self._numbers.items()})
        return Contents(self.path.name, +counts, mcap.first, mcap.last)

    def has(self, topic: str) -> bool:
        """Whether the channel of a topic is open."""
        return topic in self._numbers

    def open_channel(self, channel: Channel, definition: str, encoding: str = "ros2msg") -> None:
        """Declare a topic and, where it is the first of its type, its schema."""
        if channel.type not in self._schemas:
            self._schemas[channel.type] = self._mcap.add_schema(channel.type, encoding, definition.encode())
        schema = self._schemas[channel.type]
        self._numbers[channel.topic] = self._mcap.add_channel(channel.topic, schema, channel_metadata(channel))

    def write(self, topic: str, data: bytes, received: int, sent: int) -> None:
        """Append one message of an open channel, with the time of receipt and of sending [ns]."""
        self._mcap.add_message(self._numbers[topic], data, received, sent)

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside."""
        self._mcap.add_attachment(name, media_type, data, stamp)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside."""
        self._mcap.add_metadata(name, values)

    def flush(self, *, sync: bool = False) -> None:
        """Write the open chunk to disk; with `sync` also through the cache of the kernel (power loss)."""
        self._mcap.flush()
        if sync:
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file with its index."""
        self._mcap.finish()
        os.fsync(self._file.fileno())
        self._file.close()

    def abandon(self) -> None:
        """Let go of the file without an index: the disk takes no more. `recover` completes it."""
        self._file.raw.close()
