"""Time for programs that sleep by the wall clock, not on the mock's clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from hindrax_core.events import Stamp


class WallTime:
    """Never behind the mock's time; between two calls it advances at least as much as wall time.

    The mock's time goes in steps and may go slowly. A program that orders a conversion of 18 ms and reads it 20 ms
    later by its own clock has waited long enough, whatever the steps between were and whatever a starved mock lost.
    """

    def __init__(self, world: Callable[[], Stamp], wall_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._world, self._wall_ns = world, wall_ns
        self._seen_ns = wall_ns()
        self._at = int(world())

    def now(self) -> Stamp:
        """Time of a transaction that arrives now."""
        wall_ns = self._wall_ns()
        self._at = max(int(self._world()), self._at + wall_ns - self._seen_ns)
        self._seen_ns = wall_ns
        return Stamp(self._at)
