"""Sorting of measurements by stamp, independent of the order of arrival.

Topics arrive in different orders live and from a bag; estimates must not depend on it. Each measurement and each event
waits a short time for others with an earlier stamp; later arrivals are dropped and counted.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, TypeVar

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import BottomVelocity, Pressure
from hindrax_core.signals import Attitude, Navigation, Phase, Thrust, Velocity

ReadingT = TypeVar("ReadingT")

KINDS = (Phase, Thrust, Navigation, Pressure, BottomVelocity, Attitude, Velocity)
"""Order at equal stamps: inputs to the vehicle first, then its motion."""
RANKS: dict[type, int] = {kind: rank for rank, kind in enumerate(KINDS)}
EARLIEST = Stamp(-(2**62))


class StampSorter(Generic[ReadingT]):
    """A heap of waiting measurements."""

    __slots__ = ("_count", "_heap", "_newest", "_released", "dropped", "wait_s")

    def __init__(self, wait_s: float) -> None:
        """`wait_s`: largest delay against measurements with neighboring stamps."""
        self.wait_s = wait_s
        self.dropped = 0
        self._heap: list[tuple[Stamp, int, str, int, Stamped[ReadingT]]] = []
        self._count = 0
        self._newest = self._released = EARLIEST

    def push(self, one: Stamped[ReadingT]) -> Iterator[Stamped[ReadingT]]:
        """Add one measurement, or drop and count it if too late; yield all that have waited long enough."""
        stamp, reading = one.stamp, one.reading
        if stamp < self._released:
            self.dropped += 1
            return
        source = reading.source if isinstance(reading, Velocity) else ""
        self._count += 1
        heapq.heappush(self._heap, (stamp, RANKS[type(reading)], source, self._count, one))
        self._newest = max(self._newest, stamp)
        yield from self._until(after(self._newest, -self.wait_s))

    def flush(self) -> Iterator[Stamped[ReadingT]]:
        """Yield all waiting measurements."""
        yield from self._until(self._newest)

    def _until(self, stamp: Stamp) -> Iterator[Stamped[ReadingT]]:
        while self._heap and self._heap[0][0] <= stamp:
            entry = heapq.heappop(self._heap)
            self._released = entry[0]
            yield entry[4]
