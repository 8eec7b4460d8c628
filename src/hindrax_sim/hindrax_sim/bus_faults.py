"""Faults of a device on the virtual I2C bus and of its wires, and the bus end that suffers them.

The counterpart of `stream_faults`: each fault changes what passes while it lasts; some begin or end by doing something
to the device. Whatever is random in one comes from its seed. Faults compose, in the order given.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hindrax_sim.devices.register_emulator import BusStuckError, NackError, RegisterEmulator


class BusFault(Protocol):
    """One fault of a register device. `device` is the part as a whole, whatever addresses it answers at."""

    def begin(self, device: Any, now_s: float) -> None:
        """The fault sets in."""

    def write(self, data: bytes) -> bytes:
        """What arrives at the device; raises OSError as a bus does."""

    def read(self, data: bytes) -> bytes:
        """What arrives at the host; raises OSError as a bus does."""

    def end(self, device: Any, now_s: float) -> None:
        """The fault is over."""


class Harmless:
    """Passes everything; the other faults differ from it in what they break."""

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)  # noqa: S311  # noise, not secrets

    def begin(self, device: Any, now_s: float) -> None:
        """Do nothing."""

    def write(self, data: bytes) -> bytes:
        """Pass it on."""
        return data

    def read(self, data: bytes) -> bytes:
        """Pass it on."""
        return data

    def end(self, device: Any, now_s: float) -> None:
        """Do nothing."""

    def _chance(self, probability: float) -> bool:
        return self._random.random() < probability


class Absent(Harmless):
    """Nobody acknowledges at the address."""

    def write(self, data: bytes) -> bytes:
        """Refuse."""
        del data
        raise NackError

    def read(self, data: bytes) -> bytes:
        """Refuse."""
        del data
        raise NackError

    def end(self, device: Any, now_s: float) -> None:
        """Put back, with power off in between."""
        device.power_cycle(now_s)


class Nack(Harmless):
    """One transaction in ten is not acknowledged (Errno 121)."""

    SHARE = 0.1

    def write(self, data: bytes) -> bytes:
        """Refuse now and then."""
        if self._chance(self.SHARE):
            raise NackError
        return data

    def read(self, data: bytes) -> bytes:
        """Refuse now and then."""
        return self.write(data)


class BusStuck(Harmless):
    """A line is held low: every transaction times out (Errno 110)."""

    def write(self, data: bytes) -> bytes:
        """Time out."""
        del data
        raise BusStuckError

    def read(self, data: bytes) -> bytes:
        """Time out."""
        del data
        raise BusStuckError


class ShortRead(Harmless):
    """One read in ten ends before its last byte."""

    SHARE = 0.1

    def read(self, data: bytes) -> bytes:
        """Cut now and then."""
        return data[: self._random.randrange(len(data))] if data and self._chance(self.SHARE) else data


class BitFlips(Harmless):
    """One bit in a thousand is read wrongly."""

    SHARE = 1e-3

    def read(self, data: bytes) -> bytes:
        """Flip now and then."""
        bits = 8 * len(data)
        if not bits or not self._chance(1.0 - (1.0 - self.SHARE) ** bits):
            return data
        place = self._random.randrange(bits)
        wrong = bytearray(data)
        wrong[place >> 3] ^= 1 << (place & 7)
        return bytes(wrong)


class WrongIdentity(Harmless):
    """Another part answers at the address; the exchange takes its power away for a moment."""

    def begin(self, device: Any, now_s: float) -> None:
        """Swap the parts."""
        device.power_cycle(now_s)
        device.disguise(True)

    def end(self, device: Any, now_s: float) -> None:
        """Swap them back."""
        device.disguise(False)
        device.power_cycle(now_s)


class Reset(Harmless):
    """The device loses its power for a moment, at the beginning."""

    def begin(self, device: Any, now_s: float) -> None:
        """Power is lost."""
        device.power_cycle(now_s)


class Saturated(Harmless):
    """Measurements at the end of their scale."""

    def begin(self, device: Any, now_s: float) -> None:
        """Go to the end of the scale."""
        del now_s
        device.saturate(True)

    def end(self, device: Any, now_s: float) -> None:
        """Come back."""
        del now_s
        device.saturate(False)


class Repeated(Harmless):
    """The converters hang: the last values are given again and again."""

    def begin(self, device: Any, now_s: float) -> None:
        """Hang."""
        del now_s
        device.hang(True)

    def end(self, device: Any, now_s: float) -> None:
        """Go on."""
        del now_s
        device.hang(False)


@dataclass(frozen=True, slots=True)
class ScheduledBusFault:
    """A fault and the time in which it lasts."""

    fault: BusFault
    start_s: float
    end_s: float


class Afflicted:
    """A part that suffers faults; `at(port)` is what to attach to the bus for each address it answers at."""

    def __init__(self, device: Any, schedule: Sequence[ScheduledBusFault]) -> None:
        self.device = device
        self._waiting = sorted(schedule, key=lambda one: one.start_s)
        self._active: list[ScheduledBusFault] = []

    def at(self, port: RegisterEmulator) -> RegisterEmulator:
        """Put the faults between the bus and one address of the part."""
        return _FaultyPort(self, port)

    def active(self, now_s: float) -> list[BusFault]:
        """Let faults begin and end; those that last now."""
        while self._waiting and self._waiting[0].start_s <= now_s:
            one = self._waiting.pop(0)
            one.fault.begin(self.device, now_s)
            self._active.append(one)
        for one in [one for one in self._active if one.end_s <= now_s]:
            self._active.remove(one)
            one.fault.end(self.device, now_s)
        return [one.fault for one in self._active]


class _FaultyPort:
    """One address of an afflicted part."""

    def __init__(self, part: Afflicted, port: RegisterEmulator) -> None:
        self._part, self._port = part, port

    def write(self, data: bytes, now_s: float) -> None:
        """Pass on what the faults leave."""
        for fault in reversed(self._part.active(now_s)):
            data = fault.write(data)
        self._port.write(data, now_s)

    def read(self, count: int, now_s: float) -> bytes:
        """Pass on what the faults leave."""
        faults = self._part.active(now_s)
        data = self._port.read(count, now_s)
        for fault in faults:
            data = fault.read(data)
        return data
