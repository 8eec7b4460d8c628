"""Interface of an emulator of a serial device, and the line that delays its bytes."""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol


class SerialEmulator(Protocol):
    """A device on the far end of a serial line. Time is an argument: seconds of the simulated world, never less."""

    @property
    def next_due_s(self) -> float:
        """Time of the next output of the device by itself; before it, `step` returns nothing."""

    def step(self, now_s: float) -> bytes:
        """Return the output of the device since the last call; cheap when there is none."""

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Handle bytes of the host; return the answers."""


class BaudRateLine:
    """A line with a baud rate: a message arrives with its last bit, and messages queue."""

    def __init__(self, baud: int) -> None:
        self._s_per_byte = 10.0 / baud
        self._queue: deque[tuple[float, bytes]] = deque()
        self._free_s = -math.inf

    @property
    def next_s(self) -> float:
        """Time at which the next message is complete; infinity when there is none."""
        return self._queue[0][0] if self._queue else math.inf

    def send(self, message: bytes, now_s: float) -> None:
        """Send a message at this time, or when the line is free."""
        self._free_s = max(now_s, self._free_s) + len(message) * self._s_per_byte
        self._queue.append((self._free_s, message))

    def receive_complete(self, now_s: float) -> bytes:
        """Return the messages that are complete by now."""
        taken = []
        while self._queue and self._queue[0][0] <= now_s:
            taken.append(self._queue.popleft()[1])
        return b"".join(taken)

    def clear(self) -> None:
        """Discard unsent messages after a power loss."""
        self._queue.clear()
        self._free_s = -math.inf
