"""The gyroscope's offset as a vehicle at rest shows it, and how far that can be wrong because it was no rest.

Nobody says that the vehicle stands still at its start: it floats, rocks and is carried about. So the mean rate over a
window counts only as far as the rates are alike, the forces are alike, and gravity keeps its direction: a vehicle in
the middle of its swing turns steadily, but gravity turns with it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from hindrax_core.readings import Vec3
from hindrax_core.vehicle import GRAVITY_mps2

SPANS = 5
FINEST_radps = math.radians(0.02)
"""What the noise of a gyroscope leaves of a mean over a second."""


@dataclass(frozen=True, slots=True)
class Offset:
    """An offset of the gyroscope and its standard deviation per axis [rad/s]."""

    rate_radps: Vec3
    sigma_radps: float

    def combined(self, other: Offset) -> Offset:
        """What two sources know together; one that cannot be true beside this one adds nothing."""
        variance = self.sigma_radps**2
        off = tuple(b - a for a, b in zip(self.rate_radps, other.rate_radps, strict=True))
        total = variance + other.sigma_radps**2
        if max(map(abs, off)) > 3.0 * math.sqrt(total):
            return self
        share = variance / total
        x, y, z = (a + share * d for a, d in zip(self.rate_radps, off, strict=True))
        return Offset((x, y, z), math.sqrt(share) * other.sigma_radps)


class RestWindow:
    """The last spans of equal length: mean rate [rad/s] and mean specific force [m/s^2] of each."""

    def __init__(self) -> None:
        self._spans: deque[tuple[Vec3, Vec3]] = deque(maxlen=SPANS)

    def add(self, rate_radps: Vec3, force_mps2: Vec3) -> None:
        """Take one span, and forget the oldest."""
        self._spans.append((rate_radps, force_mps2))

    @property
    def full(self) -> bool:
        """Whether there are as many spans as a window has."""
        return len(self._spans) == SPANS

    @property
    def force_mps2(self) -> Vec3:
        """Mean specific force over the window."""
        return _mean(force for _, force in self._spans)

    @property
    def last_force_mps2(self) -> Vec3:
        """Mean specific force over the last span."""
        return self._spans[-1][1]

    def offset(self, span_s: float) -> Offset:
        """The offset that a window, full of spans of this length, shows."""
        rates = [rate for rate, _ in self._spans]
        mean = _mean(rates)
        scatter = math.sqrt(sum(math.dist(rate, mean) ** 2 for rate in rates) / len(rates))
        turned_rad = math.dist(self._spans[0][1], self._spans[-1][1]) / GRAVITY_mps2
        turning = turned_rad / ((len(rates) - 1) * span_s)
        return Offset(mean, math.hypot(scatter, turning, FINEST_radps))


def _mean(vectors: Iterable[Vec3]) -> Vec3:
    rows = list(vectors)
    x, y, z = (sum(column) / len(rows) for column in zip(*rows, strict=True))
    return (x, y, z)
