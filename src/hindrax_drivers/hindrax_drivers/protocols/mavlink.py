"""The MAVLink 2 subset between host and thruster controller, sans-IO: bytes in, frames and refusals out.

Frames: https://mavlink.io/en/guide/serialization.html. Messages and the bytes that stand for their definitions
(CRC_EXTRA): message set common. Signed frames are refused, as the guide asks of an end that cannot check them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

from hindrax_core.events import Rejected, Stamp

STX = 0xFD
HEAD, CHECKSUM = 10, 2
REFUSED_AT_ONCE = 64
ARM_DISARM = 400
ARMED_FLAG = 0x80
UNKNOWN = 0xFFFF


class Message(Protocol):
    """Layout of a message in its payload: fields by size, extensions last."""

    NUMBER: ClassVar[int]
    CRC_EXTRA: ClassVar[int]
    FIELDS: ClassVar[struct.Struct]

    def values(self) -> tuple[Any, ...]:
        """Values of all fields, in the order of the wire."""

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Make the message from the values of all its fields."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT: type of the sender and whether it is armed; custom_mode is not used."""

    NUMBER: ClassVar[int] = 0
    CRC_EXTRA: ClassVar[int] = 50
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<IBBBBB")

    type: int
    autopilot: int
    base_mode: int
    system_status: int
    version: int = 3

    @property
    def armed(self) -> bool:
        """MAV_MODE_FLAG_SAFETY_ARMED."""
        return bool(self.base_mode & ARMED_FLAG)

    def values(self) -> tuple[Any, ...]:
        """Field by field."""
        return (0, self.type, self.autopilot, self.base_mode, self.system_status, self.version)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Field by field."""
        return cls(*values[1:])


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """SERVO_OUTPUT_RAW: output pulses of the controller, sixteen channels [us], 0 for none."""

    NUMBER: ClassVar[int] = 36
    CRC_EXTRA: ClassVar[int] = 222
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<I8HB8H")

    time_us: int
    pulses_us: tuple[int, ...]

    def values(self) -> tuple[Any, ...]:
        """The port, between the first and the second eight channels, is always 0."""
        pulses = (self.pulses_us + (0,) * 16)[:16]
        return (self.time_us, *pulses[:8], 0, *pulses[8:])

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Without the port."""
        return cls(values[0], (*values[1:9], *values[10:]))


@dataclass(frozen=True, slots=True)
class ChannelsOverride:
    """RC_CHANNELS_OVERRIDE: pulses wanted, up to eighteen channels [us]."""

    NUMBER: ClassVar[int] = 70
    CRC_EXTRA: ClassVar[int] = 124
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<8HBB10H")

    pulses_us: tuple[int, ...]
    target_system: int = 1
    target_component: int = 1

    def values(self) -> tuple[Any, ...]:
        """Channels that are not given: "ignore" for the first eight, nothing at all for the extensions."""
        first = (self.pulses_us + (UNKNOWN,) * 8)[:8]
        more = (self.pulses_us[8:] + (0,) * 10)[:10]
        return (*first, self.target_system, self.target_component, *more)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """The target lies between the first eight channels and the extensions."""
        return cls((*values[:8], *values[10:]), values[8], values[9])


