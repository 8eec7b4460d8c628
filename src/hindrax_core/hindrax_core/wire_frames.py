"""Recorded wire frames, and register transactions as such: the request (sent), then the answer (received).

A sent frame is `u8 address | u16 count, little endian | bytes written`; count 0 is a write, no bytes a read, both a
write and a read in one transaction. The received frame that follows holds the bytes read, and is empty for a write.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from hindrax_core.bus_operations import Read, Transaction, Write, WriteRead
from hindrax_core.events import Stamp

_HEAD = struct.Struct("<BH")


def pack_transaction(transaction: Transaction) -> bytes:
    """Encode a transaction."""
    count = 0 if isinstance(transaction, Write) else transaction.count
    data = b"" if isinstance(transaction, Read) else transaction.data
    return _HEAD.pack(transaction.address, count) + data


def unpack_transaction(frame: bytes) -> Transaction:
    """Decode a transaction; ValueError when the frame is too short."""
    if len(frame) < _HEAD.size:
        raise ValueError(f"found a transaction of {len(frame)} bytes, wanted at least {_HEAD.size}")
    address, count = _HEAD.unpack_from(frame)
    data = frame[_HEAD.size :]
    if count == 0:
        return Write(address, data)
    return WriteRead(address, data, count) if data else Read(address, count)


def frames_in(batch: Any) -> Iterator[tuple[Stamp, int, bytes]]:
    """Stamp, direction and bytes of every frame of a RawFrames message."""
    start, data = 0, bytes(batch.data)
    for stamp, direction, length in zip(batch.stamps, bytes(batch.directions), batch.lengths, strict=True):
        yield Stamp(int(stamp)), direction, data[start : start + length]
        start += length
