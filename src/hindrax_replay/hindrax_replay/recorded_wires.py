"""Raw wire frames of a bag, fed into their devices without port or clock.

A serial device receives its chunks at their recorded times; an empty sent frame means that its port was opened and the
device restarted. A register device runs its programs again, and each transaction is answered with the recorded bytes. A
transaction that is not the next of the record failed on the wire, for only successful ones were recorded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Program, Transaction, unpack_transaction
from hindrax_core.driver_interface import Output, RegisterDevice, SerialDevice
from hindrax_core.events import Stamp, after

TICK_S = 0.05
TRIES = 4
"""A program, its failure and its restart: more tries find nothing new."""
SENT = 1
"""hindrax_msgs/RawFrames: from the host to the device."""
UNHEARD = Stamp(0)
_transaction = lru_cache(4096)(unpack_transaction)
"""A device repeats the same few transactions."""


class RecordedWire(Protocol):
    """One device on its recorded frames."""

    stamp: Stamp
    strange: list[str]
    opened: list[Stamp]

    def frame(self, stamp: Stamp, direction: int, data: bytes) -> Iterable[Output]:
        """Take the next frame of the record."""


@dataclass(slots=True)
class SerialWire:
    """Frames into a serial device. What it sends is not compared: time-outs depend on ticks that nobody recorded."""

    device: SerialDevice
    stamp: Stamp = UNHEARD
    strange: list[str] = field(default_factory=list)
    opened: list[Stamp] = field(default_factory=list)
    """When its port was opened."""

    def frame(self, stamp: Stamp, direction: int, data: bytes) -> Iterator[Output]:
        """Advance time to the frame, then feed it."""
        if not self.stamp or (direction == SENT and not data):
            self.stamp = stamp
            self.opened.append(stamp)
            yield from self.device.start(stamp)
        while after(self.stamp, TICK_S) < stamp:
            self.stamp = after(self.stamp, TICK_S)
            yield from self.device.tick(self.stamp)
        self.stamp = stamp
        if direction != SENT:
            yield from self.device.feed(data, stamp)
            yield from self.device.tick(stamp)


@dataclass(slots=True)
class RegisterWire:
    """Transactions into the programs of a register device."""

    name: str
    device: RegisterDevice
    stamp: Stamp = UNHEARD
    strange: list[str] = field(default_factory=list)
    """Transactions of the record that the device did not ask for."""
    opened: list[Stamp] = field(default_factory=list)
    _asked: Transaction | None = None
    _program: Program[Any] | None = None
    _operation: Operation | None = None
    _configured: bool = False

    def frame(self, stamp: Stamp, direction: int, data: bytes) -> Sequence[Output]:
        """Feed a transaction, and with the next frame its answer."""
        self.stamp = stamp
        if direction == SENT:
            self._asked = _transaction(data)
            return ()
        asked, self._asked = self._asked, None
        return self._answer(asked, data) if asked is not None else ()

    def _answer(self, recorded: Transaction, answer: bytes) -> Sequence[Output]:
        wanted: Operation | None = None
        for _ in range(TRIES):
            if self._program is None:
                self._begin()
            if self._operation == recorded:
                return self._advance(answer)
            wanted = wanted or self._operation
            self._fail()
        self.strange.append(f"{self.name}: asks for {wanted}, the record has {recorded}")
        return ()

    def _begin(self) -> None:
        self._program = self.device.cycle(self.stamp) if self._configured else self.device.configure()
        self._operation = None
        self._advance(None)

    def _advance(self, answer: bytes | None) -> Sequence[Output]:
        """Run the program to its next transaction; returns its outputs when it ends."""
        program = self._program
        assert program is not None
        try:
            self._operation = next(program) if answer is None else program.send(answer)
            while isinstance(self._operation, Pause):
                self._operation = program.send(b"")
        except StopIteration as stop:
            return self._finished(stop.value)
        except DeviceError:
            self._program, self._configured = None, False
        return ()

    def _finished(self, value: Any) -> Sequence[Output]:
        self._program = None
        if not self._configured:
            self._configured = True
            return (value,)
        return tuple(value)

    def _fail(self) -> None:
        """Raise the failure of a transaction in the program."""
        program = self._program
        if program is None:
            return
        try:
            self._operation = program.throw(DeviceError(f"{self.name}: this transaction is not in the record"))
            while isinstance(self._operation, Pause):
                self._operation = program.send(b"")
        except StopIteration as stop:
            self._finished(stop.value)
        except DeviceError:
            self._program, self._configured = None, False
