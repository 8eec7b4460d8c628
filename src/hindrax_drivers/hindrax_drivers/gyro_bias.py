"""The gyroscope's offset at start-up: the mean rate of a vehicle that is seen to stand still."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3

ZERO: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class GyroBiasKnobs:
    """What counts as standing still. Offsets up to 5 dps (0.087 rad/s) are the sensor's own: DS-000189 table 1."""

    samples: int = knob(450, 10, 100_000, "samples that are averaged [-]")
    rate_spread_radps: float = knob(0.01, 0.0, 1.0, "largest standard deviation of a rate at rest [rad/s]")
    force_spread_mps2: float = knob(0.1, 0.0, 10.0, "largest standard deviation of a force at rest [m/s^2]")
    bias_radps: float = knob(0.15, 0.0, 1.0, "largest believable offset [rad/s]")


class GyroBias:
    """Collects samples until as many as wanted, one after the other, show no motion.

    A window with motion in it is thrown away as a whole; there is no time limit. Constant slow rotation cannot be told
    from an offset; only its size can (`bias_radps`).
    """

    def __init__(self, knobs: GyroBiasKnobs) -> None:
        self._knobs = knobs
        self.found: Vec3 | None = None
        self.sigma: Vec3 = ZERO
        self.windows_in_motion = 0
        self._count = 0
        self._origin: tuple[float, ...] | None = None
        self._sums = self._squares = [0.0] * 6
        self._begin()

    def add(self, rate_radps: Vec3, force_mps2: Vec3) -> bool:
        """Take one sample; True when the offset has just been found."""
        if self.found is not None:
            return False
        values = (*rate_radps, *force_mps2)
        self._origin = self._origin or values
        for index, (value, origin) in enumerate(zip(values, self._origin, strict=True)):
            off = value - origin
            self._sums[index] += off
            self._squares[index] += off * off
        self._count += 1
        return self._count >= self._knobs.samples and self._judge()

    def _begin(self) -> None:
        self._count = 0
        self._origin = None
        self._sums = [0.0] * 6
        self._squares = [0.0] * 6

    def _judge(self) -> bool:
        """End of a window: was it still, and is the mean small enough."""
        assert self._origin is not None
        n = self._count
        means = [origin + total / n for origin, total in zip(self._origin, self._sums, strict=True)]
        pairs = zip(self._squares, self._sums, strict=True)
        spreads = [math.sqrt(max(0.0, square / n - (total / n) ** 2)) for square, total in pairs]
        still = max(spreads[:3]) <= self._knobs.rate_spread_radps and max(spreads[3:]) <= self._knobs.force_spread_mps2
        believable = max(abs(mean) for mean in means[:3]) <= self._knobs.bias_radps
        if still and believable:
            self.found = (means[0], means[1], means[2])
            self.sigma = (spreads[0] / math.sqrt(n), spreads[1] / math.sqrt(n), spreads[2] / math.sqrt(n))
            return True
        self.windows_in_motion += 1
        self._begin()
        return False
