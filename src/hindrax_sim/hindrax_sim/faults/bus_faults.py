"""Faults of a device on the virtual I2C bus and of its wires, and the port that applies them.

The counterpart of `stream_faults`: each fault changes the data while it lasts; some begin or end with an action on
the device. Random faults draw from their seed. Faults compose, in the order given.
"""

import random
from collections.abc import Callable
from functools import partial

from hindrax_sim.devices.emulator import BusStuckError, NackError, RegisterEmulator
from hindrax_sim.faults.fault_schedule import FaultSchedule, Switch


class BusFault:
    """One fault of a register device: this share of its transactions is refused. It acts on the part as a whole."""

    def __init__(
        self,
        seed: int = 0,
        *,
        switch: Switch = lambda _device, _on, _now_s: None,
        refuses: float = 0.0,
        error: type[OSError] = NackError,
        reads: Callable[[random.Random, bytes], bytes] = lambda _random, data: data,
    ) -> None:
        self._random, self.switch = random.Random(seed), switch  # noqa: S311  # noise, not secrets
        self._refuses, self._error, self._reads = refuses, error, reads

    def write(self, data: bytes) -> bytes:
        """Return the bytes that reach the device; raises OSError as a bus does."""
        if self._refuses and self._random.random() < self._refuses:
            raise self._error
        return data

    def read(self, data: bytes) -> bytes:
        """Return the bytes that reach the host; raises OSError as a bus does."""
        return self._reads(self._random, self.write(data))


def _short(draw: random.Random, data: bytes) -> bytes:
    return data[: draw.randrange(len(data))] if data and draw.random() < 0.1 else data


def _flipped(draw: random.Random, data: bytes) -> bytes:
    bits = 8 * len(data)
    if not bits or draw.random() >= 1.0 - (1.0 - 1e-3) ** bits:
        return data
    place = draw.randrange(bits)
    wrong = bytearray(data)
    wrong[place >> 3] ^= 1 << (place & 7)
    return bytes(wrong)


WrongIdentity = partial(BusFault, switch=lambda device, on, now_s: (device.power_cycle(now_s), device.disguise(on)))
"""Another part answers at the address; the exchange interrupts its power."""
Reset = partial(BusFault, switch=lambda device, on, now_s: on and device.power_cycle(now_s))
Saturated = partial(BusFault, switch=lambda device, on, _now_s: device.saturate(on))
Repeated = partial(BusFault, switch=lambda device, on, _now_s: device.hang(on))
"""The converters hang: they repeat the last values."""
Absent = partial(BusFault, refuses=1.0, switch=lambda device, on, now_s: on or device.power_cycle(now_s))
"""No device acknowledges at the address; it comes back after a power cycle."""
Nack = partial(BusFault, refuses=0.1)
"""One transaction in ten is not acknowledged (Errno 121)."""
BusStuck = partial(BusFault, refuses=1.0, error=BusStuckError)
"""A line is held low: every transaction times out (Errno 110)."""
ShortRead = partial(BusFault, reads=_short)
"""One read in ten ends before its last byte."""
BitFlips = partial(BusFault, reads=_flipped)
"""One bit in a thousand is read wrongly."""


class FaultyPort:
    """One address of a part, and the faults of the part between that and the bus."""

    def __init__(self, device: object, schedule: FaultSchedule[BusFault], port: RegisterEmulator) -> None:
        self._device, self._schedule, self._port = device, schedule, port

    def write(self, data: bytes, now_s: float) -> None:
        """Forward the bytes that the faults let through."""
        for fault in reversed(self._active(now_s)):
            data = fault.write(data)
        self._port.write(data, now_s)

    def read(self, count: int, now_s: float) -> bytes:
        """Forward the bytes that the faults let through."""
        faults = self._active(now_s)
        data = self._port.read(count, now_s)
        for fault in faults:
            data = fault.read(data)
        return data

    def _active(self, now_s: float) -> list[BusFault]:
        for fault, on in self._schedule.advance(now_s):
            fault.switch(self._device, on, now_s)
        return self._schedule.active
