"""Online estimator of one axis: filters, whitening, recursive least squares, a reason for every rejected sample."""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.autoregression import Correlator
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.filtered_regression import FilteredRegression, RowWhitener, Sample, physical, scaled
from hindrax_ident.online.joint_ekf import JointFilter
from hindrax_ident.online.rls import Rls
from hindrax_ident.records.binning import DEPTH_S
from hindrax_ident.tuning import USUAL_LAG_S, USUAL_LATENCY_S, Tuning

NOISE = 0.01
"""Noise of a velocity [m/s, rad/s] assumed of the first samples, and to weight the prior against them."""
ROUGHLY_AFTER = 4
"""Samples per parameter after which the noise variance is known."""
KNOWN_AFTER = 40
"""Samples per parameter after which the estimate adapts the filter and detects outliers."""
START_FILTER_AFTER = 125
"""Samples per parameter after which the joint filter starts: from a poor initial estimate it diverges."""
SHORTEST_BLOCK, MOST_BLOCKS = 25, 40
"""Initial samples per block of the scatter that widens the covariance, and number of blocks at which pairs are merged:
longer runs show slower color of the noise."""
DERIVED_SPREAD_s2 = DEPTH_S**2 / 6.0
"""Variance of the time span of a derived velocity: a difference of two mean depths is a mean velocity over both spans,
weighted toward the middle."""
SUMMED_S = 0.7
"""Derived velocities are differences, and so is their noise: their regression rows are integrated over this time."""
MOST_OUTLIERS_IN_A_ROW = 20
"""Consecutive outliers after which samples are accepted again: then the estimate is wrong, not the samples."""


@dataclass(frozen=True, slots=True)
class SampleVerdict:
    """Outcome of a sample: whether it was used, the reason if not, and its innovation [m/s, rad/s]."""

    learned: bool
    reason: str = ""
    innovation: float = math.nan


