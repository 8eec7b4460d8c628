"""The Ping protocol of Blue Robotics: frames from a byte stream and back, and the messages of a Ping1D or Ping2.

Source: github.com/bluerobotics/ping-protocol, docs/index.md (frame, checksum), src/definitions/common.json and
ping1d.json (messages). A frame, little endian: `BR`, payload length u16, message id u16, source u8, destination u8,
payload, checksum u16: the sum of all bytes before it.
"""

import struct
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_core.rejects import RejectCode

MARK = b"BR"
HEADER = struct.Struct("<2sHHBB")
CHECKSUM = struct.Struct("<H")

ACK, NACK, TEXT, DEVICE_INFORMATION, PROTOCOL_VERSION, GENERAL_REQUEST = 1, 2, 3, 4, 5, 6
SET_DEVICE_ID = 1000
SET_RANGE, SET_SPEED_OF_SOUND, SET_MODE_AUTO, SET_INTERVAL, SET_GAIN, SET_PING_ENABLE = range(1001, 1007)
DEVICE_ID, SUPPLY_mV = 1201, 1202
SPEED_OF_SOUND, RANGE, MODE_AUTO, INTERVAL, GAIN = range(1203, 1208)
PROCESSOR_cC, BOARD_cC = 1213, 1214
DISTANCE_SIMPLE, DISTANCE, PING_ENABLE, PROFILE = 1211, 1212, 1215, 1300
CONTINUOUS_START, CONTINUOUS_STOP = 1400, 1401
PING1D_TYPE = 1

_ECHO = struct.Struct("<IHHIIII")
_SIMPLE = struct.Struct("<IB")

LONGEST_TEXT = 256
LONGEST_PROFILE = 1024
_LENGTHS = {
    ACK: (2, 2),
    NACK: (2, 2 + LONGEST_TEXT),
    TEXT: (0, LONGEST_TEXT),
    DEVICE_INFORMATION: (6, 6),
    PROTOCOL_VERSION: (4, 4),
    1200: (6, 6),
    DEVICE_ID: (1, 1),
    SUPPLY_mV: (2, 2),
    SPEED_OF_SOUND: (4, 4),
    RANGE: (8, 8),
    MODE_AUTO: (1, 1),
    INTERVAL: (2, 2),
    GAIN: (4, 4),
    1208: (2, 2),
    1210: (10, 10),
    DISTANCE_SIMPLE: (5, 5),
    DISTANCE: (24, 24),
    PROCESSOR_cC: (2, 2),
    BOARD_cC: (2, 2),
    PING_ENABLE: (1, 1),
    PROFILE: (26, 26 + LONGEST_PROFILE),
}
"""Shortest and longest payload of each message a Ping1D sends."""


@dataclass(frozen=True, slots=True)
class PingFrame:
    """A frame whose checksum holds and whose payload has a length that its message can have."""

    id: int
    payload: bytes

    @property
    def size(self) -> int:
        """Bytes it took on the wire."""
        return len(self.payload) + HEADER.size + CHECKSUM.size


@dataclass(frozen=True, slots=True)
class Refused:
    """Bytes that are no frame."""

    reason: RejectCode
    data: bytes


_BITE = 4096
"""Bytes looked at in one go, so that a flood of false marks stays cheap."""

Piece: TypeAlias = PingFrame | Refused


@dataclass(frozen=True, slots=True)
class EchoMessage:
    """Content of 1212 and 1300; `strength` is empty for 1212. Lengths in mm as sent, confidence in percent."""

    distance_mm: int
    confidence: int
    ping_number: int
    start_mm: int
    length_mm: int
    gain: int
    strength: bytes


def encode(message: int, payload: bytes = b"") -> bytes:
    """Frame from the host: source and destination stay zero: the protocol does not implement them."""
    body = HEADER.pack(MARK, len(payload), message, 0, 0) + payload
    return body + CHECKSUM.pack(sum(body) & 0xFFFF)


def request(message: int) -> bytes:
    """Ask for a message with a general_request."""
    return encode(GENERAL_REQUEST, struct.pack("<H", message))


def about(frame: PingFrame) -> int:
    """Message id that an ack or a nack refers to."""
    return int.from_bytes(frame.payload[:2], "little")


def echo(frame: PingFrame) -> EchoMessage | None:
    """Content of a distance or profile; None when a profile's count does not fit its length."""
    strength = frame.payload[26:]
    if frame.id == PROFILE and int.from_bytes(frame.payload[24:26], "little") != len(strength):
        return None
    distance, confidence, _, number, start, length, gain = _ECHO.unpack_from(frame.payload)
    return EchoMessage(distance, confidence, number, start, length, gain, strength)


