"""Scales of a drawing: ranges, round ticks, thinning of lines with more points than a screen shows."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Index, array

MARGIN = 0.05
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
BUCKETS = 360


@dataclass(frozen=True, slots=True)
class Scale:
    """Linear map of [low, high] onto [start, end] of the drawing."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: Array | float) -> Array:
        """Coordinate of each value: (n,) [px], clipped far outside the drawing."""
        span = self.end - self.start
        place = self.start + (np.asarray(value, float) - self.low) / (self.high - self.low) * span
        return array(np.clip(place, min(self.start, self.end) - 4e3, max(self.start, self.end) + 4e3))


def data_range(parts: Sequence[Array], *, margin: float = MARGIN) -> tuple[float, float]:
    """Range of all finite numbers, with a margin; never of zero width."""
    known = np.concatenate([np.ravel(part) for part in parts]) if parts else np.zeros(0)
    known = known[np.isfinite(known)]
    if not len(known):
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    room = (high - low) * margin if high > low else max(1e-9, 0.5 * abs(high))
    return low - room, high + room


def ticks(low: float, high: float, wanted: int = 5) -> list[float]:
    """Round numbers within a range, about as many as wanted."""
    raw = (high - low) / max(1, wanted)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * one for one in ROUND_STEPS if power * one >= raw * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [0.0 if n == 0 else n * step for n in range(first, last + 1)]


def tick_text(value: float, marks: Sequence[float]) -> str:
    """Shortest text that distinguishes the ticks of an axis, with a true minus sign."""
    largest = max((abs(mark) for mark in marks), default=0.0)
    step = min((b - a for a, b in itertools.pairwise(marks)), default=1.0)
    if largest >= 1e5 or 0.0 < largest < 1e-3:
        apart = 2 + math.floor(math.log10(largest)) - math.floor(math.log10(step))
        return f"{value:.{max(3, apart)}g}".replace("-", "\u2212")
    digits = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0.0 else 0
    digits += 0 if step <= 0.0 or math.isclose(round(step, digits), step, rel_tol=1e-6) else 1
    return f"{value:.{digits}f}".replace("-", "\u2212")


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """First, last, least and greatest point of each bucket, in order: (m,) each; the line looks the same."""
    if len(x) <= 4 * BUCKETS:
        return x, y
    edges = np.linspace(0, len(x), BUCKETS + 1).astype(int)
    keep: list[int] = []
    for a, b in itertools.pairwise(edges.tolist()):
        part = np.where(np.isfinite(y[a:b]), y[a:b], 0.0)
        keep += sorted({a, a + int(part.argmin()), a + int(part.argmax()), b - 1})
    index = np.array(sorted(set(keep)))
    return x[index], y[index]


def evenly_chosen(count: int, most: int) -> Index:
    """Indices of at most `most` of `count` points, evenly spaced: (m,)."""
    index: Index = np.unique(np.linspace(0, max(0, count - 1), min(count, most)).astype(np.intp))
    return index
