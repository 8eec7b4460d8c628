"""What every emulator of a serial device offers, and the wire that its bytes take their time on."""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol, TypeVar

TruthT_contra = TypeVar("TruthT_contra", contravariant=True)


class SerialEmulator(Protocol[TruthT_contra]):
    """A device on the far end of a serial line. Time is an argument: seconds of the simulated world, never less."""

    @property
    def baud(self) -> int:
        """Line speed of the device."""

    @property
    def next_due_s(self) -> float:
        """Time at which the device will have something to say by itself; before it, `step` returns nothing."""

    def set_truth(self, truth: TruthT_contra) -> None:
        """Tell what is really there, as of the next `step`."""

    def step(self, now_s: float) -> bytes:
        """Return what the device has put on the wire since the last call; cheap when that is nothing."""

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Take bytes of the host; return the answers."""

    def power_cycle(self, now_s: float) -> None:
        """Fault: power is lost and comes back at once."""

    def jump_clock(self, seconds: float) -> None:
        """Fault: the device's own clock leaps; nothing happens to a device without one."""

    def disguise(self, on: bool) -> None:
        """Fault: another device answers in its place."""

    def saturate(self, on: bool) -> None:
        """Fault: measurements are at the end of their scale, well framed and confident."""


class Wire:
    """A line with a speed: a message is there when its last bit is, and messages wait for each other."""

    def __init__(self, baud: int) -> None:
        self._s_per_byte = 10.0 / baud
        self._queue: deque[tuple[float, bytes]] = deque()
        self._free_s = -math.inf

    @property
    def next_s(self) -> float:
        """Time at which the next message is complete; infinity when there is none."""
        return self._queue[0][0] if self._queue else math.inf

    def put(self, message: bytes, now_s: float) -> None:
        """Begin to send a message at this time, or when the line is free."""
        self._free_s = max(now_s, self._free_s) + len(message) * self._s_per_byte
        self._queue.append((self._free_s, message))

    def take(self, now_s: float) -> bytes:
        """Messages that are complete by now."""
        taken = []
        while self._queue and self._queue[0][0] <= now_s:
            taken.append(self._queue.popleft()[1])
        return b"".join(taken)

    def clear(self) -> None:
        """Power is gone: what was not yet sent is never sent."""
        self._queue.clear()
        self._free_s = -math.inf
