"""The stamp in the header of a message, read from its bytes."""

from __future__ import annotations

import struct

from hindrax_core.events import NS_PER_S

_STAMP = struct.Struct("<iI")
CDR_HEAD = 4
LITTLE_ENDIAN = b"\x00\x01"


def stamp_of(data: bytes) -> int:
    """Time in the header of a little-endian CDR message whose first field is a std_msgs/Header [ns]."""
    seconds, nanoseconds = _STAMP.unpack_from(data, CDR_HEAD)
    return int(seconds) * NS_PER_S + int(nanoseconds)


def valid_stamp(data: bytes) -> int | None:
    """As `stamp_of`, for untrusted bytes; None if they hold no time since 1970."""
    if len(data) < CDR_HEAD + _STAMP.size or data[:2] != LITTLE_ENDIAN:
        return None
    seconds, nanoseconds = _STAMP.unpack_from(data, CDR_HEAD)
    if seconds < 0 or nanoseconds >= NS_PER_S:
        return None
    return int(seconds) * NS_PER_S + int(nanoseconds)
