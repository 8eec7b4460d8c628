"""Faults of a serial device and its line, and the line that suffers them.

Each fault changes what passes in either direction while it lasts; some begin or end by doing something to the device.
Whatever is random in one comes from its seed. Faults compose: a line may have several at once, in the order given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hindrax_sim.devices.serial_emulator import SerialEmulator


class StreamFault(Protocol):
    """One fault of a serial device. `outgoing` is what the device says, `incoming` what the host says."""

    connected: bool
    """Whether the port is there at all while the fault lasts."""

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """The fault sets in."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """What arrives at the host, in the chunks in which it arrives.

        Called with nothing as time passes, and once with infinite time at the end, to give back what is held.
        """

    def incoming(self, data: bytes, now_s: float) -> bytes:
        """What arrives at the device."""

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """The fault is over."""


class Harmless:
    """Passes everything; the other faults differ from it in what they break."""

    connected = True

    def __init__(self, seed: int = 0) -> None:
        self._random = np.random.default_rng(seed)

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Do nothing."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Pass it on."""
        del now_s
        return [data] if data else []

    def incoming(self, data: bytes, now_s: float) -> bytes:
        """Pass it on."""
        del now_s
        return data

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Do nothing."""

    def _chance(self, probability: float) -> bool:
        return bool(self._random.random() < probability)

    def _noise(self, count: int) -> bytes:
        return self._random.integers(0, 256, count, dtype=np.uint8).tobytes()


class Absent(Harmless):
    """Nothing is plugged in behind the port: no byte comes, none is heard."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Nothing."""
        del data, now_s
        return []

    def incoming(self, data: bytes, now_s: float) -> bytes:
        """Nothing."""
        del data, now_s
        return b""


class UnplugReplug(Absent):
    """The port vanishes and comes back; the device loses its power with it."""

    connected = False

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Power comes back."""
        device.power_cycle(now_s)


class WrongIdentity(Harmless):
    """Another device answers."""

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Swap the devices."""
        del now_s
        device.disguise(True)

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Swap them back."""
        del now_s
        device.disguise(False)


class Saturated(Harmless):
    """Measurements at the end of their scale."""

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Go to the end of the scale."""
        del now_s
        device.saturate(True)

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Come back."""
        del now_s
        device.saturate(False)


class Reset(Harmless):
    """The device starts anew in mid-stream, at the beginning; what it was saying is cut."""

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Power is lost for a moment."""
        device.power_cycle(now_s)


class ClockJump(Harmless):
    """The device's clock leaps ahead, and back at the end."""

    LEAP_S = 1000.0

    def begin(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Leap ahead."""
        del now_s
        device.jump_clock(self.LEAP_S)

    def end(self, device: SerialEmulator[Any], now_s: float) -> None:
        """Leap back."""
        del now_s
        device.jump_clock(-self.LEAP_S)


class CutFrames(Harmless):
    """A piece is missing from every second message."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Cut a piece of random place and length out."""
        del now_s
        if len(data) < 2 or self._chance(0.5):
            return [data] if data else []
        start, stop = sorted(self._random.choice(len(data) + 1, 2, replace=False).tolist())
        return [part for part in (data[:start], data[stop:]) if part]


class Bytewise(Harmless):
    """Every byte arrives by itself."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Split into bytes."""
        del now_s
        return [data[at : at + 1] for at in range(len(data))]


class Merged(Harmless):
    """Bytes are held back and arrive a quarter of a second at a time."""

    HOLD_S = 0.25

    def __init__(self, seed: int = 0) -> None:
        super().__init__(seed)
        self._held = b""
        self._until_s = -math.inf

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Hold until the time is over."""
        self._held += data
        if now_s < self._until_s or not self._held:
            return []
        held, self._held, self._until_s = self._held, b"", now_s + self.HOLD_S
        return [held]


class Garbage(Harmless):
    """Bursts of up to 300 random bytes before, inside and behind messages."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Put a burst somewhere."""
        del now_s
        if not data:
            return [self._noise(int(self._random.integers(1, 300)))] if self._chance(0.02) else []
        if self._chance(0.4):
            return [data]
        place = int(self._random.integers(0, len(data) + 1))
        return [data[:place] + self._noise(int(self._random.integers(1, 300))) + data[place:]]


class BitFlips(Harmless):
    """One bit in a thousand is wrong."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Flip."""
        del now_s
        if not data:
            return []
        bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8))
        wrong = self._random.random(bits.size) < 0.001
        return [np.packbits(bits ^ wrong).tobytes()]


