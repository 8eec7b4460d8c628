"""Sorting of measurements by stamp, independent of the order of arrival.

Topics arrive in different orders live and from a bag; estimates must not depend on it. Each measurement and each event
waits a short time for others with an earlier stamp, and longer for those of a kind that lags behind on a busy machine;
later arrivals are dropped and counted.
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

    __slots__ = ("_count", "_heap", "_newest", "_newest_of", "_released", "dropped", "lag_s", "wait_s")

    def __init__(self, wait_s: float, lag_s: float = 0.0) -> None:
        """`wait_s`: largest delay against measurements with neighboring stamps; `lag_s`: longest wait for a kind."""
        self.wait_s, self.lag_s = wait_s, lag_s
        self.dropped = 0
        self._heap: list[tuple[Stamp, int, str, int, Stamped[ReadingT]]] = []
        self._count = 0
        self._newest = self._released = EARLIEST
        self._newest_of: dict[tuple[int, str], Stamp] = {}

    def push(self, one: Stamped[ReadingT]) -> Iterator[Stamped[ReadingT]]:
        """Add one measurement, or drop and count it if too late; yield all that have waited long enough."""
        stamp, reading = one.stamp, one.reading
        if stamp < self._released:
            self.dropped += 1
            return
        kind = (RANKS[type(reading)], reading.source if isinstance(reading, Velocity) else "")
        self._count += 1
        heapq.heappush(self._heap, (stamp, *kind, self._count, one))
        self._newest = max(self._newest, stamp)
        self._newest_of[kind] = max(self._newest_of.get(kind, stamp), stamp)
        # A kind that is silent for longer than that has nothing to say: a lost sensor must not stop the others.
        silent = after(self._newest, -self.lag_s)
        slowest = min((newest for newest in self._newest_of.values() if newest > silent), default=self._newest)
        yield from self._until(min(slowest, after(self._newest, -self.wait_s)))

    def flush(self) -> Iterator[Stamped[ReadingT]]:
        """Yield all waiting measurements."""
        yield from self._until(self._newest)

    def _until(self, stamp: Stamp) -> Iterator[Stamped[ReadingT]]:
        while self._heap and self._heap[0][0] <= stamp:
            entry = heapq.heappop(self._heap)
            self._released = entry[0]
            yield entry[4]
