"""Faults of a device on the virtual I2C bus and of its wires, and the ports that apply them.

The counterpart of `stream_faults`: each fault changes the data while it lasts; some begin or end with an action on
the device. Random faults draw from their seed. Faults compose, in the order given.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from functools import partial
from typing import Any

from hindrax_sim.devices.register_emulator import BusStuckError, NackError, RegisterEmulator
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled, Switch


class BusFault:
    """One fault of a register device; this one passes everything unchanged.

    `device` is the part as a whole, whatever addresses it answers at.
    """

    def __init__(self, seed: int = 0, switch: Switch = lambda _device, _on, _now_s: None) -> None:
        self._random, self._switch = random.Random(seed), switch  # noqa: S311  # noise, not secrets

    def switch(self, device: Any, on: bool, now_s: float) -> None:
        """Act on the device as the fault starts, and as it ends."""
        self._switch(device, on, now_s)

    def write(self, data: bytes) -> bytes:
        """Return the bytes that reach the device; raises OSError as a bus does."""
        return data

    def read(self, data: bytes) -> bytes:
        """Return the bytes that reach the host; raises OSError as a bus does."""
        return data

    def _chance(self, probability: float) -> bool:
        return self._random.random() < probability


WrongIdentity = partial(BusFault, switch=lambda device, on, now_s: (device.power_cycle(now_s), device.disguise(on)))
"""Another part answers at the address; the exchange interrupts its power."""
Reset = partial(BusFault, switch=lambda device, on, now_s: on and device.power_cycle(now_s))
"""The device loses power briefly, at the start."""
Saturated = partial(BusFault, switch=lambda device, on, _now_s: device.saturate(on))
"""Measurements at the end of their scale."""
Repeated = partial(BusFault, switch=lambda device, on, _now_s: device.hang(on))
"""The converters hang: they repeat the last values."""


class Absent(BusFault):
    """No device acknowledges at the address."""

    def write(self, _data: bytes) -> bytes:
        """Refuse."""
        raise NackError

    def read(self, data: bytes) -> bytes:
        """Refuse."""
        return self.write(data)

    def switch(self, device: Any, on: bool, now_s: float) -> None:
        """Reconnect at the end, after a power cycle."""
        if not on:
            device.power_cycle(now_s)


class Nack(BusFault):
    """One transaction in ten is not acknowledged (Errno 121)."""

    SHARE = 0.1

    def write(self, data: bytes) -> bytes:
        """Refuse at random."""
        if self._chance(self.SHARE):
            raise NackError
        return data

    def read(self, data: bytes) -> bytes:
        """Refuse at random."""
        return self.write(data)


class BusStuck(BusFault):
    """A line is held low: every transaction times out (Errno 110)."""

    def write(self, _data: bytes) -> bytes:
        """Time out."""
        raise BusStuckError

    def read(self, data: bytes) -> bytes:
        """Time out."""
        return self.write(data)


class ShortRead(BusFault):
    """One read in ten ends before its last byte."""

    SHARE = 0.1

    def read(self, data: bytes) -> bytes:
        """Cut at random."""
        return data[: self._random.randrange(len(data))] if data and self._chance(self.SHARE) else data


class BitFlips(BusFault):
    """One bit in a thousand is read wrongly."""

    SHARE = 1e-3

    def read(self, data: bytes) -> bytes:
        """Flip bits at random."""
        bits = 8 * len(data)
        if not bits or not self._chance(1.0 - (1.0 - self.SHARE) ** bits):
            return data
        place = self._random.randrange(bits)
        wrong = bytearray(data)
        wrong[place >> 3] ^= 1 << (place & 7)
        return bytes(wrong)


class FaultyBus:
    """A part with faults; attach `at(port)` to the bus for each of its addresses."""

    def __init__(self, device: Any, schedule: Sequence[Scheduled[BusFault]]) -> None:
        self.device = device
        self._schedule = FaultSchedule(schedule)

    def at(self, port: RegisterEmulator) -> RegisterEmulator:
        """Put the faults between the bus and one address of the part."""
        return _FaultyPort(self, port)

    def active(self, now_s: float) -> list[BusFault]:
        """Start and end faults; return the active ones."""
        for fault, on in self._schedule.advance(now_s):
            fault.switch(self.device, on, now_s)
        return self._schedule.active


class _FaultyPort:
    """One address of a faulty part."""

    def __init__(self, part: FaultyBus, port: RegisterEmulator) -> None:
        self._part, self._port = part, port

    def write(self, data: bytes, now_s: float) -> None:
        """Forward the bytes that the faults let through."""
        for fault in reversed(self._part.active(now_s)):
            data = fault.write(data)
        self._port.write(data, now_s)

    def read(self, count: int, now_s: float) -> bytes:
        """Forward the bytes that the faults let through."""
        faults = self._part.active(now_s)
        data = self._port.read(count, now_s)
        for fault in faults:
            data = fault.read(data)
        return data
