"""One MCAP file of a bag while it is written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from hindrax_bag.metadata import Channel, Contents, channel_metadata

LIBRARY = "hindrax"
CHUNK_BYTES = 262_144
BURST = 200
"""Messages that wait to be packed together: in a row it costs a third."""


class Part:
    """Writes one file: ROS 2 profile, zstd chunks with checksums, index at the end.

    A file is never overwritten: FileExistsError.
    """

    def __init__(self, path: Path, compression: CompressionType = CompressionType.ZSTD) -> None:
        self.path = path
        self.contents = Contents(path.name)
        self._numbers: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        self._mcap = Writer(self._file, chunk_size=CHUNK_BYTES, compression=compression, enable_data_crcs=True)
        self._mcap.start(profile="ros2", library=LIBRARY)
        self._waiting: list[tuple[str, bytes, int, int]] = []

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
        number = self._mcap.register_channel(
            channel.topic, "cdr", self._schemas[channel.type], channel_metadata(channel)
        )
        self._numbers[channel.topic] = number

    def write(self, topic: str, data: bytes, received: int, sent: int) -> None:
        """Append one message of an open channel, with the time of receipt and of sending [ns]."""
        self._waiting.append((topic, data, received, sent))
        if len(self._waiting) >= BURST:
            self._pack()

    def _pack(self) -> None:
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        add, numbers, contents = self._mcap.add_message, self._numbers, self.contents
        for topic, data, received, sent in waiting:
            add(numbers[topic], received, data, sent)
        times = [received for _, _, received, _ in waiting]
        contents.counts.update([topic for topic, _, _, _ in waiting])
        contents.last = max(contents.last, *times)
        contents.first = min(contents.first or times[0], *times)

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside."""
        self._mcap.add_attachment(create_time=stamp, log_time=stamp, name=name, media_type=media_type, data=data)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside."""
        self._mcap.add_metadata(name, dict(values))

    def flush(self, *, sync: bool = False) -> None:
        """Write the open chunk to disk; with `sync` also through the cache of the kernel (power loss)."""
        self._pack()
        self._mcap.flush()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        self._file.flush()
        if sync:
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file with its index."""
        self._pack()
        self._mcap.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def abandon(self) -> None:
        """Let go of the file without an index: the disk takes no more. `recover` completes it."""
        self._file.raw.close()
