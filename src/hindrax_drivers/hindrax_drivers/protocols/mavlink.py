"""The MAVLink 2 subset between host and thruster controller, sans-IO: bytes in, frames and refusals out.

Frames: https://mavlink.io/en/guide/serialization.html. Messages and the bytes that stand for their definitions
(CRC_EXTRA): message set common. Signed frames are refused, as the guide asks of an end that cannot check them.
"""

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from hindrax_core.events import Rejected, Stamp
from hindrax_core.readings import AppliedPulses, Battery
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_drivers.protocols.mavlink_definitions import LAYOUTS

STX = 0xFD
HEAD, CHECKSUM = 10, 2
REFUSED_AT_ONCE = 64
ARM_DISARM = 400
ARMED_FLAG = 0x80
UNKNOWN = 0xFFFF
SYSTEM, AUTOPILOT, ONBOARD_COMPUTER = 1, 1, 191
"""Our MAVLink system, the controller's component in it (MAV_COMP_ID_AUTOPILOT1) and ours (.._ONBOARD_COMPUTER)."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT: type of the sender, whether it is armed (MAV_MODE_FLAG_SAFETY_ARMED), MAV_AUTOPILOT, its own mode."""

    type: int
    armed: bool
    autopilot: int = 0
    mode: int = 0


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK: a command, its MAV_RESULT (0 for accepted), and who gave the command (0: unknown)."""

    command: int
    result: int
    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT: at most 50 bytes, with MAV_SEVERITY (0 emergency to 7 debug); a longer sentence has a number.

    `more`: a part of it that others follow.
    """

    severity: int
    text: str
    number: int = 0
    more: bool = False


Message: TypeAlias = Heartbeat | AppliedPulses | CommandAck | Battery | StatusText
"""Received messages: SERVO_OUTPUT_RAW as the pulses of sixteen channels (0 for none), BATTERY_STATUS as a battery."""
Sent: TypeAlias = tuple[int, bytes]
"""Sent messages: number and payload."""


def _battery(values: tuple[int, ...]) -> Battery:
    """Sum of the cells [mV] that exist: others are 65535. The current is in hundredths of an ampere, -1 for unknown."""
    voltage_V = sum(cell for cell in values[3:13] if cell != UNKNOWN) / 1e3
    return Battery(voltage_V, math.nan if values[13] < 0 else values[13] / 100.0)


def _text(severity: int, text: bytes, number: int) -> StatusText:
    said, end, _ = text.partition(b"\x00")
    return StatusText(severity, said.decode(errors="replace"), number, more=bool(number) and not end)


Readers: TypeAlias = Mapping[int, tuple[struct.Struct, Callable[[tuple[Any, ...]], object]]]
"""Fields of a message by its number, by size and extensions last, and what they mean."""
READ: Readers = {
    0: (struct.Struct("<IBBBBB"), lambda v: Heartbeat(v[1], bool(v[3] & ARMED_FLAG), v[2], v[0])),
    36: (struct.Struct("<I8HB8H"), lambda v: AppliedPulses(tuple(map(float, (*v[1:9], *v[10:]))))),
    77: (struct.Struct("<HBBiBB"), lambda v: CommandAck(*v[:2], *v[4:])),
    147: (struct.Struct("<iih10HhBBBbiB4HBI"), _battery),
    253: (struct.Struct("<B50sHB"), lambda v: _text(*v[:3])),
}
"""What a thruster controller says."""


@dataclass(frozen=True, slots=True)
class MavlinkFrame:
    """A message whose checksum holds, and who sent it; None for a message that is not read here."""

    system: int
    component: int
    sequence: int
    number: int
    message: object


def heartbeat(kind: int, autopilot: int, status: int) -> Sent:
    """HEARTBEAT without a mode.

    Parameters
    ----------
    kind, autopilot, status
        MAV_TYPE, MAV_AUTOPILOT, MAV_STATE.

    Returns
    -------
    Sent
        To be encoded.
    """
    return 0, struct.pack("<IBBBBB", 0, kind, autopilot, 0, status, 3)


def channels_override(pulses_us: Sequence[int]) -> Sent:
    """RC_CHANNELS_OVERRIDE: pulses wanted of sixteen channels [us], and of two more that are left as they are."""
    return 70, struct.pack("<8HBB10H", *pulses_us[:8], SYSTEM, AUTOPILOT, *pulses_us[8:], 0, 0)


def command_long(command: int, parameters: Sequence[float], confirmation: int = 0, system: int = SYSTEM) -> Sent:
    """COMMAND_LONG: a command with its first parameters; the others of the seven are zero.

    Parameters
    ----------
    command, parameters
        MAV_CMD, and its parameters.
    confirmation
        Counts repeats.
    system
        Whom it is for.

    Returns
    -------
    Sent
        To be encoded.
    """
    given = (*parameters, *(0.0,) * (7 - len(parameters)))
    return 76, struct.pack("<7fHBBB", *given, command, system, AUTOPILOT, confirmation)


