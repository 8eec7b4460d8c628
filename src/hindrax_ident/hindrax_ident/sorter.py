"""Everything in the order of its stamps, whatever order it arrives in.

Topics come by different ways, live and from a bag; what is learned must not depend on it. Each measurement and each
event waits a short while for others with an earlier stamp; what comes later still is left out and counted.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, TypeVar

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import BottomVelocity, Pressure
from hindrax_core.state import Attitude, Navigation, Phase, Thrust, Velocity

ReadingT = TypeVar("ReadingT")

KINDS = (Phase, Thrust, Navigation, Pressure, BottomVelocity, Attitude, Velocity)
"""Which comes first at one instant: what is done to the vehicle, then what it does."""
RANKS: dict[type, int] = {kind: rank for rank, kind in enumerate(KINDS)}
LONG_AGO = Stamp(-(2**62))
WAIT_S = 0.5


class InOrder(Generic[ReadingT]):
    """A heap of what still waits."""

    __slots__ = ("_count", "_heap", "_newest", "_released", "dropped", "wait_s")

    def __init__(self, wait_s: float = WAIT_S) -> None:
        """`wait_s`: how much later than its neighbors anything may arrive."""
        self.wait_s = wait_s
        self.dropped = 0
        self._heap: list[tuple[Stamp, int, str, int, Stamped[ReadingT]]] = []
        self._count = 0
        self._newest = self._released = LONG_AGO

    def push(self, one: Stamped[ReadingT]) -> Iterator[Stamped[ReadingT]]:
        """Take one, dropped and counted when its turn is over, and let go of all whose time of waiting is over."""
        stamp, reading = one.stamp, one.reading
        if stamp < self._released:
            self.dropped += 1
            return
        source = reading.source if isinstance(reading, Velocity) else ""
        self._count += 1
        heapq.heappush(self._heap, (stamp, RANKS[type(reading)], source, self._count, one))
        self._newest = max(self._newest, stamp)
        yield from self._until(after(self._newest, -self.wait_s))

    def rest(self) -> Iterator[Stamped[ReadingT]]:
        """Let go of everything."""
        yield from self._until(self._newest)

    def _until(self, stamp: Stamp) -> Iterator[Stamped[ReadingT]]:
        while self._heap and self._heap[0][0] <= stamp:
            entry = heapq.heappop(self._heap)
            self._released = entry[0]
            yield entry[4]
