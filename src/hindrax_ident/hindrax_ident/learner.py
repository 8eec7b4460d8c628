"""The online estimator of one axis: filters, recursive least squares, and a reason for every sample it refuses."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.belief import Belief
from hindrax_ident.ekf import JointFilter
from hindrax_ident.intake import DEPTH_S
from hindrax_ident.models import Model
from hindrax_ident.noise import Correlator
from hindrax_ident.regression import FilteredRegression, Sample, physical, scaled
from hindrax_ident.rls import Rls
from hindrax_ident.tuning import Tuning

NOISE = 0.01
"""Noise of a velocity [m/s, rad/s] assumed to weigh the belief against the first samples."""
ROUGHLY_AFTER = 4
"""Samples per parameter after which the size of the noise is known."""
KNOWN_AFTER = 40
"""Samples per parameter after which the estimate may steer the filter and judge outliers."""
SURE_AFTER = 125
"""Samples per parameter after which the joint filter may start: from a bad start it diverges."""
SHORTEST_BLOCK, MOST_BLOCKS = 25, 40
"""Samples per block of the scatter that widens the covariance, and how many there may be before pairs become one: the
longer the run, the slower the color of the noise that shows."""
DERIVED_SPREAD_s2 = DEPTH_S**2 / 6.0
"""A difference of two means of depths is the mean of the velocity over both, the middle counting most."""
SUMMED_S = 0.7
"""Derived velocities are differences, and so is their noise: their rows are summed up again over this time."""
STUBBORN = 20
"""Outliers in a row after which they are believed: it was the estimate that was wrong."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a sample: whether it was learned from, why not, and by how much it was off [m/s, rad/s]."""

    learned: bool
    reason: str = ""
    innovation: float = math.nan


