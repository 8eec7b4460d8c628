"""One MCAP file of a bag while it is written."""

import fcntl
import os
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from hindrax_bag.metadata import Channel, Contents, channel_metadata

LIBRARY = "hindrax"
CHUNK_BYTES = 262_144


class BagFile:
    """Writes one file: ROS 2 profile, zstd chunks with checksums, index at the end.

    A file is never overwritten: FileExistsError. It is locked as long as it is written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.contents = Contents(path.name)
        """What was written so far."""
        self._numbers: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self._mcap = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._mcap.start("ros2", LIBRARY)

    @property
    def size_bytes(self) -> int:
        """Bytes written so far; the open chunk is not among them."""
        return self._file.tell()

    def has(self, topic: str) -> bool:
        """Whether the channel of a topic is open."""
        return topic in self._numbers

    def open_channel(self, channel: Channel, definition: str, encoding: str = "ros2msg") -> None:
        """Declare a topic and, where it is the first of its type, its schema."""
        if channel.type not in self._schemas:
            self._schemas[channel.type] = self._mcap.register_schema(channel.type, encoding, definition.encode())
        schema, metadata = self._schemas[channel.type], channel_metadata(channel)
        self._numbers[channel.topic] = self._mcap.register_channel(channel.topic, "cdr", schema, metadata)
        self.contents.channels += (channel,)

    def write(self, topic: str, data: bytes, received: int, sent: int) -> None:
        """Append one message of an open channel, with the time of receipt and of sending [ns]."""
        self._mcap.add_message(self._numbers[topic], received, data, sent)
        contents = self.contents
        contents.counts[topic] += 1
        if received < contents.first or not contents.first:
            contents.first = received
        contents.last = max(received, contents.last)

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside."""
        self._mcap.add_attachment(stamp, stamp, name, media_type, data)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside."""
        self._mcap.add_metadata(name, dict(values))

    def flush(self, *, sync: bool) -> None:
        """Write the open chunk to disk; with `sync` also through the cache of the kernel (power loss)."""
        self._mcap.flush()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        if sync:
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file with its index."""
        self._mcap.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def abandon(self) -> None:
        """Close the file without an index because the disk is full. `recover` completes it."""
        self._file.raw.close()
