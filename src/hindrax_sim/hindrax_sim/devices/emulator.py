"""Interface of an emulator file (EMULATOR), and the base of parts that measure."""

import errno
import math
import os
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from hindrax_core.vehicle import Mount
from hindrax_sim.world import Mounting, World

TruthT = TypeVar("TruthT")


@dataclass(frozen=True, slots=True)
class Emulator:
    """`make(seed)` gives the part, `truth(world, mounting)` what is true at its place in the mock world.

    The contract sweep uses the other two: `example(seconds)` is a truth that moves as a vehicle might, and
    `agrees(truth, reading)`: whether a reading matches a truth within the accuracy of the data sheet.
    """

    make: Callable[[int], Any]
    truth: Callable[[World, Mounting], object]
    example: Callable[[float], object]
    agrees: Callable[[Any, Any], bool]
    address: int = 0
    """Its I2C address, or line of a GPIO chip, where the vehicle file gives none; 0 for a part on a serial line."""
    also_at: Callable[[Any, Mount], dict[int, Any]] = lambda _part, _mount: {}
    """Further addresses on the bus that the same part answers at, as it is mounted."""


class Part(Generic[TruthT]):
    """An emulated part: the truth at its place, its noise, and its faults, described in its class."""

    def __init__(self, truth: TruthT, noise: str = "") -> None:
        self._truth = truth
        self._draw = random.Random(noise)  # noqa: S311  # noise, not secrets
        self._disguised = self._saturated = self._hung = False

    def set_truth(self, truth: TruthT, _now_s: float) -> None:
        """Set the truth from now on."""
        self._truth = truth

    def power_cycle(self, now_s: float) -> None:
        """Fault, and power-up: power is lost and comes back at once; NotImplementedError of a part that cannot."""
        raise NotImplementedError

    def jump_clock(self, seconds: float) -> None:
        """Fault: the part's clock jumps; no effect on a part without one."""

    def disguise(self, on: bool) -> None:
        """Fault: another part answers in its place."""
        self._disguised = on

    def saturate(self, on: bool) -> None:
        """Fault: measurements are at the end of their scale, well framed and confident."""
        self._saturated = on

    def hang(self, on: bool) -> None:
        """Fault: the converters repeat the last values."""
        self._hung = on


class RegisterEmulator(Protocol):
    """A device at an address. Time is an argument; NackError refuses a transfer as a silent device would."""

    def write(self, data: bytes, now_s: float) -> None:
        """Bytes of one write, after the address."""

    def read(self, count: int, now_s: float) -> bytes:
        """Return `count` bytes for a read."""


class NackError(OSError):
    """No acknowledge, which a kernel reports as EREMOTEIO."""

    def __init__(self) -> None:
        super().__init__(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))


class BusStuckError(OSError):
    """A line is held low, which a kernel reports as ETIMEDOUT."""

    def __init__(self) -> None:
        super().__init__(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))


def refuse(_count: int, _now_s: float) -> bytes:
    """Refuse a read by NackError: no device answers."""
    raise NackError


@dataclass(slots=True)
class FurtherAddress:
    """A further address of a part, by default one that is only written to."""

    write: Callable[[bytes, float], None]
    read: Callable[[int, float], bytes] = refuse


class SerialEmulator(Protocol):
    """A device on the far end of a serial line. Time is an argument: seconds of the simulated world, never less."""

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
