"""Records of an MCAP file, complete, unfinished or damaged: reads what is readable and reports the rest.

Checksums are verified; a chunk that fails is left out and reading goes on behind it. Each record is cut out by its
length before the `mcap` package opens it, so that what is wrong inside one costs that one, in time and in memory.
"""

import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, UnsupportedCompressionError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError
from mcap.writer import MCAP0_MAGIC as MAGIC
from zstandard import ZstdDecompressor, ZstdError

from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S

MOST_B = 128 * 2**20
"""Largest record and largest content of a chunk that are opened; writers make chunks of some megabytes."""
_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_READERS: dict[int, Callable[[ReadDataStream], object]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
}
"""Records that are opened; indexes and statistics are skipped: a sequential reader needs none."""
MESSAGES = (Opcode.CHUNK, Opcode.MESSAGE)
NO_RECORDS = (0, Opcode.MESSAGE)
"""Codes of no record that may be skipped: 0 is not valid (MCAP, Records), and a message is not below its head."""
BROKEN = (McapError, ZstdError, EOFError, ValueError, LookupError, OverflowError, OSError, struct.error, RuntimeError)
"""Exceptions of reading a damaged record, from mcap, zstd, lz4 or the disk."""


@dataclass(slots=True)
class Damage:
    """Damage of the files that were read."""

    notes: list[str] = field(default_factory=list)
    lost_s: float = 0.0
    """Lost time: span of the unreadable chunks [s]."""
    unfinished: bool = False
    left_out: int = 0
    """Damaged records that are left out; the one that a file ends in is not among them."""

    @property
    def sentences(self) -> list[str]:
        """The notes, each once: a bad disk damages a thousand messages in the same way."""
        counts = Counter(self.notes)
        return [f"{note}{f' ({count} times)' if count > 1 else ''}" for note, count in counts.items()]

    def add_loss(self, note: str, start: int, end: int) -> None:
        """Record an unreadable part.

        Parameters
        ----------
        note
            A sentence for the user.
        start, end
            Times of its first and last message [ns].
        """
        self.notes.append(note)
        self.lost_s += max(0, end - start) / NS_PER_S

    def skip(self, note: str, start: int = 0, end: int = 0) -> None:
        """Record a skipped unreadable record in the middle of a file.

        Parameters
        ----------
        note
            A sentence for the user.
        start, end
            Times of its first and last message [ns]; 0 where they are not known.
        """
        self.add_loss(note, start, end)
        self.left_out += 1


def records(file: Path, damage: Damage | None = None, *, chunks: bool = True) -> Iterator[Any]:
    """Records of a file in the order in which they were written.

    An empty file, or one cut within its first bytes, holds nothing.

    Parameters
    ----------
    file
        An MCAP file, damaged or not.
    damage
        Is told what cannot be read.
    chunks
        Whether they are opened; else only what stands beside chunks and messages is given.

    Yields
    ------
    Any
        Records of the library `mcap`.

    Raises
    ------
    UsageError
        When the file is not MCAP at all.
    """
    noted = Damage() if damage is None else damage
    with file.open("rb") as stream:
        start = stream.read(len(MAGIC))
        if not start and ".mcap" not in file.suffixes:  # one of that name had no time to begin
            raise UsageError(f"{file}: is empty, and no .mcap file by its name; name another")
        if not MAGIC.startswith(start):
            raise UsageError(f"{file}: is no MCAP file, by its first bytes; name another")
        finished = False
        if start == MAGIC:
            for record in _whole_records(file, stream, noted, chunks=chunks):
                finished = finished or isinstance(record, Footer)
                yield from _opened(file, record, noted)
        if not finished:
            noted.unfinished = True