class AxisEstimator:
    """Inputs in time order. Times in seconds, forces in N or N m, velocities in m/s or rad/s."""

    def __init__(
        self,
        model: Model,
        lag_s: float,
        prior: Prior,
        tuning: Tuning,
        prior_delays_s: tuple[float, float] = (USUAL_LAG_S, USUAL_LATENCY_S),
    ) -> None:
        """With `tuning.plateaus_only` the mass stays at its prior, and three coefficients are estimated.

        With `tuning.lag_doubt_s` the delay of the thrust is estimated too, about `prior_delays_s`: lag and latency.
        """
        lag_doubt_s = 0.0 if tuning.lag_doubt_s is None else tuning.lag_doubt_s
        if lag_doubt_s > 0.0:
            lag_s = prior_delays_s[0]
        self.model, self._tuning = model, tuning
        self.regression = FilteredRegression(model, lag_s, tuning.filter_rate)
        # Without any, the noise of the first samples would choose the direction: heave begins at rest.
        self.regression.noise_variance = NOISE**2
        self._fixed_mass = float(prior.values[-1]) if tuning.plateaus_only else 0.0
        scaled_values, covariance = scaled(prior.values.tolist(), np.diag(prior.sigmas**2))
        known = len(scaled_values) - bool(self._fixed_mass)
        values = scaled_values[:known].tolist()
        sigmas = (np.sqrt(np.diag(covariance))[:known] / NOISE).tolist()
        # F(t - d) is F - d F': the delay of the thrust against the velocity, over the mass, is one more coefficient.
        self._delayed = lag_doubt_s > 0.0 and not self._fixed_mass
        if self._delayed:
            sigmas.append(math.sqrt(2.0) * lag_doubt_s * values[-1] / NOISE)
            values.append(prior_delays_s[1] * values[-1])
        self._rls = Rls(values, sigmas, tuning.forgetting)
        self._whitener = RowWhitener(len(values) + 1, lag_s, float(prior.values[-1]))
        self.correlator = Correlator()
        self._filter = JointFilter(model, lag_s) if tuning.estimator == "ekf" and not self._fixed_mass else None
        self._inputs: deque[tuple[float, str, float]] = deque()
        self._outliers = 0
        self._sum: tuple[float, ...] = ()
        self._rows: list[tuple[float, ...]] = []
        self._blocks: list[Array] = []
        self._length = SHORTEST_BLOCK
        self._widening: Array | None = None
        """None after a block was added, until the covariance is asked for."""

    @property
    def samples(self) -> int:
        """Number of samples used."""
        return self._rls.samples

    @property
    def effective_samples(self) -> float:
        """Equivalent number of independent samples, after forgetting and correlation of the residuals.

        Residuals that alternate are no gain: the whitening assumed more thrust noise than there was.
        """
        return self._rls.weight / max(1.0, self.correlator.factor)

    @property
    def noise(self) -> float:
        """Standard deviation of the residuals [m/s, rad/s]; NaN before there are enough."""
        return math.sqrt(self._rls.variance)

    def thrust(self, t_s: float, force: float, effort: float | None = None) -> None:
        """Thrust commanded from this time on; `effort` as in a record, by default that of a single thruster."""
        self._inputs.append((t_s, "thrust", force))
        self._inputs.append((t_s, "effort", force * force if effort is None else effort))

    def known(self, t_s: float, force: float) -> None:
        """Known force from this time on."""
        self._inputs.append((t_s, "known", force))

    def position(self, t_s: float, position: float) -> None:
        """Angle, for the restoring moment, or depth."""
        self._inputs.append((t_s, "position", position))

    def _apply_inputs_until(self, t_s: float) -> None:
        """Apply inputs up to this time: velocities are means, so they are older than inputs received with them."""
        inputs = self._inputs
        while inputs and inputs[0][0] <= t_s:
            at_s, kind, value = inputs.popleft()
            getattr(self._whitener if kind == "effort" else self.regression, kind)(at_s, value)
            if self._filter and kind != "effort":
                getattr(self._filter, kind)(at_s, value)

    def velocity(self, t_s: float, v: float, refusal: str = "", *, derived: bool = False) -> SampleVerdict:
        """Add one velocity; with a `refusal` it updates the filters but not the estimate.

        `derived`: computed from positions, which the joint filter has used already.
        """
        regression, tuning = self.regression, self._tuning
        self._apply_inputs_until(t_s)
        pause = t_s - regression.velocity_time_s
        if pause <= 0.0:
            return SampleVerdict(learned=False, reason="its stamp is not later than the previous one")
        if pause > tuning.gap_s:
            regression.restart()
            self._whitener.restart()
            self._sum = ()
        age = t_s - regression.thrust_time_s
        sample = regression.velocity(t_s, v, DERIVED_SPREAD_s2 if derived else 0.0)
        if not derived:
            self._whitener.advance(t_s, regression.rate)
        elif sample is not None:
            sample = self._summed(sample, pause)
        if self._filter and not derived:
            self._filter.velocity(t_s, v)
        refusal = refusal or self._refusal(sample, pause, age)
        if refusal or sample is None:
            self.correlator.restart()
            return SampleVerdict(learned=False, reason=refusal)
        return self._learn(sample, t_s, derived=derived)

    def _summed(self, sample: Sample, pause: float) -> Sample:
        """Leaky integral of the rows, which turns differences of measured positions back into positions."""
        keep = math.exp(-pause / SUMMED_S)
        row = (*sample.x, sample.rise, sample.y)
        past = self._sum or (0.0,) * len(row)
        self._sum = tuple(keep * old + new for old, new in zip(past, row, strict=True))
        *x, rise, y = self._sum
        return replace(sample, x=tuple(x), rise=rise, y=y)

    def _refusal(self, sample: Sample | None, pause: float, age: float) -> str:
        if math.isnan(age):
            return "no thrust received yet"
        if age > self._tuning.thrust_age_s:
            return f"the last thrust is {age:.1f} s old"
        if sample is None:
            return "first velocity" if math.isnan(pause) else f"no velocity for {pause:.1f} s"
        return "" if sample.settled else "the filters are settling"

    def _learn(self, sample: Sample, t_s: float, *, derived: bool) -> SampleVerdict:
        x, y = sample.x, sample.y
        if self._delayed:
            x = (*x, -sample.rise)
        if self._fixed_mass:
            x, y = x[:-1], y - x[-1] / self._fixed_mass
        scale = 1.0
        if not derived:
            scale = self._whitener.scale
            *columns, y = (scale * value for value in self._whitener.unpredicted((*x, y)))
            x = tuple(columns)
        innovation, information = self._rls.evaluate(x, y)
        self._outliers = self._outliers + 1 if self._is_outlier(innovation, information) else 0
        if 0 < self._outliers <= MOST_OUTLIERS_IN_A_ROW:
            self.regression.undo_last()
            return SampleVerdict(learned=False, reason="outlier", innovation=innovation / scale)
        if self.samples > KNOWN_AFTER * self._rls.n and not derived:
            # The noise of a velocity is in x as well as in y: subtract the unexpected part from x.
            slopes = (*sample.slope, 0.0) if self._delayed else sample.slope
            x = tuple(value - scale**2 * slope * innovation for value, slope in zip(x, slopes, strict=False))
        self._rls.update(x, y)
        self.correlator.add(innovation / (1.0 + information))
        if not derived and math.isfinite(innovation):
            self._whitener.update([value / scale for value in (*x, y)])
        self._add_to_block((*x, y))
        if self.samples > ROUGHLY_AFTER * self._rls.n:
            # The noise of a sum of differences is that of the positions: a difference has twice its variance.
            self.regression.noise_variance = self._rls.variance * (2.0 if derived else 1.0)
        if self.samples > KNOWN_AFTER * self._rls.n:
            self._adapt_filter(sample)
        if self._filter and not self._filter.started and self.samples > START_FILTER_AFTER * self._rls.n:
            theta, covariance = self.estimate()
            self._filter.start(t_s, theta, covariance, self._rls.variance)
        return SampleVerdict(learned=True, innovation=innovation / scale)

    def _is_outlier(self, innovation: float, information: float) -> bool:
        if self.samples <= KNOWN_AFTER * self._rls.n:
            return False
        limit = self._tuning.outlier_sigmas * self.noise
        return abs(innovation) > limit * math.sqrt(1.0 + information)

    def _add_to_block(self, row: tuple[float, ...]) -> None:
        """Accumulate blocks of samples: the scatter between them shows how much parts of the run differ."""
        self._rows.append(row)
        if len(self._rows) < self._length:
            return
        rows = np.array(self._rows)
        self._rows = []
        self._blocks.append(array(rows.T @ rows))
        if len(self._blocks) == MOST_BLOCKS:
            self._blocks = [one + other for one, other in zip(self._blocks[::2], self._blocks[1::2], strict=True)]
            self._length *= 2
        self._widening = None

    def _adapt_filter(self, sample: Sample) -> None:
        """Set the filter's pole so that residuals are white: drag slope over mass, plus a margin for disturbances."""
        q, tuning = self._rls.values, self._tuning
        back = 2 if self.model.split and sample.speed < 0.0 else 0
        slope = max(0.0, 2.0 * q[back] * abs(sample.speed) + q[back + 1])
        self.regression.rate = min(tuning.filter_fastest, math.hypot(slope, tuning.filter_slowest))

    def estimate(self) -> tuple[Array, Array]:
        """Parameters in the model's order and their covariance: (p,), (p, p)."""
        if self._filter and self._filter.started:
            return self._filter.estimate()
        if self._widening is None:
            self._widening = self._measured_widening()
        covariance = self._rls.unit_covariance * self._noise_variance * self._widening
        values = np.array(self._rls.values)
        if self._fixed_mass:
            return self._with_fixed_mass(values, covariance)
        p = len(self.model.names)
        return physical(values[:p].tolist(), covariance[:p, :p])

    @property
    def _noise_variance(self) -> float:
        variance = self._rls.variance
        return variance if variance > 0.0 else NOISE**2

    def _measured_widening(self) -> Array:
        """Ratios of the scatter between blocks to the covariance, never below one: (n, n) [-].

        The scatter is that of the estimates without one block each (jackknife; CR3 of Bell and McCaffrey, Survey
        Methodology 2002): a block on which the estimate leans has smaller residuals than errors. Where forgetting left
        less information than a block had, the residuals are taken as they are.
        """
        n, blocks = self._rls.n, len(self._blocks)
        if blocks < 2 * n:
            return np.ones((n, n))
        unit, squares = self._rls.unit_covariance, np.array(self._blocks)
        gradients = squares[:, :n, n] - squares[:, :n, :n] @ np.array(self._rls.values)
        information = array(np.linalg.inv(unit))
        others = array(information - squares[:, :n, :n])
        if np.linalg.eigvalsh(others).min() <= 0.0:
            others = information
        without = np.linalg.solve(others, gradients[:, :, None])[:, :, 0]
        scatter = np.sum(without**2, axis=0) * (blocks - 1) / blocks
        ratio = np.maximum(1.0, scatter / (np.diag(unit) * self._noise_variance))
        # That of one coefficient, from so few blocks, is off by a fifth; the color of the noise is that of all.
        deviation = np.sqrt(np.maximum(ratio, ratio.mean()))
        return np.outer(deviation, deviation)

    def _with_fixed_mass(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        """Parameters with the fixed mass as the last, (p,), and their covariance, (p, p)."""
        mass = self._fixed_mass
        whole = np.zeros((len(values) + 1,) * 2)
        whole[:-1, :-1] = covariance * mass * mass
        return np.append(values * mass, mass), whole
