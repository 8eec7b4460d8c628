"""The MAVLink 2 subset between host and thruster controller, sans-IO: bytes in, frames and refusals out.

Frames: https://mavlink.io/en/guide/serialization.html. Messages and the bytes that stand for their definitions
(CRC_EXTRA): message set common. Signed frames are refused, as the guide asks of an end that cannot check them.
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from hindrax_core.events import Rejected, Stamp

STX = 0xFD
HEAD, CHECKSUM = 10, 2
REFUSED_AT_ONCE = 64
ARM_DISARM = 400
ARMED_FLAG = 0x80
UNKNOWN = 0xFFFF


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT: type of the sender and whether it is armed; custom_mode is not used."""

    type: int
    autopilot: int
    base_mode: int
    system_status: int
    version: int = 3

    @property
    def armed(self) -> bool:
        """MAV_MODE_FLAG_SAFETY_ARMED."""
        return bool(self.base_mode & ARMED_FLAG)


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """SERVO_OUTPUT_RAW: output pulses of the controller, sixteen channels [us], 0 for none."""

    time_us: int
    pulses_us: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ChannelsOverride:
    """RC_CHANNELS_OVERRIDE: pulses wanted, up to eighteen channels [us].

    Channels that are not given: "ignore" for the first eight, nothing at all for the extensions.
    """

    pulses_us: tuple[int, ...]
    target_system: int = 1
    target_component: int = 1


@dataclass(frozen=True, slots=True)
class CommandLong:
    """COMMAND_LONG: a command with its first parameter; the other six are zero."""

    command: int
    parameter: float
    confirmation: int = 0
    target_system: int = 1
    target_component: int = 1


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK: a command, its MAV_RESULT (0 for accepted), and who gave the command (0: unknown)."""

    command: int
    result: int
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True, slots=True)
class BatteryStatus:
    """BATTERY_STATUS: sum of the cells that are known [V], current [A] or None.

    On the wire: millivolts, cells that do not exist say 65535; hundredths of an ampere, -1 where not measured.
    """

    voltage_V: float
    current_A: float | None


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT: a sentence of at most 50 bytes, with MAV_SEVERITY (0 emergency to 7 debug)."""

    severity: int
    text: str


Message: TypeAlias = Heartbeat | ServoOutput | ChannelsOverride | CommandLong | CommandAck | BatteryStatus | StatusText


class _Layout(NamedTuple):
    """Number, CRC_EXTRA and fields of a message, by size and extensions last; their values, and the way back."""

    number: int
    crc_extra: int
    fields: struct.Struct
    values: Callable[[Any], tuple[Any, ...]]
    of: Callable[[tuple[Any, ...]], Message]