def _whole_records(file: Path, stream: BinaryIO, damage: Damage, *, chunks: bool) -> Iterator[object]:
    """Records from here up to the footer or to the first that is cut off."""
    size, zeros = os.fstat(stream.fileno()).st_size, False
    while True:
        begin = stream.tell()
        try:
            code, length = _RECORD_HEAD.unpack(stream.read(_RECORD_HEAD.size))
            if begin + _RECORD_HEAD.size + length > size:
                raise EOFError
            if code in MESSAGES and not chunks:
                stream.seek(length, os.SEEK_CUR)
                continue
            if length > MOST_B:
                stream.seek(length, os.SEEK_CUR)
                damage.skip(
                    f"{file.name}: a record of {length} bytes, at byte {begin}, wanted at most {MOST_B}; left out"
                )
                continue
            body = stream.read(length)
        except BROKEN:
            _note_cut(file, stream, begin, damage)
            return
        try:
            record = _record(code, body)
        except BROKEN as error:
            damage.skip(f"{file.name}: a record is damaged ({type(error).__name__}), at byte {begin}; left out")
            continue
        if code == 0 and not zeros:
            zeros = True
            damage.notes.append(f"{file.name}: zeros instead of records, at byte {begin}; left out")
        if record is not None:
            yield record
        if code == Opcode.FOOTER:
            return


def _record(code: int, body: bytes) -> object:
    """Record from its code and content; None for skipped kinds."""
    stream = ReadDataStream(BytesIO(body))
    if code == Opcode.MESSAGE:
        return Message.read(stream, len(body))
    read = _READERS.get(code)
    return read(stream) if read else None


def _note_cut(file: Path, stream: BinaryIO, whole: int, damage: Damage) -> None:
    """Report the content of the cut record that begins at `whole`, as far as its head gives it."""
    stream.seek(whole)
    head = stream.read(_RECORD_HEAD.size + _CHUNK_TIMES.size)
    if len(head) == _RECORD_HEAD.size + _CHUNK_TIMES.size and head[0] == Opcode.CHUNK:
        start, end = _CHUNK_TIMES.unpack_from(head, _RECORD_HEAD.size)
        damage.add_loss(f"{file.name}: the file ends in the middle of a chunk, at byte {whole}", start, end)
    elif head:
        damage.notes.append(f"{file.name}: the file ends in the middle of a record, at byte {whole}")


def _opened(file: Path, record: object, damage: Damage) -> Iterator[object]:
    if not isinstance(record, Chunk):
        yield record
        return
    try:
        inner, whole = _inside(_content(record))
    except BROKEN as error:
        note = f"{file.name}: a chunk is damaged ({type(error).__name__}) and left out"
        damage.skip(note, record.message_start_time, record.message_end_time)
        return
    yield from inner
    if not whole:
        last = max((one.log_time for one in inner if isinstance(one, Message)), default=record.message_start_time)
        lost_s = max(0, record.message_end_time - last) / NS_PER_S
        note = f"{file.name}: a chunk is damaged inside, and read up to {lost_s:.3g} s before its end"
        damage.skip(note, last, record.message_end_time)


def _content(chunk: Chunk) -> bytes:
    """Content of a chunk, checked; ValueError before it takes more memory than `MOST_B`, whatever the chunk claims."""
    if chunk.compression == "zstd":
        # A single call would reserve what the frame claims.
        data = ZstdDecompressor().stream_reader(chunk.data).read(min(chunk.uncompressed_size, MOST_B) + 1)
    elif chunk.compression == "lz4":
        data = LZ4FrameDecompressor().decompress(chunk.data, min(chunk.uncompressed_size, MOST_B) + 1)
    elif not chunk.compression:
        data = chunk.data
    else:
        raise UnsupportedCompressionError(chunk.compression)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"{len(data)} bytes or more, {chunk.uncompressed_size} in its head")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise CRCValidationError(chunk.uncompressed_crc, zlib.crc32(data), chunk)
    return data


def _inside(data: bytes) -> tuple[list[object], bool]:
    """Records of an opened chunk, and whether it holds nothing else; what follows a length that is wrong is lost.

    Messages, nearly all records, are read here: twice as fast as one by one.
    """
    found: list[object] = []
    at, end, whole = 0, len(data), True
    while at + _RECORD_HEAD.size <= end:
        code, length = _RECORD_HEAD.unpack_from(data, at)
        at += _RECORD_HEAD.size
        if at + length > end:
            return found, False
        if code == Opcode.MESSAGE and length >= _MESSAGE_HEAD.size:
            number, sequence, received, sent = _MESSAGE_HEAD.unpack_from(data, at)
            found.append(Message(number, received, data[at + _MESSAGE_HEAD.size : at + length], sent, sequence))
        elif code in _READERS:
            found.append(_record(code, data[at : at + length]))
        elif code in NO_RECORDS:
            whole = False
        at += length
    return found, whole and at == end