class BaudMismatch(Harmless):
    """Both ends read the line at another speed than the other speaks: fewer bytes, none of them right."""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Read wrongly."""
        del now_s
        return [self._noise(1 + len(data) * 2 // 3)] if data else []

    def incoming(self, data: bytes, now_s: float) -> bytes:
        """Read wrongly."""
        del now_s
        return self._noise(1 + len(data) * 2 // 3) if data else b""


class Repeated(Harmless):
    """The device is stuck: whatever it would say, it says its last words again."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__(seed)
        self._last = b""

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Say the first words again."""
        del now_s
        self._last = self._last or data
        return [self._last] if data else []


@dataclass(frozen=True, slots=True)
class Scheduled:
    """A fault and the time in which it lasts."""

    fault: StreamFault
    start_s: float
    end_s: float


class FaultyLine:
    """A SerialEmulator that suffers faults between its device and the host."""

    def __init__(self, device: SerialEmulator[Any], schedule: Sequence[Scheduled]) -> None:
        self.device = device
        self._waiting = sorted(schedule, key=lambda one: one.start_s)
        self._active: list[Scheduled] = []
        self._late: list[bytes] = []

    @property
    def baud(self) -> int:
        """Line speed of the device."""
        return self.device.baud

    @property
    def connected(self) -> bool:
        """Whether the port is there."""
        return all(one.fault.connected for one in self._active)

    @property
    def next_due_s(self) -> float:
        """As that of the device; at once while a fault lasts, and at the next fault's beginning at the latest."""
        if self._active:
            return -math.inf
        return min(self.device.next_due_s, self._waiting[0].start_s if self._waiting else math.inf)

    def set_truth(self, truth: Any) -> None:
        """Tell the device."""
        self.device.set_truth(truth)

    def step(self, now_s: float) -> bytes:
        """Everything that arrives at the host now."""
        return b"".join(self.chunks(now_s))

    def chunks(self, now_s: float) -> list[bytes]:
        """Everything that arrives at the host now, in the chunks in which it arrives."""
        self._change(now_s)
        late, self._late = self._late, []
        data = self.device.step(now_s)
        return late + (self._out(data, now_s) if self._active else [data] if data else [])

    def _out(self, data: bytes, now_s: float) -> list[bytes]:
        chunks = [data]
        for one in self._active:
            chunks = [piece for chunk in chunks for piece in one.fault.outgoing(chunk, now_s)] or [b""]
        return [chunk for chunk in chunks if chunk]

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Pass the host's bytes through the faults to the device, and its answer back."""
        self._change(now_s)
        for one in reversed(self._active):
            data = one.fault.incoming(data, now_s)
        answer = self.device.receive(data, now_s)
        return b"".join(self._out(answer, now_s)) if answer else b""

    def _change(self, now_s: float) -> None:
        """Let faults begin and end."""
        while self._waiting and self._waiting[0].start_s <= now_s:
            one = self._waiting.pop(0)
            one.fault.begin(self.device, now_s)
            self._active.append(one)
        for one in [one for one in self._active if one.end_s <= now_s]:
            self._active.remove(one)
            self._late += one.fault.outgoing(b"", math.inf)
            one.fault.end(self.device, now_s)

    def power_cycle(self, now_s: float) -> None:
        """Pass on."""
        self.device.power_cycle(now_s)

    def jump_clock(self, seconds: float) -> None:
        """Pass on."""
        self.device.jump_clock(seconds)

    def disguise(self, on: bool) -> None:
        """Pass on."""
        self.device.disguise(on)

    def saturate(self, on: bool) -> None:
        """Pass on."""
        self.device.saturate(on)
