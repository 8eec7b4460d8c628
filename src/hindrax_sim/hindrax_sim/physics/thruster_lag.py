"""First-order lag of the mock's thrusters."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6


class ThrusterLag:
    """First-order lag of all thrusters with one time constant; linear, so it may act on their joint wrench."""

    __slots__ = ("dt", "lag_s", "left", "shares", "target", "thrusters")

    def __init__(self, lag_s: float, thrusters: Sequence[int]) -> None:
        self.lag_s, self.thrusters = lag_s, thrusters
        self.target = self.left = ZERO6
        self.dt, self.shares = 0.0, (1.0, 1.0)

    def decay(self, dt: float) -> tuple[float, float]:
        """Remaining share of the way to the target after `dt`, and its mean over `dt`; cached for equal steps."""
        self.dt = dt
        keep = math.exp(-dt / self.lag_s) if self.lag_s > 0.0 else 0.0
        self.shares = (keep, (1.0 - keep) * self.lag_s / dt)
        return self.shares

    @property
    def wrench(self) -> Vec6:
        """Current wrench."""
        return combined([(1.0, self.target), (1.0, self.left)])

    def set_target(self, target: Vec6) -> None:
        """Set the target; the thrust does not jump."""
        self.left = combined([(1.0, self.wrench), (-1.0, target)])
        self.target = target


def combined(shares: Sequence[tuple[float, Vec6]]) -> Vec6:
    """Weighted sum of wrenches."""
    X = Y = Z = K = M = N = 0.0
    for factor, (x, y, z, k, m, n) in shares:
        X, Y, Z, K, M, N = (
            X + factor * x,
            Y + factor * y,
            Z + factor * z,
            K + factor * k,
            M + factor * m,
            N + factor * n,
        )
    return (X, Y, Z, K, M, N)