def encode(message: Sent, sequence: int, system: int = SYSTEM, component: int = ONBOARD_COMPUTER) -> bytes:
    """One frame of ours. Zeros at the end of the payload are left out, but for its first byte.

    Parameters
    ----------
    message
        To be sent.
    sequence
        Counts up, modulo 256.
    system, component
        Ours.

    Returns
    -------
    bytes
        MAVLink 2.
    """
    number, fields = message
    payload = fields.rstrip(b"\x00") or b"\x00"
    head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence & 0xFF, system, component)
    body = head + number.to_bytes(3, "little") + payload
    return bytes([STX]) + body + checksum(body, LAYOUTS[number][0]).to_bytes(2, "little")


def checksum(body: bytes, crc_extra: int) -> int:
    """CRC-16/MCRF4XX of a frame without its start byte, then of the byte of its definition."""
    crc = 0xFFFF
    for byte in body:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc >> 8 ^ _TABLE[(crc ^ crc_extra) & 0xFF]


class Decoder:
    """Cuts a stream of bytes into frames; any cutting of the stream gives the same events.

    An invalid start byte is dropped alone, and the following bytes are scanned again: no frame is lost to
    garbage before it, nor to a corrupt length. `read`: the messages that are read.
    """

    def __init__(self, read: Readers = READ) -> None:
        self._read = read
        self._buffer = bytearray()
        self._refused = bytearray()
        self._why = reject(RejectCode.NO_START)

    def feed(self, data: bytes, stamp: Stamp) -> Iterator[MavlinkFrame | Rejected]:
        """Return all complete frames. Rejected bytes come before the frame that follows them, 64 at a time."""
        self._buffer += data
        while len(self._buffer) >= HEAD:
            start = self._buffer.find(STX)
            if start:
                yield from self._refuse(len(self._buffer) if start < 0 else start, reject(RejectCode.NO_START), stamp)
                continue
            why, size = self._judge_head(), HEAD + self._buffer[1] + CHECKSUM
            if not why and size > len(self._buffer):
                break
            if why or (why := self._judge_checksum(size)):
                yield from self._refuse(1, why, stamp)
                continue
            if self._refused:
                yield self._flush(len(self._refused), stamp)
            yield self._pop_frame(size)

    def _judge_head(self) -> Reject | None:
        length, incompatible, number = self._buffer[1], self._buffer[2], self._number()
        if incompatible:
            return reject(RejectCode.SIGNED)
        if number not in LAYOUTS:
            return reject(RejectCode.UNKNOWN, found=f"unknown message {number}")
        if 0 < length <= LAYOUTS[number][1]:
            return None
        return reject(RejectCode.LENGTH, found=f"impossible length for message {number}")

    def _judge_checksum(self, size: int) -> Reject | None:
        body = bytes(self._buffer[1 : size - CHECKSUM])
        found = int.from_bytes(self._buffer[size - CHECKSUM : size], "little")
        same = checksum(body, LAYOUTS[self._number()][0]) == found
        return None if same else reject(RejectCode.CHECKSUM)

    def _number(self) -> int:
        return int.from_bytes(self._buffer[7:10], "little")

    def _pop_frame(self, size: int) -> MavlinkFrame:
        _, length, _, _, sequence, system, component = self._buffer[:7]
        number, payload = self._number(), bytes(self._buffer[HEAD : HEAD + length])
        del self._buffer[:size]
        message = None
        if number in self._read:
            fields, of = self._read[number]
            message = of(fields.unpack_from(payload.ljust(fields.size, b"\x00")))
        return MavlinkFrame(system, component, sequence, number, message)

    def _refuse(self, count: int, why: Reject, stamp: Stamp) -> Iterator[Rejected]:
        # The first reason that names a frame is more specific than its absence.
        if not self._refused or self._why.code is RejectCode.NO_START:
            self._why = why
        self._refused += self._buffer[:count]
        del self._buffer[:count]
        while len(self._refused) >= REFUSED_AT_ONCE:
            yield self._flush(REFUSED_AT_ONCE, stamp)

    def _flush(self, count: int, stamp: Stamp) -> Rejected:
        refused = bytes(self._refused[:count])
        del self._refused[:count]
        return Rejected(stamp, self._why, refused)


def _table_entry(byte: int) -> int:
    crc = byte
    for _ in range(8):
        crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


_TABLE = tuple(_table_entry(byte) for byte in range(256))
