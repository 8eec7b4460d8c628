"""Protocol between a client and the mock over a unix socket that keeps frames whole, and the page with the mock's time.

Every frame is `u8 kind | body`, little endian: a packet of a SOCK_SEQPACKET. A client has at most one question open.
WAKE is no question: it makes the mock answer the open SLEEP at once, and is ignored when none is open (the answer and
the change of mind may cross on the way).

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

VERSION = 2
PAGE_SUFFIX = ".time"
PAGE_BYTES = 8
LARGEST_FRAME = 4 + 0xFFFF
"""Kind, address, count, and as many bytes as a transaction can have."""

STAMP, ERRNO = struct.Struct("<q"), struct.Struct("<i")


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
    """Prepend the kind to a body."""
    return bytes([kind]) + body


def parse(data: bytes) -> tuple[Kind, bytes]:
    """Kind and body of a frame. ProtocolError for an unknown kind."""
    if data[0] not in Kind._value2member_map_:
        raise ProtocolError(f"found a frame of kind {data[0]}, wanted version {VERSION}")
    return Kind(data[0]), data[1:]


def hello(name: str) -> bytes:
    """Name of the client and protocol version."""
    return frame(Kind.HELLO, bytes([VERSION]) + name.encode())


def parse_hello(body: bytes) -> str:
    """Name of the caller; ProtocolError for another version."""
    if not body or body[0] != VERSION:
        raise ProtocolError(f"found protocol version {body[:1].hex() or 'none'}, wanted {VERSION}")
    return body[1:].decode(errors="replace")


def parse_transfer(body: bytes) -> Transaction:
    """Transaction of a TRANSFER, as `pack_transaction` encodes it; ProtocolError for other bytes."""
    try:
        return unpack_transaction(body)
    except ValueError as error:
        raise ProtocolError(str(error)) from error


def sleep(stamp: int) -> bytes:
    """Request an answer when the mock's clock reads `stamp` or later."""
    return frame(Kind.SLEEP, STAMP.pack(stamp))


def number(layout: struct.Struct, body: bytes) -> int:
    """The one number of a body: STAMP in SLEEP and TIME, ERRNO in FAILED; ProtocolError for another length."""
    if len(body) != layout.size:
        raise ProtocolError(f"found {len(body)} bytes, wanted a number of {layout.size}")
    return int(layout.unpack(body)[0])
