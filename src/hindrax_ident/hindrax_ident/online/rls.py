"""Recursive least squares, numerically stable in long runs: UD factors, directional forgetting, an information gate.

The covariance is kept as P = U D U' (U unit upper triangular, D diagonal) and changed by Bierman's rank-one update
(Bierman 1977, Factorization Methods for Discrete Sequential Estimation, section V.3), so it cannot lose definiteness.
Forgetting acts only in the direction of the sample (Kulhavy and Karny 1984, IFAC World Congress) and only while the
sample adds more information than forgetting removes: the covariance never grows, so there is no wind-up when the
vehicle is parked or repeats one motion. Quantities are in units of the noise: the update assumes unit variance,
`variance` is the ratio of the measured to the assumed variance (COB-2023-1394 eq. 8).
"""

import math
from collections.abc import Sequence
from operator import mul

import numpy as np

from hindrax_ident.arrays import Array


class Rls:
    """Least squares of y = x . theta + noise, one sample at a time.

    `values` and `sigmas` are the prior mean and its standard deviation, the latter in units of the noise's standard
    deviation. With `forgetting` 1 the result equals batch least squares.

    `n`: number of parameters; `samples` used so far; `weight`: sum of their weights after forgetting.
    """

    __slots__ = ("_diagonal", "_forgetting", "_squares", "_theta", "_upper", "n", "samples", "weight")

    def __init__(self, values: Sequence[float], sigmas: Sequence[float], forgetting: float = 1.0) -> None:
        """`forgetting` is the weight kept per sample, within (0, 1]."""
        if len(values) != len(sigmas) or not values:
            raise ValueError(f"prior has {len(values)} values and {len(sigmas)} sigmas, wanted as many of each")
        if not all(math.isfinite(sigma) and sigma > 0.0 for sigma in sigmas):
            raise ValueError(f"prior sigmas are {tuple(sigmas)}, wanted finite numbers above zero")
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting is {forgetting:g}, wanted above 0 and at most 1")
        self.n, self.samples = len(values), 0
        self._forgetting, self._squares, self.weight = forgetting, 0.0, 0.0
        self._theta, self._diagonal = list(values), [sigma * sigma for sigma in sigmas]
        # Columns of U above its diagonal. Lists: for so few numbers they are faster than arrays.
        self._upper = [[0.0] * j for j in range(self.n)]

    @property
    def values(self) -> tuple[float, ...]:
        """Estimates, in the order of the regressor."""
        return tuple(self._theta)

    @property
    def unit_covariance(self) -> Array:
        """Covariance for noise of variance one: (n, n). COB-2023-1394 eq. 7 without s2."""
        U = np.eye(self.n)
        for j, column in enumerate(self._upper):
            U[:j, j] = column
        return np.asarray((U * self._diagonal) @ U.T)

    @property
    def variance(self) -> float:
        """Residual variance, sum of squares over degrees of freedom (COB-2023-1394 eq. 8); NaN until there are any."""
        # Forgetting shrinks both the sum and the weight, so the share of the parameters shrinks alike.
        freedom = self.weight * (1.0 - self.n / self.samples) if self.samples > self.n else 0.0
        return self._squares / freedom if freedom > 0.0 else math.nan

    def evaluate(self, x: Sequence[float], y: float) -> tuple[float, float]:
        """Innovation y - x . theta and information x' P x of a sample, without learning from it."""
        innovation, information, *_ = self._projected(x, y)
        return innovation, information

    def update(self, x: Sequence[float], y: float) -> float:
        """Learn from a sample unless it is not finite; return its innovation.

        Below the gate of information the estimate changes but not the covariance.
        """
        innovation, information, f, v = self._projected(x, y)
        if not (math.isfinite(innovation) and math.isfinite(information)):
            return innovation
        keep, share = self._forgetting, innovation / (1.0 + information)
        self._squares = keep * self._squares + innovation * share
        self.weight = keep * self.weight + 1.0
        self.samples += 1
        gain = self._shrink(f, v, information) if information > (1.0 - keep) / keep else self._times_upper(v)
        self._theta = [value + part * share for value, part in zip(self._theta, gain, strict=True)]
        return innovation

    def _projected(self, x: Sequence[float], y: float) -> tuple[float, float, list[float], list[float]]:
        """Innovation and information of a sample; U' x and D U' x, n numbers each."""
        f = [sum(map(mul, column, x)) + own for column, own in zip(self._upper, x, strict=True)]
        v = list(map(mul, self._diagonal, f))
        return y - sum(map(mul, self._theta, x)), sum(map(mul, f, v)), f, v

    def _shrink(self, f: list[float], v: list[float], information: float) -> list[float]:
        """Bierman's update with the noise variance that makes the forgetting directional; return P x of before."""
        keep, diagonal = self._forgetting, self._diagonal
        gain: list[float] = []
        total = 1.0 if keep == 1.0 else information / (keep * information - 1.0 + keep)
        for j, column in enumerate(self._upper):
            was, slope = total, -f[j] / total
            total += f[j] * v[j]
            diagonal[j] *= was / total
            for i, old in enumerate(column):
                column[i] = old + gain[i] * slope
                gain[i] += old * v[j]
            gain.append(v[j])
        return gain

    def _times_upper(self, v: list[float]) -> list[float]:
        """P x = U v: n numbers."""
        gain: list[float] = []
        for j, column in enumerate(self._upper):
            for i, above in enumerate(column):
                gain[i] += above * v[j]
            gain.append(v[j])
        return gain
