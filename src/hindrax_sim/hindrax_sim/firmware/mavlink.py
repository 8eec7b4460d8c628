"""The MAVLink 2 subset of the thruster controller.

Frames: https://mavlink.io/en/guide/serialization.html; messages: https://mavlink.io/en/messages/common.html.
Nothing here may need more than MicroPython has: no dataclasses, no typing, no enum.
"""

import struct

STX = 0xFD
HEARTBEAT, SERVO_OUTPUT_RAW, RC_CHANNELS_OVERRIDE = 0, 36, 70
COMMAND_LONG, COMMAND_ACK, BATTERY_STATUS, STATUSTEXT = 76, 77, 147, 253

CRC_EXTRA = {
    HEARTBEAT: 50,
    SERVO_OUTPUT_RAW: 222,
    RC_CHANNELS_OVERRIDE: 124,
    COMMAND_LONG: 152,
    COMMAND_ACK: 143,
    BATTERY_STATUS: 154,
    STATUSTEXT: 83,
}
# What this end listens to, with the longest payload of each.
RECEIVED = {HEARTBEAT: 9, RC_CHANNELS_OVERRIDE: 38, COMMAND_LONG: 33}
HEAD, CHECKSUM = 10, 2


def checksum(data: bytes, extra: int) -> int:
    """CRC-16/MCRF4XX over a frame without its start byte, and over the byte that stands for the message definition."""
    crc = 0xFFFF
    for byte in data:
        crc = _add(crc, byte)
    return _add(crc, extra)


def _add(crc: int, byte: int) -> int:
    mixed = (byte ^ crc) & 0xFF
    mixed = (mixed ^ (mixed << 4)) & 0xFF
    return (crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)


def frame(message: int, payload: bytes, sequence: int, system: int, component: int) -> bytes:
    """Encode a frame; trailing zeros of the payload are omitted, as MAVLink 2 requires.

    Parameters
    ----------
    message, payload
        Number, and fields in the order of the wire.
    sequence, system, component
        Of the sender.

    Returns
    -------
    bytes
        From the start byte to the checksum.
    """
    length = len(payload)
    while length > 1 and payload[length - 1] == 0:
        length -= 1
    head = struct.pack("<BBBBBB", length, 0, 0, sequence & 0xFF, system, component)
    body = head + bytes((message & 0xFF, message >> 8 & 0xFF, message >> 16)) + payload[:length]
    return bytes((STX,)) + body + struct.pack("<H", checksum(body, CRC_EXTRA[message]))


class Parser:
    """Splits a byte stream into frames. An invalid start skips one byte only, so no frame is lost."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected = 0

    def feed(self, data: bytes) -> list[tuple[int, int, bytes]]:
        """Sender's system, number and payload (padded) of every complete frame of a supported message."""
        self._buffer.extend(data)
        found = []
        while len(self._buffer) >= HEAD:
            size = self._size()
            if size > len(self._buffer):
                break
            message = self._message() if size and self._valid(size) else -1
            if message >= 0:
                found.append((self._buffer[5], message, self._payload(message)))
                self._buffer = self._buffer[size:]
            else:
                self._skip()
        return found

    def _size(self) -> int:
        """Length of the frame that begins here; zero for none."""
        buffer = self._buffer
        if buffer[0] != STX or buffer[2] or not 0 < buffer[1] <= RECEIVED.get(self._message(), 0):
            return 0
        return HEAD + buffer[1] + CHECKSUM

    def _message(self) -> int:
        return self._buffer[7] | self._buffer[8] << 8 | self._buffer[9] << 16

    def _valid(self, size: int) -> bool:
        body = bytes(self._buffer[1 : size - CHECKSUM])
        found = self._buffer[size - 2] | self._buffer[size - 1] << 8
        return checksum(body, CRC_EXTRA[self._message()]) == found

    def _payload(self, message: int) -> bytes:
        length = self._buffer[1]
        return bytes(self._buffer[HEAD : HEAD + length]) + bytes(RECEIVED[message] - length)

    def _skip(self) -> None:
        """Drop one byte, and all that follow it up to the next start byte."""
        self.rejected += 1
        start = 1
        while start < len(self._buffer) and self._buffer[start] != STX:
            start += 1
        self._buffer = self._buffer[start:]


def heartbeat(armed: bool, status: int) -> bytes:
    """Payload of HEARTBEAT: a submarine's generic controller, armed or not, with its MAV_STATE."""
    return struct.pack("<IBBBBB", 0, 12, 0, 0x80 if armed else 0, status, 3)


def servo_output(now_us: int, pulses: list[int]) -> bytes:
    """Payload of SERVO_OUTPUT_RAW: pulses of the first sixteen channels [us], 0 for none."""
    channels = (list(pulses) + [0] * 16)[:16]
    head = struct.pack("<I8HB", now_us & 0xFFFFFFFF, *channels[:8], 0)
    return head + struct.pack("<8H", *channels[8:])


def command_ack(command: int, result: int) -> bytes:
    """Payload of COMMAND_ACK with a MAV_RESULT."""
    return struct.pack("<HB", command, result)


def status_text(severity: int, text: str) -> bytes:
    """Payload of STATUSTEXT, cut to its 50 characters."""
    encoded = text.encode()[:50]
    return bytes((severity,)) + encoded + bytes(50 - len(encoded))


def battery_status(millivolts: int) -> bytes:
    """Payload of BATTERY_STATUS: the voltage as that of one cell, everything else unknown."""
    cells = [min(millivolts, 0xFFFE)] + [0xFFFF] * 9
    return struct.pack("<iih10HhBBBb", -1, -1, 0x7FFF, *cells, -1, 0, 0, 0, -1)