def simple(frame: PingFrame) -> tuple[int, int]:
    """Distance [mm] and confidence [%] of a distance_simple."""
    distance, confidence = _SIMPLE.unpack(frame.payload)
    return distance, confidence


class FrameSplitter:
    """Finds frames in a byte stream, the same ones however the stream is chunked.

    A frame that turns out to be none costs its first two bytes; the search continues inside it, so neither a false mark
    nor a corrupt length can swallow the frames behind. Lengths are checked against the message's own limits before
    any waiting, and the wait ends with the first whole frame inside: what a corrupt length covers comes through when
    it arrives, and is stamped then. Bytes between frames come back as Refused, 64 at a time at most.
    """

    def __init__(self) -> None:
        self._bytes = self._junk = b""
        self._reported = 0

    def feed(self, data: bytes) -> list[Piece]:
        """Frames and refusals that these bytes have completed, in the order of the stream."""
        pieces: list[Piece] = []
        for begin in range(0, len(data), _BITE):
            self._bytes += data[begin : begin + _BITE]
            while self._find(pieces):
                pass
        return pieces

    def _find(self, pieces: list[Piece]) -> bool:
        """Find the next start mark and check its frame; False when more bytes are needed."""
        start = self._bytes.find(MARK)
        if start < 0:
            # The last byte may be the first half of a mark.
            start = len(self._bytes) - self._bytes.endswith(MARK[:1])
        self._skip(start, pieces)
        return len(self._bytes) >= HEADER.size and self._frame(pieces)

    def _frame(self, pieces: list[Piece]) -> bool:
        """Check the frame at a start mark with a whole header; False when more bytes are needed."""
        _, length, message, _, _ = HEADER.unpack_from(self._bytes)
        if not _possible(message, length):
            self._refuse(RejectCode.LENGTH if message in _LENGTHS else RejectCode.UNKNOWN, HEADER.size, pieces)
            return True
        end = HEADER.size + length + CHECKSUM.size
        if self._covers_a_frame(end):
            self._refuse(RejectCode.LENGTH, HEADER.size, pieces)
            return True
        if len(self._bytes) < end:
            return False
        if not _sum_holds(self._bytes[:end]):
            self._refuse(RejectCode.CHECKSUM, end, pieces)
            return True
        self._flush(pieces)
        pieces.append(PingFrame(message, self._bytes[HEADER.size : end - CHECKSUM.size]))
        self._bytes = self._bytes[end:]
        self._reported = max(0, self._reported - end)
        return True

    def _covers_a_frame(self, end: int) -> bool:
        """Whether a whole frame lies behind the mark of one that would end there."""
        at = self._bytes.find(MARK, len(MARK), end)
        while at >= 0:
            inside = self._bytes[at:end]
            if len(inside) >= HEADER.size:
                _, length, message, _, _ = HEADER.unpack_from(inside)
                size = HEADER.size + length + CHECKSUM.size
                if _possible(message, length) and size <= len(inside) and _sum_holds(inside[:size]):
                    return True
            at = self._bytes.find(MARK, at + len(MARK), end)
        return False

    def _refuse(self, reason: RejectCode, size: int, pieces: list[Piece]) -> None:
        """Report an invalid frame once, then continue after its mark; its bytes are not reported again."""
        self._flush(pieces)
        pieces.append(Refused(reason, self._bytes[:size]))
        self._bytes = self._bytes[len(MARK) :]
        self._reported = max(self._reported, size) - len(MARK)

    def _skip(self, count: int, pieces: list[Piece]) -> None:
        reported = min(count, self._reported)
        self._reported -= reported
        self._junk += self._bytes[reported:count]
        self._bytes = self._bytes[count:]
        while len(self._junk) >= 64:
            pieces.append(Refused(RejectCode.GARBAGE, self._junk[:64]))
            self._junk = self._junk[64:]

    def _flush(self, pieces: list[Piece]) -> None:
        if self._junk:
            pieces.append(Refused(RejectCode.GARBAGE, self._junk))
            self._junk = b""


def _possible(message: int, length: int) -> bool:
    """Whether a Ping1D sends this message with such a payload."""
    shortest, longest = _LENGTHS.get(message, (1, 0))
    return shortest <= length <= longest


def _sum_holds(frame: bytes) -> bool:
    return sum(frame[: -CHECKSUM.size]) & 0xFFFF == int.from_bytes(frame[-CHECKSUM.size :], "little")