@dataclass(frozen=True, slots=True)
class CommandLong:
    """COMMAND_LONG: a command with its first parameter; the other six are zero."""

    NUMBER: ClassVar[int] = 76
    CRC_EXTRA: ClassVar[int] = 152
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<7fHBBB")

    command: int
    parameter: float
    confirmation: int = 0
    target_system: int = 1
    target_component: int = 1

    def values(self) -> tuple[Any, ...]:
        """Parameters come first, being the largest fields."""
        target = (self.target_system, self.target_component)
        return (self.parameter, *(0.0,) * 6, self.command, *target, self.confirmation)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Parameters come first, being the largest fields."""
        return cls(values[7], values[0], values[10], values[8], values[9])


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK: a command, its MAV_RESULT (0 for accepted), and who gave the command (0: not said)."""

    NUMBER: ClassVar[int] = 77
    CRC_EXTRA: ClassVar[int] = 143
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<HBBiBB")

    command: int
    result: int
    target_system: int = 0
    target_component: int = 0

    def values(self) -> tuple[Any, ...]:
        """Progress and the second parameter of the result are zero."""
        return (self.command, self.result, 0, 0, self.target_system, self.target_component)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Without progress and second parameter."""
        return cls(*values[:2], *values[4:])


@dataclass(frozen=True, slots=True)
class BatteryStatus:
    """BATTERY_STATUS: sum of the cells that are known [V], current [A] or None."""

    NUMBER: ClassVar[int] = 147
    CRC_EXTRA: ClassVar[int] = 154
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<iih10HhBBBbiB4HBI")

    voltage_V: float
    current_A: float | None

    def values(self) -> tuple[Any, ...]:
        """The voltage goes as that of the first cell [mV], the current in hundredths of an ampere."""
        cells = (round(self.voltage_V * 1e3), *(UNKNOWN,) * 9)
        current = -1 if self.current_A is None else round(self.current_A * 100.0)
        return (-1, -1, 0x7FFF, *cells, current, 0, 0, 0, -1, 0, 0, *(0,) * 4, 0, 0)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Cells that do not exist say 65535; a current that is not measured says -1."""
        cells = [cell for cell in values[3:13] if cell != UNKNOWN]
        return cls(sum(cells) / 1e3, None if values[13] < 0 else values[13] / 100.0)


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT: a sentence of at most 50 bytes, with MAV_SEVERITY (0 emergency to 7 debug)."""

    NUMBER: ClassVar[int] = 253
    CRC_EXTRA: ClassVar[int] = 83
    FIELDS: ClassVar[struct.Struct] = struct.Struct("<B50sHB")

    severity: int
    text: str

    def values(self) -> tuple[Any, ...]:
        """One piece: the field cuts longer texts."""
        return (self.severity, self.text.encode(), 0, 0)

    @classmethod
    def of(cls, values: tuple[Any, ...]) -> Self:
        """Up to the first zero."""
        return cls(values[0], values[1].partition(b"\x00")[0].decode(errors="replace"))


_MESSAGES: tuple[type[Message], ...] = (
    Heartbeat,
    ServoOutput,
    ChannelsOverride,
    CommandLong,
    CommandAck,
    BatteryStatus,
    StatusText,
)
_BY_NUMBER = {message.NUMBER: message for message in _MESSAGES}
_OTHERS = """
1:124:43 2:137:12 4:237:14 20:214:20 21:159:2 22:220:25 23:168:23 24:24:52 26:170:24 27:144:29 29:115:16
30:39:28 31:246:48 32:185:28 33:104:28 35:244:22 39:254:38 40:230:5 42:28:6 43:132:3 44:221:5 45:232:3
46:11:2 47:153:4 51:196:5 62:183:26 65:118:42 66:148:6 69:243:30 73:38:38 74:20:20 75:158:35 83:22:37
85:140:51 87:150:51 105:93:63 109:185:9 111:34:16 116:76:24 125:203:6 129:46:24 132:85:39
136:1:22 137:195:16 141:47:32 143:131:16 148:178:78 152:208:8 163:127:28 165:21:3 173:83:8 178:47:24
181:174:4 193:71:26 230:163:42 241:90:32 242:104:60 244:95:6 245:130:2 251:170:18 252:44:18
"""
_LAYOUTS = {message.NUMBER: (message.CRC_EXTRA, message.FIELDS.size) for message in _MESSAGES} | {
    number: (extra, longest) for number, extra, longest in (map(int, one.split(":")) for one in _OTHERS.split())
}
"""CRC_EXTRA and longest payload by number: of the messages above, and of messages that ground stations and autopilots
send (message sets common and ardupilotmega), so that those verify and are no rejects."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A message whose checksum holds, and who sent it; None for a message that is not read here."""

    system: int
    component: int
    sequence: int
    message: Message | None


def encode(message: Message, sequence: int, system: int = 1, component: int = 191) -> bytes:
    """One frame. Zeros at the end of the payload are left out, but for its first byte."""
    payload = message.FIELDS.pack(*message.values()).rstrip(b"\x00") or b"\x00"
    head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence & 0xFF, system, component)
    body = head + message.NUMBER.to_bytes(3, "little") + payload
    return bytes([STX]) + body + checksum(body, message.CRC_EXTRA).to_bytes(2, "little")


def checksum(body: bytes, crc_extra: int) -> int:
    """CRC-16/MCRF4XX of a frame without its start byte, then of the byte of its definition."""
    crc = 0xFFFF
    for byte in body:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc >> 8 ^ _TABLE[(crc ^ crc_extra) & 0xFF]


class Decoder:
    """Cuts a stream of bytes into frames; any cutting of the stream gives the same events.

    An invalid start byte is dropped alone, and the following bytes are scanned again: no frame is lost to
    garbage before it, nor to a corrupt length.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._refused = bytearray()
        self._why = ""

    def feed(self, data: bytes, stamp: Stamp) -> Iterator[Frame | Rejected]:
        """Return all complete frames. Rejected bytes come before the frame that follows them, 64 at a time."""
        self._buffer += data
        while len(self._buffer) >= HEAD:
            start = self._buffer.find(STX)
            if start:
                yield from self._refuse(len(self._buffer) if start < 0 else start, "no start of a frame", stamp)
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

    def _judge_head(self) -> str:
        length, incompatible, number = self._buffer[1], self._buffer[2], self._number()
        if incompatible:
            return "signed, or of a later version"
        if number not in _LAYOUTS:
            return f"unknown message {number}"
        return "" if 0 < length <= _LAYOUTS[number][1] else f"impossible length for message {number}"

    def _judge_checksum(self, size: int) -> str:
        body = bytes(self._buffer[1 : size - CHECKSUM])
        found = int.from_bytes(self._buffer[size - CHECKSUM : size], "little")
        return "" if checksum(body, _LAYOUTS[self._number()][0]) == found else "checksum"

    def _number(self) -> int:
        return int.from_bytes(self._buffer[7:10], "little")

    def _pop_frame(self, size: int) -> Frame:
        _, length, _, _, sequence, system, component = self._buffer[:7]
        message = _BY_NUMBER.get(self._number())
        payload = bytes(self._buffer[HEAD : HEAD + length])
        del self._buffer[:size]
        if message is None:
            return Frame(system, component, sequence, None)
        fields = message.FIELDS.unpack(payload.ljust(message.FIELDS.size, b"\x00"))
        return Frame(system, component, sequence, message.of(fields))

    def _refuse(self, count: int, why: str, stamp: Stamp) -> Iterator[Rejected]:
        # The first reason that names a frame is more specific than its absence.
        if not self._refused or self._why == "no start of a frame":
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
