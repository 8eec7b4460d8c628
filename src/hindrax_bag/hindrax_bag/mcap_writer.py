"""MCAP files, written: chunks with zstd and checksums, an index of every message, a summary at the end.

The records are those of the `mcap` package. Only messages are put together here: its own writer takes six calls and a
buffer for each, while a recorder sees thousands a second. See mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from hindrax_bag.mcap_records import MAGIC

CHUNK_BYTES = 262_144
_MESSAGE = struct.Struct("<BQHIQQ")
_INDEX = struct.Struct("<BQHI")
_FOOTER = struct.Struct("<BQQQ")
FOOTER_BYTES = 20
FIXED_BYTES = 22
"""Of a message: channel, sequence, two times."""


class _Record(Protocol):
    def write(self, stream: RecordBuilder) -> None: ...


def packed(*records: _Record) -> bytes:
    """Bytes of records, one after the other."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]  # mcap leaves out its annotation


@dataclass(slots=True)
class Held:
    """Messages of one channel: how many there are, and times of receipt and places of those in the open chunk."""

    count: int = 0
    places: list[int] = field(default_factory=list)


class McapWriter:
    """Writes one file. What is added is in the file after `flush`, and can be found by its index after `finish`."""

    def __init__(self, file: BinaryIO, library: str) -> None:
        self._file, self._crc = file, 0
        self._compress: Callable[[bytes], bytes] = zstandard.ZstdCompressor().compress
        self._chunk: list[bytes] = []
        self._at = 0
        self._held: dict[int, Held] = {}
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self.first = self.last = 0
        """Times of receipt in the chunks that are written [ns]."""
        self._put(MAGIC)
        self._put(packed(Header("ros2", library)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a type; returns its number."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._collect(packed(self._schemas[-1]))
        return len(self._schemas)

    def add_channel(self, topic: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Declare a topic with CDR messages; returns its number."""
        number = len(self._channels) + 1
        self._channels.append(
            Channel(id=number, topic=topic, message_encoding="cdr", metadata=dict(metadata), schema_id=schema)
        )
        self._collect(packed(self._channels[-1]))
        self._held[number] = Held()
        return number

    def add_message(self, number: int, data: bytes, received: int, sent: int) -> None:
        """Append one message of a channel, with its times [ns]."""
        size = FIXED_BYTES + len(data)
        self._held[number].places += (received, self._at)
        self._chunk += (_MESSAGE.pack(Opcode.MESSAGE, size, number, 0, received, sent), data)
        self._at += 9 + size
        if self._at > CHUNK_BYTES:
            self._end_chunk()

    def add_attachment(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside."""
        begin, one = self._file.tell(), Attachment(stamp, stamp, name, media_type, data)
        size = self._put(packed(one))
        self._attachments.append(AttachmentIndex(begin, size, stamp, stamp, len(data), name, media_type))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Put keys and values inside."""
        begin = self._file.tell()
        size = self._put(packed(Metadata(name, dict(values))))
        self._metadata.append(MetadataIndex(begin, size, name))

    def count(self, number: int) -> int:
        """Messages of a channel in the chunks that are written."""
        return self._held[number].count

    def flush(self) -> None:
        """Write the open chunk."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the open chunk, the summary and the end."""
        self._end_chunk()
        self._put(packed(DataEnd(self._crc)))
        begin, at = self._file.tell(), 0
        summary, offsets = b"", list[SummaryOffset]()
        for opcode, group in self._summary():
            data = packed(*group)
            offsets.append(SummaryOffset(opcode, begin + at, len(data)))
            summary, at = summary + data, at + len(data)
        summary += packed(*offsets)
        head = _FOOTER.pack(Opcode.FOOTER, FOOTER_BYTES, begin, begin + at)
        footer = Footer(begin, begin + at, zlib.crc32(head, zlib.crc32(summary)))
        self._file.write(summary + packed(footer) + MAGIC)
        self._file.flush()

    def _put(self, data: bytes) -> int:
        """Write to the data section; returns the size."""
        self._crc = zlib.crc32(data, self._crc)
        return self._file.write(data)

    def _collect(self, data: bytes) -> None:
        self._chunk.append(data)
        self._at += len(data)

    def _end_chunk(self) -> None:
        """Write what was collected as a chunk with its index; a chunk without messages waits for the first."""
        held = {number: one for number, one in self._held.items() if one.places}
        if not held:
            return
        data = b"".join(self._chunk)
        self._chunk, self._at = [], 0
        times = [time for one in held.values() for time in one.places[::2]]
        start, end = min(times), max(times)
        self.first, self.last = min(self.first or start, start), max(self.last, end)
        chunk = Chunk("zstd", self._compress(data), end, start, zlib.crc32(data), len(data))
        begin = self._file.tell()
        size = self._put(packed(chunk))
        index, offsets = b"", dict[int, int]()
        for number, one in held.items():
            offsets[number] = begin + size + len(index)
            index += _index(number, one.places)
            one.count += len(one.places) // 2
            one.places.clear()
        self._put(index)
        self._chunks.append(
            ChunkIndex(size, begin, "zstd", len(chunk.data), end, len(index), offsets, start, len(data))
        )

    def _summary(self) -> Sequence[tuple[Opcode, Sequence[_Record]]]:
        counts = {number: one.count for number, one in self._held.items() if one.count}
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=counts,
            chunk_count=len(self._chunks),
            message_count=sum(counts.values()),
            message_end_time=self.last,
            message_start_time=self.first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: Iterable[tuple[Opcode, Sequence[_Record]]] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        return [group for group in groups if group[1]]


def _index(number: int, places: list[int]) -> bytes:
    """Message index of one channel: times of receipt and places within the chunk, in turn."""
    size = 8 * len(places)
    return _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + size, number, size) + struct.pack(f"<{len(places)}Q", *places)
