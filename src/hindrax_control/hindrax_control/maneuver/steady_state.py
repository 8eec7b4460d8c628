"""Whether a speed is steady: a statistical test on the slope of its last samples."""

from __future__ import annotations

import math
from collections import deque

SAMPLE_S = 0.05
"""Samples nearer to each other than this say nothing new: the navigator filters them."""

SURE = 2.5
"""Standard deviations of the slope within which it passes for zero."""

LET_GO = 3.0
"""A plateau ends when the slope is this many times beyond what it may be."""


class SteadyStateTest:
    """Judges the slope of a rate over a window by least squares.

    Steady is a slope that could be zero given its scatter, and that would matter no more than `negligible`
    [m/s^2, rad/s^2] beyond that. Once steady, it takes a clearly larger slope to be unsteady again.
    """

    def __init__(self, window_s: float, negligible: float) -> None:
        self._window_s, self._negligible = window_s, negligible
        self._samples: deque[tuple[float, float]] = deque()
        self._steady = False

    def push(self, time_s: float, rate: float) -> bool:
        """Take a sample and return whether the rate is steady now."""
        samples = self._samples
        if samples and time_s - samples[-1][0] < SAMPLE_S * 0.9:
            return self._steady
        samples.append((time_s, rate))
        while time_s - samples[0][0] > self._window_s + 0.5 * SAMPLE_S:
            samples.popleft()
        if time_s - samples[0][0] < self._window_s - 1.5 * SAMPLE_S:
            self._steady = False
            return False
        slope, sigma = line(samples)
        allowed = SURE * sigma + self._negligible
        self._steady = abs(slope) < (LET_GO * allowed if self._steady else allowed)
        return self._steady

    def clear(self) -> None:
        """Forget all samples: the force has changed."""
        self._samples.clear()


def line(samples: deque[tuple[float, float]]) -> tuple[float, float]:
    """Slope of a least-squares line through (time, value) and the slope's standard deviation."""
    n = len(samples)
    mean_t = sum(t for t, _ in samples) / n
    mean_v = sum(v for _, v in samples) / n
    spread = sum((t - mean_t) ** 2 for t, _ in samples)
    slope = sum((t - mean_t) * v for t, v in samples) / spread
    rest = sum((v - mean_v - slope * (t - mean_t)) ** 2 for t, v in samples)
    return slope, math.sqrt(rest / max(1, n - 2) / spread)
