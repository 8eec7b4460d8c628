"""Binning and choice of sources: one velocity per axis and instant.

Fast sources are averaged over short bins. Where several sources measure the same axis, instruments have priority over
the navigator, whose estimates are filtered. Depth, where available, replaces the navigator's vertical velocity, which
is derived from it.
"""

import math
from dataclasses import dataclass, field

NAVIGATORS = ("navigation", "navigator", "odometry")
SONAR = "sonar"
"""Source of the ways that follow from ranges to a wall."""
DEPTH_S = 0.1
"""Averaging time of depths; differences of the means are vertical velocities."""
WAY_S = 0.4
"""That of ways by ranges or poses: they are noisier by a factor of ten, and serve the live estimate only."""


@dataclass(slots=True)
class Bin:
    """Collects the samples of a span of time."""

    span_s: float
    points: list[tuple[float, float]] = field(default_factory=list)

    def add(self, t_s: float, value: float) -> list[tuple[float, float]]:
        """Add a sample; return the points of the bin that it completes, if any."""
        if self.points and t_s - self.points[0][0] >= self.span_s - 1e-6:
            full, self.points = self.points, [(t_s, value)]
            return full
        self.points.append((t_s, value))
        return []


def mean(points: list[tuple[float, float]]) -> tuple[float, float]:
    """Mean time and mean value."""
    n = len(points)
    return math.fsum(t for t, _ in points) / n, math.fsum(y for _, y in points) / n


class SourceSelector:
    """Selects one source and rejects the others; an instrument replaces a navigator."""

    __slots__ = ("name",)

    def __init__(self) -> None:
        self.name = ""

    def accepts(self, name: str) -> bool:
        """Whether samples of this source are used from now on."""
        if not self.name or (name != self.name and self.name in NAVIGATORS and name not in NAVIGATORS):
            self.name = name
        return name == self.name