class Learner:
    """Feed it in the order of time. Times in seconds, forces in N or N m, velocities in m/s or rad/s."""

    __slots__ = (
        "_blocks", "_filter", "_fixed_mass", "_length", "_outliers", "_rls", "_rows", "_sum", "_tuning", "_waiting",
        "_widening", "correlator", "model", "regression",
    )  # fmt: skip

    def __init__(self, model: Model, lag_s: float, belief: Belief, tuning: Tuning) -> None:
        """With `tuning.plateaus_only` the mass stays at its belief and three coefficients are left."""
        self.model, self._tuning = model, tuning
        self.regression = FilteredRegression(model, lag_s, tuning.filter_rate)
        self._fixed_mass = float(belief.values[-1]) if tuning.plateaus_only else 0.0
        values, covariance = scaled(belief.values.tolist(), np.diag(belief.sigmas**2))
        known = len(values) - bool(self._fixed_mass)
        sigmas = np.sqrt(np.diag(covariance))[:known] / NOISE
        self._rls = Rls(values[:known].tolist(), sigmas.tolist(), tuning.forgetting)
        self.correlator = Correlator()
        self._filter = JointFilter(model, lag_s) if tuning.estimator == "ekf" and not self._fixed_mass else None
        self._waiting: deque[tuple[float, str, float]] = deque()
        self._outliers = 0
        self._sum: tuple[float, ...] = ()
        self._rows: list[tuple[float, ...]] = []
        self._blocks: list[Array] = []
        self._length = SHORTEST_BLOCK
        self._widening: Array = np.ones((known, known))

    @property
    def samples(self) -> int:
        """Samples learned from."""
        return self._rls.samples

    @property
    def effective_samples(self) -> float:
        """Samples that forgetting and the correlation of the residuals leave."""
        return self._rls.weight / self.correlator.factor

    @property
    def noise(self) -> float:
        """Standard deviation of the residuals [m/s, rad/s]; NaN before there are enough."""
        return math.sqrt(self._rls.variance)

    def thrust(self, t_s: float, force: float) -> None:
        """Told to the thrusters from this time on."""
        self._waiting.append((t_s, "thrust", force))

    def known(self, t_s: float, force: float) -> None:
        """Known force from this time on."""
        self._waiting.append((t_s, "known", force))

    def position(self, t_s: float, position: float) -> None:
        """Angle, for the restoring moment, or depth."""
        self._waiting.append((t_s, "position", position))

    def _catch_up(self, t_s: float) -> None:
        """Let what was told up to this time act: velocities are means, so they are older than what came with them."""
        waiting = self._waiting
        while waiting and waiting[0][0] <= t_s:
            at_s, kind, value = waiting.popleft()
            getattr(self.regression, kind)(at_s, value)
            if self._filter:
                getattr(self._filter, kind)(at_s, value)

    def velocity(self, t_s: float, v: float, refusal: str = "", *, derived: bool = False) -> Verdict:
        """One velocity; with a `refusal` the filters follow but nothing is learned.

        `derived`: it was made from positions, which the joint filter has seen already.
        """
        regression, tuning = self.regression, self._tuning
        self._catch_up(t_s)
        pause = t_s - regression.velocity_time_s
        if pause <= 0.0:
            return Verdict(learned=False, reason="its stamp is not later than the one before")
        if pause > tuning.gap_s:
            regression.restart()
            self._sum = ()
            self.correlator.restart()
        age = t_s - regression.thrust_time_s
        sample = regression.velocity(t_s, v, DERIVED_SPREAD_s2 if derived else 0.0)
        if sample is not None and derived:
            sample = self._summed(sample, pause)
        if self._filter and not derived:
            self._filter.velocity(t_s, v)
        refusal = refusal or self._refusal(sample, pause, age)
        if refusal or sample is None:
            self.correlator.restart()
            return Verdict(learned=False, reason=refusal)
        return self._learn(sample, t_s, derived=derived)

    def _summed(self, sample: Sample, pause: float) -> Sample:
        """Leaky sum of the rows, in which the differences of the measured positions are positions again."""
        keep = math.exp(-pause / SUMMED_S)
        row = (*sample.x, sample.y)
        past = self._sum or (0.0,) * len(row)
        self._sum = tuple(keep * old + new for old, new in zip(past, row, strict=True))
        return replace(sample, x=self._sum[:-1], y=self._sum[-1])

    def _refusal(self, sample: Sample | None, pause: float, age: float) -> str:
        if math.isnan(age):
            return "no thrust yet"
        if age > self._tuning.thrust_age_s:
            return f"the last thrust is {age:.1f} s old"
        if sample is None:
            return "first velocity" if math.isnan(pause) else f"no velocity for {pause:.1f} s"
        return "" if sample.settled else "the filters are settling"

    def _learn(self, sample: Sample, t_s: float, *, derived: bool) -> Verdict:
        x, y = sample.x, sample.y
        if self._fixed_mass:
            x, y = x[:-1], y - x[-1] / self._fixed_mass
        if self._is_outlier(x, y):
            self._outliers += 1
            self.regression.forget_last()
            return Verdict(learned=False, reason="outlier", innovation=self._rls.regard(x, y)[0])
        self._outliers = 0
        innovation, information = self._rls.regard(x, y)
        if self.samples > KNOWN_AFTER * self._rls.n and not derived:
            # The noise of a velocity is in x as well as in y. What was not expected of it is taken out of x.
            x = tuple(value - slope * innovation for value, slope in zip(x, sample.slope, strict=False))
        self._rls.update(x, y)
        self.correlator.add(innovation / (1.0 + information))
        self._account((*x, y))
        if self.samples > ROUGHLY_AFTER * self._rls.n:
            # The noise of a sum of differences is that of the positions: a difference has twice its variance.
            self.regression.noise_variance = self._rls.variance * (2.0 if derived else 1.0)
        if self.samples > KNOWN_AFTER * self._rls.n:
            self._steer(sample)
        if self._filter and not self._filter.started and self.samples > SURE_AFTER * self._rls.n:
            theta, covariance = self.estimate()
            self._filter.start(t_s, theta, covariance, self._rls.variance)
        return Verdict(learned=True, innovation=innovation)

    def _is_outlier(self, x: tuple[float, ...], y: float) -> bool:
        if self.samples <= KNOWN_AFTER * self._rls.n or self._outliers >= STUBBORN:
            return False
        innovation, information = self._rls.regard(x, y)
        limit = self._tuning.outlier_sigmas * self.noise
        return abs(innovation) > limit * math.sqrt(1.0 + information)

    def _account(self, row: tuple[float, ...]) -> None:
        """Sum up blocks of samples: the scatter between them tells how far apart parts of the run are."""
        self._rows.append(row)
        if len(self._rows) < self._length:
            return
        rows = np.array(self._rows)
        self._rows = []
        self._blocks.append(array(rows.T @ rows))
        if len(self._blocks) == MOST_BLOCKS:
            self._blocks = [one + other for one, other in zip(self._blocks[::2], self._blocks[1::2], strict=True)]
            self._length *= 2
        self._widening = self._measured_widening()

    def _steer(self, sample: Sample) -> None:
        """Let the filter's pole whiten the residuals: slope of the drag over mass, and a little for unknown forces."""
        q, tuning = self._rls.values, self._tuning
        back = 2 if self.model.split and sample.speed < 0.0 else 0
        slope = max(0.0, 2.0 * q[back] * abs(sample.speed) + q[back + 1])
        self.regression.rate = min(tuning.filter_fastest, math.hypot(slope, tuning.filter_slowest))

    def estimate(self) -> tuple[Array, Array]:
        """Parameters in the model's order and their covariance: (p,), (p, p)."""
        if self._filter and self._filter.started:
            return self._filter.estimate()
        covariance = self._rls.unit_covariance * self._noise_variance * self._widening
        values = np.array(self._rls.values)
        if self._fixed_mass:
            return self._with_fixed_mass(values, covariance)
        return physical(values.tolist(), covariance)

    @property
    def _noise_variance(self) -> float:
        variance = self._rls.variance
        return variance if variance > 0.0 else NOISE**2

    def _measured_widening(self) -> Array:
        """By how much the scatter between blocks exceeds the covariance, never below one: (n, n)."""
        n, blocks = self._rls.n, len(self._blocks)
        if blocks < 2 * n:
            return np.ones((n, n))
        unit, squares = self._rls.unit_covariance, np.array(self._blocks)
        gradients = squares[:, :n, n] - squares[:, :n, :n] @ np.array(self._rls.values)
        scatter = np.sum((gradients @ unit) ** 2, axis=0) * blocks / (blocks - 1)
        ratio = np.sqrt(np.maximum(1.0, scatter / (np.diag(unit) * self._noise_variance)))
        return np.outer(ratio, ratio)

    def _with_fixed_mass(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        mass = self._fixed_mass
        whole = np.zeros((len(values) + 1,) * 2)
        whole[:-1, :-1] = covariance * mass * mass
        return np.append(values * mass, mass), whole
