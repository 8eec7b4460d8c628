"""The stamp in the header of a message, read from its bytes."""

from __future__ import annotations

import struct

from hindrax_core.events import NS_PER_S

_STAMP = struct.Struct("<iI")
CDR_HEAD = 4


def stamp_of(data: bytes) -> int:
    """Time in the header of a little-endian CDR message whose first field is a std_msgs/Header [ns]."""
    seconds, nanoseconds = _STAMP.unpack_from(data, CDR_HEAD)
    return int(seconds) * NS_PER_S + int(nanoseconds)
