"""The FIFO of the ICM-20948: 512 bytes, stream or snapshot. TDK DS-000189 r1.3, registers 0x66 to 0x72."""

from __future__ import annotations

SIZE = 512
ACCEL, GYRO, TEMPERATURE = 0x10, 0x0E, 0x01
SNAPSHOT = 0x01
NOTHING = 0xFF


class Fifo:
    """First in, first out; when full, stream mode loses its oldest bytes."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.overflowed = False

    def __len__(self) -> int:
        return len(self._bytes)

    def empty(self) -> None:
        """Clear content and overflow."""
        self._bytes.clear()
        self.overflowed = False

    def push(self, sample: bytes, temperature: bytes, chosen: int, mode: int) -> None:
        """Append the chosen parts (FIFO_EN_2) of a sample: accel x, y, z, gyro x, y, z, temperature."""
        parts = sample[0:6] if chosen & ACCEL else b""
        for axis in range(3):
            parts += sample[6 + 2 * axis : 8 + 2 * axis] if chosen & 0x02 << axis else b""
        parts += temperature if chosen & TEMPERATURE else b""
        over = len(self._bytes) + len(parts) - SIZE
        if over > 0:
            self.overflowed = True
            if mode & SNAPSHOT:
                return
            del self._bytes[:over]
        self._bytes += parts

    def pop(self, count: int) -> bytes:
        """Remove and return bytes; an empty FIFO gives ones."""
        found = bytes(self._bytes[:count])
        del self._bytes[:count]
        return found + bytes([NOTHING]) * (count - len(found))
