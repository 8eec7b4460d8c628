"""Time for programs that sleep by the wall clock and know nothing of the mock's."""

from __future__ import annotations

import time
from collections.abc import Callable

from hindrax_core.events import Stamp, stamp_from_s

FARTHEST_ns = stamp_from_s(0.5)


class WallTime:
    """Never behind the mock's time, and between two looks never less than what passed on the wall.

    The mock's time goes in steps and may go slowly. A program that orders a conversion of 18 ms and reads it 20 ms
    later by its own clock has waited long enough, whatever the steps between were. Farther than half a second ahead of
    the mock it does not go: a mock that stands still would leave its devices without a truth.
    """

    def __init__(self, world: Callable[[], Stamp], wall_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._world, self._wall_ns = world, wall_ns
        self._seen_ns = wall_ns()
        self._at = int(world())

    def now(self) -> Stamp:
        """Time for a transaction that comes now."""
        world, wall_ns = int(self._world()), self._wall_ns()
        wanted = min(self._at + wall_ns - self._seen_ns, world + FARTHEST_ns)
        self._at, self._seen_ns = max(self._at, world, wanted), wall_ns
        return Stamp(self._at)
