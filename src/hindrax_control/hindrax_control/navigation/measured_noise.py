"""Noise of a sensor as it comes, for a filter that would otherwise refuse what is merely noisier than it was told.

Three samples in a row, evenly spaced, of a smooth motion lie on a line but for noise: their second difference
y[k] - 2 y[k-1] + y[k-2] has six times its variance, and no trace of rate or value. Its mean square over `MEMORY`
samples, a sixth of it, is the variance. A sample counts no more than `MOST_TIMES` the variance before it: a jump, which
is a fault and no noise, moves three of them and hardly the mean. The first samples weigh more: what is noisy from the
start must not be refused until that is learned. A value that repeats is left out: a sensor asked more often than it
measures answers twice with the same, and the noise between them would count as none.
"""

import math
from collections import deque

MEMORY, MOST_TIMES = 40, 9.0
ABOVE_CLAIM = 2.0
"""Times what is claimed: with less, the estimate's own scatter would count as noise."""
SECOND_DIFFERENCE = 6.0
"""Its variance over that of a sample: 1 + 4 + 1."""


class MeasuredNoise:
    """Standard deviation of one sensor's noise, no less than what is claimed for it."""

    def __init__(self, claimed: float) -> None:
        self._claimed = claimed
        self._variance = claimed * claimed
        self._last: deque[float] = deque(maxlen=2)
        self._samples = self._distinct = 0

    @property
    def known(self) -> bool:
        """Whether it has had the samples that lasting noise takes to show."""
        return self._samples >= MEMORY

    def step(self, value: float) -> float:
        """Take a sample; returns the standard deviation that it has."""
        self._samples += 1
        if self._last and value == self._last[-1]:
            return self._sigma
        self._distinct += 1
        if len(self._last) == 2:
            before, last = self._last
            found = (value - 2.0 * last + before) ** 2 / SECOND_DIFFERENCE
            self._variance += (min(found, MOST_TIMES * self._variance) - self._variance) / min(MEMORY, self._distinct)
            self._variance = max(self._variance, self._claimed * self._claimed)
        self._last.append(value)
        return self._sigma

    @property
    def _sigma(self) -> float:
        sigma = math.sqrt(self._variance)
        return sigma if sigma > ABOVE_CLAIM * self._claimed else self._claimed