_MESSAGES: Mapping[type[Message], _Layout] = {
    Heartbeat: _Layout(
        *(0, 50, struct.Struct("<IBBBBB")),
        values=lambda m: (0, m.type, m.autopilot, m.base_mode, m.system_status, m.version),
        of=lambda v: Heartbeat(*v[1:]),
    ),
    ServoOutput: _Layout(  # the port, between the first and the second eight channels, is always 0
        *(36, 222, struct.Struct("<I8HB8H")),
        values=lambda m: (m.time_us, *_filled(m.pulses_us[:8], 8), 0, *_filled(m.pulses_us[8:], 8)),
        of=lambda v: ServoOutput(v[0], (*v[1:9], *v[10:])),
    ),
    ChannelsOverride: _Layout(
        *(70, 124, struct.Struct("<8HBB10H")),
        values=lambda m: (
            *_filled(m.pulses_us[:8], 8, UNKNOWN),
            *(m.target_system, m.target_component),
            *_filled(m.pulses_us[8:], 10),
        ),
        of=lambda v: ChannelsOverride((*v[:8], *v[10:]), v[8], v[9]),
    ),
    CommandLong: _Layout(
        *(76, 152, struct.Struct("<7fHBBB")),
        values=lambda m: (
            *_filled((m.parameter,), 7),
            *(m.command, m.target_system, m.target_component, m.confirmation),
        ),
        of=lambda v: CommandLong(v[7], v[0], v[10], v[8], v[9]),
    ),
    CommandAck: _Layout(
        *(77, 143, struct.Struct("<HBBiBB")),
        values=lambda m: (m.command, m.result, 0, 0, m.target_system, m.target_component),
        of=lambda v: CommandAck(*v[:2], *v[4:]),
    ),
    BatteryStatus: _Layout(
        *(147, 154, struct.Struct("<iih10HhBBBbiB4HBI")),
        values=lambda m: (
            *(-1, -1, 0x7FFF, *_filled((round(m.voltage_V * 1e3),), 10, UNKNOWN)),
            *(-1 if m.current_A is None else round(m.current_A * 100.0), 0, 0, 0, -1, *(0,) * 8),
        ),
        of=lambda v: BatteryStatus(
            sum(cell for cell in v[3:13] if cell != UNKNOWN) / 1e3, None if v[13] < 0 else v[13] / 100.0
        ),
    ),
    StatusText: _Layout(
        *(253, 83, struct.Struct("<B50sHB")),
        values=lambda m: (m.severity, m.text.encode(), 0, 0),
        of=lambda v: StatusText(v[0], v[1].partition(b"\x00")[0].decode(errors="replace")),
    ),
}
_BY_NUMBER = {layout.number: layout for layout in _MESSAGES.values()}
_OTHERS = """
1:124:43 2:137:12 4:237:14 20:214:20 21:159:2 22:220:25 23:168:23 24:24:52 26:170:24 27:144:29 29:115:16
30:39:28 31:246:48 32:185:28 33:104:28 35:244:22 39:254:38 40:230:5 42:28:6 43:132:3 44:221:5 45:232:3
46:11:2 47:153:4 51:196:5 62:183:26 65:118:42 66:148:6 69:243:30 73:38:38 74:20:20 75:158:35 83:22:37
85:140:51 87:150:51 105:93:63 109:185:9 111:34:16 116:76:24 125:203:6 129:46:24 132:85:39
136:1:22 137:195:16 141:47:32 143:131:16 148:178:78 152:208:8 163:127:28 165:21:3 173:83:8 178:47:24
181:174:4 193:71:26 230:163:42 241:90:32 242:104:60 244:95:6 245:130:2 251:170:18 252:44:18
"""
_LAYOUTS = {layout.number: (layout.crc_extra, layout.fields.size) for layout in _MESSAGES.values()} | {
    number: (extra, longest) for number, extra, longest in (map(int, one.split(":")) for one in _OTHERS.split())
}
"""CRC_EXTRA and longest payload by number: of the messages above, and of messages that ground stations and autopilots
send (message sets common and ardupilotmega), so that those verify and are no rejects."""


@dataclass(frozen=True, slots=True)
class MavlinkFrame:
    """A message whose checksum holds, and who sent it; None for a message that is not read here."""

    system: int
    component: int
    sequence: int
    message: Message | None


def encode(message: Message, sequence: int, system: int = 1, component: int = 191) -> bytes:
    """One frame. Zeros at the end of the payload are left out, but for its first byte."""
    layout = _MESSAGES[type(message)]
    payload = layout.fields.pack(*layout.values(message)).rstrip(b"\x00") or b"\x00"
    head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence & 0xFF, system, component)
    body = head + layout.number.to_bytes(3, "little") + payload
    return bytes([STX]) + body + checksum(body, layout.crc_extra).to_bytes(2, "little")


def checksum(body: bytes, crc_extra: int) -> int:
    """CRC-16/MCRF4XX of a frame without its start byte, then of the byte of its definition."""
    crc = 0xFFFF
    for byte in body:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc >> 8 ^ _TABLE[(crc ^ crc_extra) & 0xFF]


def _filled(values: tuple[float, ...], count: int, rest: int = 0) -> tuple[float, ...]:
    return (values + (rest,) * count)[:count]


class Decoder:
    """Cuts a stream of bytes into frames; any cutting of the stream gives the same events.

    An invalid start byte is dropped alone, and the following bytes are scanned again: no frame is lost to
    garbage before it, nor to a corrupt length.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._refused = bytearray()
        self._why = ""

    def feed(self, data: bytes, stamp: Stamp) -> Iterator[MavlinkFrame | Rejected]:
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

    def _pop_frame(self, size: int) -> MavlinkFrame:
        _, length, _, _, sequence, system, component = self._buffer[:7]
        layout = _BY_NUMBER.get(self._number())
        payload = bytes(self._buffer[HEAD : HEAD + length])
        del self._buffer[:size]
        if layout is None:
            return MavlinkFrame(system, component, sequence, None)
        values = layout.fields.unpack(payload.ljust(layout.fields.size, b"\x00"))
        return MavlinkFrame(system, component, sequence, layout.of(values))

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
