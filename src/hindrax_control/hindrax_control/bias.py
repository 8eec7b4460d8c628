"""Keeping thrusters out of their dead band by forces that cancel each other.

A pattern of forces without any wrench (a null vector of the effectiveness matrix) can be added to every allocation.
Its size is chosen so that no thruster falls into the gap between standing and its smallest running force, where the
force could not be had; it moves as little as possible from cycle to cycle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.effectiveness import Matrix

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Pattern:
    """Forces without wrench, as (thruster, share) pairs; the largest share is one."""

    shares: tuple[tuple[int, float], ...]

    def size_in(self, forces_N: Sequence[float]) -> float:
        """How much of the pattern there is in given forces [N]."""
        energy = sum(share * share for _, share in self.shares)
        return sum(share * forces_N[index] for index, share in self.shares) / energy


def patterns(B: Matrix) -> tuple[Pattern, ...]:
    """Sparse null vectors of B (rows, m): each involves as few thrusters as elimination finds."""
    if B.shape[1] == 0:
        return ()
    _, singular, rows = np.linalg.svd(B)
    rank = int(np.sum(singular > 1e-9 * max(1.0, float(singular[0]))))
    found = []
    for vector in _reduced(rows[rank:].copy()):
        scaled = vector / vector[int(np.argmax(np.abs(vector)))]
        found.append(Pattern(tuple((index, float(share)) for index, share in enumerate(scaled) if abs(share) > 1e-9)))
    return tuple(found)


def _reduced(rows: Matrix) -> Matrix:
    """Gauss-Jordan with the largest pivot of each row, which makes the rows sparse."""
    for turn in range(len(rows)):
        pivot = int(np.argmax(np.abs(rows[turn])))
        rows[turn] /= rows[turn, pivot]
        for other in range(len(rows)):
            if other != turn:
                rows[other] -= rows[other, pivot] * rows[turn]
    return rows


class Spread:
    """Chooses the size of one pattern, given the limits and the gaps of its thrusters.

    `preferred_N` is taken wherever it works. Elsewhere the nearest size that works is, except that a stretch of sizes
    which holds the previous size is left only for a gain of more than `hop_N`. Where no size avoids every gap, the
    limits alone decide.
    """

    def __init__(
        self,
        pattern: Pattern,
        limits_N: Sequence[Interval],
        gaps_N: Sequence[Interval],
        preferred_N: float,
        hop_N: float,
    ) -> None:
        self.pattern, self.preferred_N, self.hop_N = pattern, preferred_N, hop_N
        self._rows = tuple(_row(index, share, limits_N[index], gaps_N[index]) for index, share in pattern.shares)

    def add_preferred(self, forces_N: list[float]) -> bool:
        """Add the preferred size to the forces, in place; False (and nothing done) where it does not work."""
        if not self._works(forces_N):
            return False
        self._add(forces_N, self.preferred_N)
        return True

    def add_nearest(self, forces_N: list[float], previous_N: float) -> bool:
        """Add the best size to the forces, in place; False when no size brings all of them within limits."""
        size = self._search(forces_N, previous_N)
        if size is None:
            return False
        self._add(forces_N, size)
        return True

    def _add(self, forces_N: list[float], size: float) -> None:
        for index, share in self.pattern.shares:
            forces_N[index] += size * share

    def _works(self, forces_N: Sequence[float]) -> bool:
        preferred = self.preferred_N
        for index, inverse, low, high, back, forth in self._rows:
            at = preferred + forces_N[index] * inverse
            if not (low <= at <= back or forth <= at <= high):
                return False
        return True

    def _search(self, forces_N: Sequence[float], previous_N: float) -> float | None:
        """Best size: next to the preferred one, on either side; where limits are in the way, wherever there is room."""
        blocked = [(back - forces_N[i] * per, forth - forces_N[i] * per) for i, per, _, _, back, forth in self._rows]
        below, above = (_out(blocked, self.preferred_N, end) for end in (0, 1))
        rise, fall = above - self.preferred_N, self.preferred_N - below
        # Where it was before, it stays unless the other side is nearer by more than a hop.
        if previous_N > self.preferred_N:
            fall += self.hop_N
        elif previous_N < self.preferred_N:
            rise += self.hop_N
        for size in (above, below) if rise < fall else (below, above):
            if self._fits(forces_N, size):
                return size
        return self._within_limits(blocked, forces_N, previous_N)

    def _fits(self, forces_N: Sequence[float], size: float) -> bool:
        return all(low <= size + forces_N[index] * inverse <= high for index, inverse, low, high, _, _ in self._rows)

    def _within_limits(self, blocked: list[Interval], forces_N: Sequence[float], previous_N: float) -> float | None:
        low, high = -math.inf, math.inf
        for index, inverse, least, most, _, _ in self._rows:
            at = forces_N[index] * inverse
            low, high = max(low, least - at), min(high, most - at)
        return self._nearest(blocked, low, high, previous_N) if low <= high + 1e-9 else None

    def _nearest(self, blocked: list[Interval], low: float, high: float, previous: float) -> float:
        preferred, hop = self.preferred_N, self.hop_N
        best, least = min(max(preferred, low), high), math.inf
        start = low
        for begin, end in (*sorted(blocked), (high, math.inf)):
            stop = min(begin, high)
            if stop >= start:
                candidate = min(max(preferred, start), stop)
                cost = abs(candidate - preferred) + (0.0 if start - 1e-9 <= previous <= stop + 1e-9 else hop)
                if cost < least:
                    best, least = candidate, cost
            start = max(start, end)
            if start > high:
                break
        return best


def _out(blocked: list[Interval], size: float, end: int) -> float:
    """Return the nearest size from this one down (end 0) or up (end 1) that is in no blocked interval."""
    moved = True
    while moved:
        moved = False
        for interval in blocked:
            if interval[0] < size < interval[1]:
                size, moved = interval[end], True
    return size


def _row(
    index: int, share: float, limits_N: Interval, gap_N: Interval
) -> tuple[int, float, float, float, float, float]:
    """Thruster, pattern per newton of it, and the ends of limits and gap as sizes of the pattern, ascending."""
    least, most = sorted(end / share for end in limits_N)
    back, forth = sorted(end / share for end in gap_N)
    return index, 1.0 / share, least, most, back, forth
