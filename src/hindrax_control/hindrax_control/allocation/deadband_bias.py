"""Keeping thrusters out of their dead band by forces that cancel each other.

A pattern of forces without any wrench (a null vector of the effectiveness matrix) can be added to every allocation.
Its size is chosen so that no thruster falls into the gap between standing and its smallest running force, where the
force could not be had; it moves as little as possible from cycle to cycle.
"""

import math
from collections.abc import Sequence

from hindrax_control.allocation.effectiveness import NullPattern

Interval = tuple[float, float]

ROUNDING_N = 1e-8
"""Forces that differ by less are the same. Pulses come in steps of 1e-2 N; sums of forces round by 1e-12 N."""


class DeadbandBias:
    """Chooses the size of one pattern, given the limits and the gaps of its thrusters.

    `preferred_N` is taken wherever it works. Elsewhere the nearest size that works is, except that a stretch of sizes
    which holds the previous size is left only for a gain of more than `hop_N`. Where no size avoids every gap, the
    limits alone decide.
    """

    def __init__(
        self,
        pattern: NullPattern,
        limits_N: Sequence[Interval],
        gaps_N: Sequence[Interval],
        preferred_N: float,
        hop_N: float,
    ) -> None:
        self.pattern, self.preferred_N, self.hop_N = pattern, preferred_N, hop_N
        self._shares = pattern.shares
        self._rows = tuple(_row(index, share, limits_N[index], gaps_N[index]) for index, share in pattern.shares)

    def add_preferred(self, forces_N: list[float]) -> bool:
        """Add the preferred size to the forces, in place; False (and nothing done) where it does not work."""
        preferred = self.preferred_N
        for index, inverse, low, high, back, forth in self._rows:
            at = preferred + forces_N[index] * inverse
            if not (low <= at <= back or forth <= at <= high):
                return False
        self._add(forces_N, preferred)
        return True

    def add_nearest(self, forces_N: list[float], previous_N: float) -> bool:
        """Add the best size to the forces, in place; False when no size brings all of them within limits."""
        low, high, blocked = -math.inf, math.inf, []
        for index, inverse, least, most, back, forth in self._rows:
            at = forces_N[index] * inverse
            if least - at > low:  # noqa: PLR1730  # max() would take as long as the rest of the turn
                low = least - at
            if most - at < high:  # noqa: PLR1730  # as above
                high = most - at
            blocked.append((back - at, forth - at))
        if high < low + ROUNDING_N:
            if high < low - ROUNDING_N:
                return False
            self._add(forces_N, 0.5 * (low + high))
        else:
            self._add(forces_N, self._best(sorted(blocked), low, high, previous_N))
        return True

    def _add(self, forces_N: list[float], size: float) -> None:
        for index, share in self._shares:
            forces_N[index] += size * share

    def _best(self, blocked: list[Interval], low: float, high: float, previous_N: float) -> float:
        """Next to the preferred size, on either side; where limits are in the way, wherever there is room."""
        preferred = above = below = self.preferred_N
        # Sorted by their begins: no interval before this one reaches further than what it has already moved.
        for begin, end in blocked:
            if begin < above < end:
                above = end
        for begin, end in reversed(blocked):
            if begin < below < end:
                below = begin
        rise, fall = above - preferred, preferred - below
        # Where it was before, it stays unless the other side is nearer by more than a hop.
        if previous_N > preferred:
            fall += self.hop_N
        elif previous_N < preferred:
            rise += self.hop_N
        nearer, farther = (above, below) if rise < fall else (below, above)
        if low <= nearer <= high:
            return nearer
        return farther if low <= farther <= high else self._nearest(blocked, low, high, previous_N)

    def _nearest(self, blocked: list[Interval], low: float, high: float, previous: float) -> float:
        preferred, hop = self.preferred_N, self.hop_N
        best, least = min(max(preferred, low), high), math.inf
        start = low
        for begin, end in (*blocked, (high, math.inf)):
            stop = min(begin, high)
            if stop >= start:
                candidate = min(max(preferred, start), stop)
                cost = abs(candidate - preferred) + (
                    0.0 if start - ROUNDING_N <= previous <= stop + ROUNDING_N else hop
                )
                if cost < least:
                    best, least = candidate, cost
            start = max(start, end)
            if start > high:
                break
        return best


def _row(
    index: int, share: float, limits_N: Interval, gap_N: Interval
) -> tuple[int, float, float, float, float, float]:
    """Thruster, pattern per newton of it, and the ends of limits and gap as sizes of the pattern, ascending."""
    least, most = sorted(end / share for end in limits_N)
    back, forth = sorted(end / share for end in gap_N)
    return index, 1.0 / share, least, most, back, forth
