"""Faults of a serial device and its line, and the line that applies them.

Each fault changes the data in either direction while it lasts; some begin or end with an action on the device.
Whatever is random in one comes from its seed. Faults compose: a line may have several at once, in the order given.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from hindrax_sim.devices.ardupilot.wire import second_stick
from hindrax_sim.devices.emulator import SerialEmulator
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled, Switch

LEAP_S = 1000.0
HOLD_S = 0.25
LOST_SHARE, LATE_S = 0.2, 0.3
Random: TypeAlias = np.random.Generator


class StreamFault:
    """One fault of a serial device: what it makes of a message for the host, and of bytes for the device.

    `connected`: whether the port exists while the fault lasts.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        switch: Switch = lambda _device, _on, _now_s: None,
        transmit: Callable[[Random, bytes], list[bytes]] = lambda _random, data: [data],
        receive: Callable[[Random, bytes], bytes] = lambda _random, data: data,
        connected: bool = True,
    ) -> None:
        self._random, self.switch, self.connected = np.random.default_rng(seed), switch, connected
        self._transmit, self._receive = transmit, receive

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Pass on bytes of the device.

        Called without data as time passes, and once with infinite time at the end, to return held bytes.

        Parameters
        ----------
        data
            What the device has sent.
        _now_s : [s]
            Time of the mock.

        Returns
        -------
        list[bytes]
            Chunks that reach the host now.
        """
        return self._transmit(self._random, data) if data else []

    def incoming(self, data: bytes) -> bytes:
        """Return the bytes of the host that reach the device."""
        return self._receive(self._random, data)


def _noise(random: Random, count: int) -> bytes:
    return random.integers(0, 256, count, dtype=np.uint8).tobytes()


def _garbled(random: Random, data: bytes) -> bytes:
    return _noise(random, 1 + len(data) * 2 // 3) if data else b""


def _cut(random: Random, data: bytes) -> list[bytes]:
    if len(data) < 2 or random.random() < 0.5:
        return [data]
    start, stop = sorted(random.choice(len(data) + 1, 2, replace=False).tolist())
    return [part for part in (data[:start], data[stop:]) if part]


def _flipped(random: Random, data: bytes) -> list[bytes]:
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8))
    return [np.packbits(bits ^ (random.random(bits.size) < 0.001)).tobytes()]


def _lost(random: Random, data: bytes) -> bytes:
    return b"" if random.random() < LOST_SHARE else data


def _arrived(random: Random, data: bytes) -> list[bytes]:
    return list(filter(None, [_lost(random, data)]))


WrongIdentity = partial(StreamFault, switch=lambda device, on, _now_s: device.disguise(on))
Saturated = partial(StreamFault, switch=lambda device, on, _now_s: device.saturate(on))
Reset = partial(StreamFault, switch=lambda device, on, now_s: on and device.power_cycle(now_s))
"""The device restarts in mid-stream; its current message is cut."""
ClockJump = partial(StreamFault, switch=lambda device, on, _now_s: device.jump_clock(LEAP_S if on else -LEAP_S))
"""The device's clock jumps ahead, and back at the end."""
Absent = partial(StreamFault, transmit=lambda _random, _data: [], receive=lambda _random, _data: b"")
"""No device at the port: no byte passes in either direction."""
UnplugReplug = partial(Absent, connected=False, switch=lambda device, on, now_s: on or device.power_cycle(now_s))
"""The port disappears and returns; the device loses its power meanwhile."""
LostFrames = partial(StreamFault, transmit=_arrived, receive=_lost)
"""One packet in five is lost, whole, in either direction."""
SecondStation = partial(StreamFault, receive=lambda _random, data: data + second_stick())
"""Another ground station of the same number holds its stick to starboard."""
CutFrames = partial(StreamFault, transmit=_cut)
"""A piece of random place and length is missing from every second message."""
Bytewise = partial(StreamFault, transmit=lambda _random, data: [data[at : at + 1] for at in range(len(data))])
BitFlips = partial(StreamFault, transmit=_flipped)
BaudMismatch = partial(StreamFault, transmit=lambda random, data: [_garbled(random, data)], receive=_garbled)
"""The two ends use different baud rates: fewer bytes arrive, all of them wrong."""


class Merged(StreamFault):
    """Bytes are delayed and arrive in blocks of a quarter of a second."""

    _held, _until_s = b"", -math.inf

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Hold bytes until the block is complete."""
        self._held += data
        if now_s < self._until_s or not self._held:
            return []
        held, self._held, self._until_s = self._held, b"", now_s + HOLD_S
        return [held]


class Garbage(StreamFault):
    """Bursts of up to 300 random bytes before, inside and behind messages."""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Insert a burst at a random place."""
        random = self._random
        if not data:
            return [_noise(random, int(random.integers(1, 300)))] if random.random() < 0.02 else []
        if random.random() < 0.4:
            return [data]
        place = int(random.integers(0, len(data) + 1))
        return [data[:place] + _noise(random, int(random.integers(1, 300))) + data[place:]]


class Repeated(StreamFault):
    """The device is stuck: it repeats its last message."""

    _last = b""

    def outgoing(self, data: bytes, _now_s: float) -> list[bytes]:
        """Repeat the first message."""
        self._last = self._last or data
        return [self._last] if data else []


class LateFrames(StreamFault):
    """What the device says arrives late, in its order."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__(seed)
        self._held: deque[tuple[float, bytes]] = deque()

    def outgoing(self, data: bytes, now_s: float) -> list[bytes]:
        """Hold each message for its time."""
        if data:
            self._held.append((now_s + LATE_S, data))
        due = []
        while self._held and self._held[0][0] <= now_s:
            due.append(self._held.popleft()[1])
        return due


class FaultyLine:
    """A SerialEmulator: a device, and faults between it and the host."""

    def __init__(self, device: SerialEmulator, schedule: Sequence[Scheduled[StreamFault]]) -> None:
        self.device: SerialEmulator = device
        self._schedule = FaultSchedule(schedule)
        self._late: list[bytes] = []

    @property
    def connected(self) -> bool:
        """Whether the port is plugged in."""
        return all(fault.connected for fault in self._schedule.active)

    def step(self, now_s: float) -> bytes:
        """Return all bytes that arrive at the host now."""
        return b"".join(self.chunks(now_s))

    def chunks(self, now_s: float) -> list[bytes]:
        """Return all bytes that arrive at the host now, in chunks."""
        self._change(now_s)
        late, self._late = self._late, []
        return late + self._out(self.device.step(now_s), now_s)

    def _out(self, data: bytes, now_s: float) -> list[bytes]:
        chunks = [data]
        for fault in self._schedule.active:
            chunks = [piece for chunk in chunks for piece in fault.outgoing(chunk, now_s)] or [b""]
        return [chunk for chunk in chunks if chunk]

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Pass the host's bytes through the faults to the device, and its answer back."""
        self._change(now_s)
        for fault in reversed(self._schedule.active):
            data = fault.incoming(data)
        answer = self.device.receive(data, now_s)
        return b"".join(self._out(answer, now_s)) if answer else b""

    def _change(self, now_s: float) -> None:
        for fault, on in self._schedule.advance(now_s):
            if not on:
                self._late += fault.outgoing(b"", math.inf)
            fault.switch(self.device, on, now_s)
