"""Protocol between a client and the mock over a unix stream socket, and the page with the mock's time.

Every frame is `u32 length | u8 kind | body`, little endian, `length` counting kind and body. A client has at most one
question open. WAKE is no question: it makes the mock answer the open SLEEP at once, and is ignored when none is open
(the answer and the change of mind may cross on the way).

    HELLO     u8 version, name (UTF-8)             -> TIME
    TRANSFER  u8 address, u16 count, bytes written -> DATA | FAILED     count 0: write; no bytes: read; both: one START
    SLEEP     i64 stamp [ns]                       -> TIME, when the mock's clock has reached it
    WAKE      (empty)                                 ends the open SLEEP
    DATA      bytes read
    FAILED    i32 errno
    TIME      i64 now [ns]

Beside the socket PATH lies the page PATH.time: the mock's time as one aligned i64 [ns], to be mapped and read without
a system call.
"""

import struct
from enum import IntEnum

from hindrax_core.bus_operations import Transaction, unpack_transaction

VERSION = 1
PAGE_SUFFIX = ".time"
PAGE_BYTES = 8
LARGEST_FRAME = 1 << 17

_HEAD, STAMP, ERRNO = struct.Struct("<IB"), struct.Struct("<q"), struct.Struct("<i")


class Kind(IntEnum):
    """First byte of every frame."""

    HELLO = 1
    TRANSFER = 2
    SLEEP = 3
    WAKE = 4
    DATA = 16
    FAILED = 17
    TIME = 18


class ProtocolError(Exception):
    """The other end uses another protocol or another version."""


def frame(kind: Kind, body: bytes = b"") -> bytes:
    """Prepend length and kind to a body."""
    return _HEAD.pack(len(body) + 1, kind) + body


class Frames:
    """Cuts a stream of bytes, in whatever pieces it arrives, into frames."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[tuple[Kind, bytes]]:
        """Whole frames so far, in order. ProtocolError for an unknown kind or an absurd length."""
        self._buffer += data
        found: list[tuple[Kind, bytes]] = []
        while len(self._buffer) >= _HEAD.size:
            length, kind = _HEAD.unpack_from(self._buffer)
            if not 1 <= length <= LARGEST_FRAME or kind not in Kind._value2member_map_:
                raise ProtocolError(f"found a frame of kind {kind} and length {length}, wanted version {VERSION}")
            end = 4 + length
            if len(self._buffer) < end:
                break
            found.append((Kind(kind), bytes(self._buffer[5:end])))
            del self._buffer[:end]
        return found


def hello(name: str) -> bytes:
    """Name of the client and protocol version."""
    return frame(Kind.HELLO, bytes([VERSION]) + name.encode())


def parse_hello(body: bytes) -> str:
    """Name of the caller; ProtocolError for another version."""
    if not body or body[0] != VERSION:
        raise ProtocolError(f"found protocol version {body[:1].hex() or 'none'}, wanted {VERSION}")
    return body[1:].decode(errors="replace")


def parse_transfer(body: bytes) -> Transaction:
    """Transaction of a TRANSFER, as `pack_transaction` encodes it."""
    try:
        return unpack_transaction(body)
    except ValueError as error:
        raise ProtocolError(str(error)) from error


def sleep(stamp: int) -> bytes:
    """Request an answer when the mock's clock reads `stamp` or later."""
    return frame(Kind.SLEEP, STAMP.pack(stamp))


def number(layout: struct.Struct, body: bytes) -> int:
    """The one number of a body: STAMP in SLEEP and TIME, ERRNO in FAILED."""
    if len(body) != layout.size:
        raise ProtocolError(f"found {len(body)} bytes, wanted a number of {layout.size}")
    return int(layout.unpack(body)[0])
