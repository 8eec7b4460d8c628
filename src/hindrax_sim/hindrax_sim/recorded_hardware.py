"""Recorded wire frames as hardware: the ports and buses of a bag, behind the same ptys and sockets as the mock.

A serial port sends its recorded bytes at their recorded times, regardless of input. A part on the bus gives the
recorded answer to each transaction: the next of the record while host and record keep step, otherwise the one nearest
in time.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from hindrax_bag.read.bag_reader import messages
from hindrax_core.bus_operations import Transaction, frames_in, unpack_transaction
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.sensor_table import row_of
from hindrax_core.topics import raw_topic, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_sim.devices.emulator import NackError

SENT = 1
IN_STEP_NS = 3 * NS_PER_S // 100
"""So far may the host's transactions be from the recorded ones before the nearest one is looked for."""
OUTLIVED_NS = NS_PER_S // 4
"""So long after the last transaction of the record a part is still there."""
Frame = tuple[int, int, bytes]
"""Stamp [ns], direction, bytes."""


@dataclass(slots=True)
class RecordedLine:
    """A serial device that replays its recorded bytes."""

    frames: Sequence[tuple[int, bytes]]
    _at: int = 0

    def receive(self, _data: bytes, _now_s: float) -> bytes:
        """Ignore bytes of the host; the record has the answer already."""
        return b""

    def read_until(self, stamp: int) -> bytes:
        """Return the recorded bytes up to this time that were not returned yet."""
        start = self._at
        while self._at < len(self.frames) and self.frames[self._at][0] <= stamp:
            self._at += 1
        return b"".join(data for _, data in self.frames[start : self._at])

    @property
    def next_stamp(self) -> int | None:
        """When the next bytes arrive; None after the last."""
        return self.frames[self._at][0] if self._at < len(self.frames) else None


@dataclass(slots=True)
class RecordedPart:
    """One device on the bus, at all its addresses."""

    stamps: list[int] = field(default_factory=list)
    asked: list[Transaction] = field(default_factory=list)
    answers: list[bytes] = field(default_factory=list)
    _where: dict[tuple[Transaction | None, Transaction], list[int]] = field(default_factory=dict)
    """Where a transaction follows another, and (after None) where it is at all."""
    _at: int = 0
    _last: Transaction | None = None

    def add(self, stamp: int, asked: Transaction, answer: bytes) -> None:
        """Append a transaction of the record.

        Parameters
        ----------
        stamp : [ns]
            When it was answered.
        asked, answer
            Transaction, and the bytes read.
        """
        for before in (None, *self.asked[-1:]):
            self._where.setdefault((before, asked), []).append(len(self.asked))
        self.stamps.append(stamp)
        self.asked.append(asked)
        self.answers.append(answer)

    def answer(self, asked: Transaction, now: int) -> bytes:
        """Answer as recorded; NackError where nothing was recorded."""
        if not self.stamps or not self.stamps[0] <= now <= self.stamps[-1] + OUTLIVED_NS:
            raise NackError
        at = self._at
        expected = at < len(self.asked) and self.asked[at] == asked
        if not expected or abs(now - self.stamps[at]) > IN_STEP_NS:
            at = self._nearest(asked, now)
        self._at, self._last = at + 1, asked
        return self.answers[at]

    def _nearest(self, asked: Transaction, now: int) -> int:
        # Reads of all results have the same bytes: the request before shows which.
        places = self._where.get((self._last, asked)) or self._where.get((None, asked))
        if places is None:
            raise NackError
        after = bisect_left(places, now, key=lambda place: self.stamps[place])
        near = places[max(0, after - 1) : after + 1]
        return min(near, key=lambda place: abs(self.stamps[place] - now))


class RecordedHardware:
    """Every sensor of the vehicle file whose wire frames the bag has.

    Time begins with the first transaction on the bus, so that a host that waits for it keeps step from the start.
    """

    turns = True
    """Whether a thruster turns: any may, as far as is known."""

    def __init__(self, vehicle: Vehicle, frames: Mapping[str, Sequence[Frame]]) -> None:
        known = {name: frames[name] for name in vehicle.sensors if frames.get(name)}
        if not known:
            raise UsageError("the bag holds no wire frames (topics raw/...) of any sensor of the vehicle file")
        self.vehicle = vehicle
        self.serial: dict[str, RecordedLine] = {}
        self.registers: dict[str, RecordedPart] = {}
        self.i2c = self
        self._parts: dict[int, RecordedPart] = {}
        for name, found in known.items():
            self._attach(name, found, serial=row_of(vehicle.sensors[name].device).serial)
        first = [part.stamps[0] for part in self.registers.values() if part.stamps]
        self.stamp = Stamp(min(first or [found[0][0] for found in known.values()]))
        self.end = Stamp(max(found[-1][0] for found in known.values()))

    def advance(self, stamp: Stamp) -> dict[str, bytes]:
        """Advance time; return the bytes of each serial device."""
        self.stamp = stamp
        return {name: line.read_until(stamp) for name, line in self.serial.items()}

    def transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        """Run one transaction on the bus; raises NackError (an OSError) as a kernel would."""
        return self._parts.get(transaction.address, RecordedPart()).answer(transaction, now)

    def next_stamp(self, latest: Stamp) -> Stamp:
        """When the next bytes arrive on any line, or `latest` if that is sooner."""
        due = (line.next_stamp for line in self.serial.values())
        return Stamp(min([latest, *(max(one, self.stamp + 1) for one in due if one is not None)]))

    def _attach(self, name: str, frames: Sequence[Frame], *, serial: bool) -> None:
        if serial:
            self.serial[name] = RecordedLine([(stamp, data) for stamp, direction, data in frames if direction != SENT])
            return
        part = self.registers[name] = RecordedPart()
        # Incomplete pairs at the cut of a bag are skipped.
        for (stamp, sent, asked), (_, back, answer) in pairwise(frames):
            if sent == SENT and back != SENT:
                transaction = unpack_transaction(asked)
                part.add(stamp, transaction, answer)
                self._parts[transaction.address] = part


def recorded_frames(bag: Path, vehicle: Vehicle) -> dict[str, list[Frame]]:
    """Wire frames of every sensor of a vehicle, in the order of their times."""
    names = {resolved(raw_topic(name)): name for name in vehicle.sensors}
    found: dict[str, list[Frame]] = {}
    for message in messages(bag, names):
        found.setdefault(names[message.topic], []).extend(frames_in(message.decoded()))
    return found
