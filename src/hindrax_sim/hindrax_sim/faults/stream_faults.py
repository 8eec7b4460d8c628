"""Faults of a serial device and its line, and the line that applies them.

Each fault changes the data in either direction while it lasts; some begin or end with an action on the device.
Whatever is random in one comes from its seed. Faults compose: a line may have several at once, in the order given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from hindrax_sim.devices.serial_emulator import SerialEmulator
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled, Switch

LEAP_S = 1000.0


class StreamFault:
    """One fault of a serial device; this one passes everything unchanged."""

    connected = True
    """Whether the port is there at all while the fault lasts."""

    def __init__(self, seed: int = 0, switch: Switch = lambda _device, _on, _now_s: None) -> None:
        self._random, self._switch = np.random.default_rng(seed), switch

    def switch(self, device: Any, on: bool, now_s: float) -> None:
        """Act on the device as the fault starts, and as it ends."""
        self._switch(device, on, now_s)

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Return the chunks of the device's bytes that reach the host.

        Called without data as time passes, and once with infinite time at the end, to return held bytes.
        """
        return [data] if data else []

    def incoming(self, data: bytes, _now_s: float) -> bytes:
        """Return the bytes of the host that reach the device."""
        return data

    def _chance(self, probability: float) -> bool:
        return bool(self._random.random() < probability)

    def _noise(self, count: int) -> bytes:
        return self._random.integers(0, 256, count, dtype=np.uint8).tobytes()


WrongIdentity = partial(StreamFault, switch=lambda device, on, _now_s: device.disguise(on))
"""Another device answers."""
Saturated = partial(StreamFault, switch=lambda device, on, _now_s: device.saturate(on))
"""Measurements at the end of their scale."""
Reset = partial(StreamFault, switch=lambda device, on, now_s: on and device.power_cycle(now_s))
"""The device restarts in mid-stream; its current message is cut."""
ClockJump = partial(StreamFault, switch=lambda device, on, _now_s: device.jump_clock(LEAP_S if on else -LEAP_S))
"""The device's clock jumps ahead, and back at the end."""


class Absent(StreamFault):
    """No device at the port: no byte passes in either direction."""

    def outgoing(self, _data: bytes, _now_s: float) -> list[bytes]:
        """Nothing."""
        return []

    def incoming(self, _data: bytes, _now_s: float) -> bytes:
        """Nothing."""
        return b""


class UnplugReplug(Absent):
    """The port disappears and returns; the device loses its power meanwhile."""

    connected = False

    def switch(self, device: Any, on: bool, now_s: float) -> None:
        """Restore the power at the end."""
        if not on:
            device.power_cycle(now_s)


class CutFrames(StreamFault):
    """A piece is missing from every second message."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Cut a piece of random place and length out."""
        if len(data) < 2 or self._chance(0.5):
            return [data] if data else []
        start, stop = sorted(self._random.choice(len(data) + 1, 2, replace=False).tolist())
        return [part for part in (data[:start], data[stop:]) if part]


class Bytewise(StreamFault):
    """Every byte arrives by itself."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Split into bytes."""
        return [data[at : at + 1] for at in range(len(data))]


class Merged(StreamFault):
    """Bytes are delayed and arrive in blocks of a quarter of a second."""

    HOLD_S = 0.25

    def __init__(self, seed: int = 0) -> None:
        super().__init__(seed)
        self._held = b""
        self._until_s = -math.inf

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Hold bytes until the block is complete."""
        self._held += data
        if now_s < self._until_s or not self._held:
            return []
        held, self._held, self._until_s = self._held, b"", now_s + self.HOLD_S
        return [held]


class Garbage(StreamFault):
    """Bursts of up to 300 random bytes before, inside and behind messages."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Insert a burst at a random place."""
        if not data:
            return [self._noise(int(self._random.integers(1, 300)))] if self._chance(0.02) else []
        if self._chance(0.4):
            return [data]
        place = int(self._random.integers(0, len(data) + 1))
        return [data[:place] + self._noise(int(self._random.integers(1, 300))) + data[place:]]


class BitFlips(StreamFault):
    """One bit in a thousand is wrong."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Flip."""
        if not data:
            return []
        bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8))
        wrong = self._random.random(bits.size) < 0.001
        return [np.packbits(bits ^ wrong).tobytes()]


class BaudMismatch(StreamFault):
    """The two ends use different baud rates: fewer bytes arrive, all of them wrong."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Garble the bytes."""
        return [self._noise(1 + len(data) * 2 // 3)] if data else []

    def incoming(self, data: bytes, _now_s: float) -> bytes:
        """Garble the bytes."""
        return self._noise(1 + len(data) * 2 // 3) if data else b""


class Repeated(StreamFault):
    """The device is stuck: it repeats its last message."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__(seed)
        self._last = b""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Repeat the first message."""
        self._last = self._last or data
        return [self._last] if data else []


class FaultyLine:
    """A SerialEmulator: a device, and faults between it and the host."""

    def __init__(self, device: Any, schedule: Sequence[Scheduled[StreamFault]]) -> None:
        self.device: SerialEmulator = device
        self._schedule = FaultSchedule(schedule)
        self._late: list[bytes] = []

    @property
    def connected(self) -> bool:
        """Whether the port is plugged in."""
        return all(fault.connected for fault in self._schedule.active)

    @property
    def next_due_s(self) -> float:
        """As for the device; at once during a fault, and no later than the start of the next fault."""
        if self._schedule.active:
            return -math.inf
        return min(self.device.next_due_s, self._schedule.next_start_s)

    def step(self, now_s: float) -> bytes:
        """Return all bytes that arrive at the host now."""
        return b"".join(self.chunks(now_s))

    def chunks(self, now_s: float) -> list[bytes]:
        """Return all bytes that arrive at the host now, in chunks."""
        self._change(now_s)
        late, self._late = self._late, []
        data = self.device.step(now_s)
        return late + (self._out(data, now_s) if self._schedule.active else [data] if data else [])

    def _out(self, data: bytes, now_s: float) -> list[bytes]:
        chunks = [data]
        for fault in self._schedule.active:
            chunks = [piece for chunk in chunks for piece in fault.outgoing(chunk, now_s)] or [b""]
        return [chunk for chunk in chunks if chunk]

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Pass the host's bytes through the faults to the device, and its answer back."""
        self._change(now_s)
        for fault in reversed(self._schedule.active):
            data = fault.incoming(data, now_s)
        answer = self.device.receive(data, now_s)
        return b"".join(self._out(answer, now_s)) if answer else b""

    def _change(self, now_s: float) -> None:
        """Start and end faults."""
        for fault, on in self._schedule.advance(now_s):
            if not on:
                self._late += fault.outgoing(b"", math.inf)
            fault.switch(self.device, on, now_s)
