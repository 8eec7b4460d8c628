"""MAVLink 2 of the emulated autopilot's side: https://mavlink.io/en/guide/serialization.html, set ardupilotmega."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

Fields: TypeAlias = tuple[float | bytes, ...]
"""Values of a message in the order of the wire; texts are bytes."""
STX, HEAD, CHECKSUM = 0xFD, 10, 2


@dataclass(frozen=True, slots=True)
class Layout:
    """CRC_EXTRA and fields of a message, in the order of the wire."""

    extra: int
    fields: struct.Struct


def _layout(extra: int, fields: str) -> Layout:
    return Layout(extra, struct.Struct(f"<{fields}"))


LAYOUTS = {
    0: _layout(50, "IBBBBB"),
    1: _layout(124, "3I2Hh6Hb3I"),
    20: _layout(214, "hBB16s"),
    22: _layout(220, "fHH16sB"),
    23: _layout(168, "fBB16sB"),
    27: _layout(144, "Q9hBh"),
    29: _layout(115, "Iffhh"),
    30: _layout(39, "I6f"),
    32: _layout(185, "I6f"),
    36: _layout(222, "I8HB8H"),
    65: _layout(118, "I18HBB"),
    69: _layout(243, "4hHBHB8h"),
    70: _layout(124, "8HBB10H"),
    76: _layout(152, "7fHBBB"),
    77: _layout(143, "HBBiBB"),
    132: _layout(85, "I3H4Bff4fB"),
    137: _layout(195, "Iffhh"),
    148: _layout(178, "2Q4I2H8s8s8s18s"),
    193: _layout(71, "5fHf"),
    251: _layout(170, "If10s"),
    253: _layout(83, "B50sHB"),
}


def _entry(crc: int) -> int:
    for _ in range(8):
        crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


_TABLE = tuple(map(_entry, range(256)))


def checksum(body: bytes, extra: int) -> int:
    """CRC-16/MCRF4XX."""
    crc = 0xFFFF
    for byte in (*body, extra):
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def frame(number: int, values: Fields, sequence: int, system: int, component: int) -> bytes:
    """Make one frame of MAVLink 2; zeros at the end of its payload are left out.

    Parameters
    ----------
    number, values
        Message, and its fields in the order of the wire.
    sequence, system, component
        Of the sender.

    Returns
    -------
    bytes
        From the start byte to the checksum.
    """
    layout = LAYOUTS[number]
    payload = layout.fields.pack(*values).rstrip(b"\x00") or b"\x00"
    body = struct.pack("<6B", len(payload), 0, 0, sequence & 0xFF, system, component)
    body += number.to_bytes(3, "little") + payload
    return bytes([STX]) + body + checksum(body, layout.extra).to_bytes(2, "little")


@dataclass(frozen=True, slots=True)
class Received:
    """A frame of somebody: who, what, its fields."""

    system: int
    component: int
    number: int
    values: tuple[Any, ...]


class Receiver:
    """Frames in a stream; what is none is skipped byte by byte."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[Received]:
        """Yield all complete frames of known messages."""
        rest = self._rest + data
        while (start := rest.find(STX)) >= 0:
            rest = rest[start:]
            size = HEAD + rest[1] + CHECKSUM if len(rest) > 1 else HEAD
            if len(rest) < size or len(rest) < HEAD:
                break
            found = _frame_in(rest[:size])
            if found is not None:
                yield found
            rest = rest[1:] if found is None else rest[size:]
        else:
            rest = b""
        self._rest = rest


def _frame_in(data: bytes) -> Received | None:
    number = int.from_bytes(data[7:10], "little")
    layout = LAYOUTS.get(number)
    if layout is None or data[1] > layout.fields.size or data[2]:
        return None
    if checksum(data[1:-CHECKSUM], layout.extra) != int.from_bytes(data[-CHECKSUM:], "little"):
        return None
    payload = data[HEAD:-CHECKSUM].ljust(layout.fields.size, b"\x00")
    return Received(data[5], data[6], number, layout.fields.unpack(payload))


def second_stick() -> bytes:
    """MANUAL_CONTROL of another ground station, to starboard, with the number that ArduPilot obeys."""
    station, its_component, autopilot = 255, 190, 1
    return frame(69, (0, 800, 500, 0, 0, autopilot, 0, 0, 0, 0, *(0,) * 6), 0, station, its_component)
