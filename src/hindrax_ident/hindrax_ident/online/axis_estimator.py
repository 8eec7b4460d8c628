"""Online estimator of one axis: filters, whitening, recursive least squares, a reason for every rejected sample.

A velocity goes through these, in this order, and each says in its own module why:

    inputs up to its time       thrust behind lag and delay, known forces, angle   FilteredRegression
    row                         y = x . q + shapes . g + noise                     FilteredRegression.velocity
    whitened row                less what the rows before predict                  RowWhitener
    innovation                  y - x . q, and whether it is an outlier            Rls.evaluate, _is_outlier
    estimate                    q, g and their covariance                          Rls.update

Symbols. theta (p,) the model's parameters, M the last of them; q = (theta / M, 1 / M), in which the row is linear; g
the m coefficients of the shapes of the thrust's delay, the last GOES of thrust that goes by another lag than it comes,
and after them those of what the other axes do, where they are not held; n = p + m, where the lag is known p, less one
where the mass is fixed. Rows have the noise of one velocity, whose variance s^2 is estimated; `Rls.unit_covariance`
(n, n) is to be multiplied by it.

What least squares does not know is told when the estimate is asked for (`estimate`): color of the residuals and what
differs between parts of the run (`_measured_widening`), that the shapes are those of one lag and one delay
(`lag_and_delay`), shapes beyond the last (`_left_out`), and of a record that moves across the drag by incidence
(`_by_incidence`). It is computed from sums, so a sample costs the same however long the run is.
"""

import itertools
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from hindrax_core.text.coded import Coded
from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.autoregression import Correlator
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import INCIDENCE, LEAST_SPEED, Model
from hindrax_ident.online.cross_forces import CrossForces
from hindrax_ident.online.filtered_regression import (
    FilteredRegression,
    RowWhitener,
    Sample,
    physical,
    scaled,
    slope_by_speed_across,
)
from hindrax_ident.online.joint_ekf import JointFilter
from hindrax_ident.online.lag_and_delay import GOES, conditioned, settled, thruster
from hindrax_ident.online.rls import Rls, WideRls
from hindrax_ident.online.sample_verdict import LEARNED, NotLearned, SampleVerdict, not_learned
from hindrax_ident.records.axis_record import Samples
from hindrax_ident.records.binning import DEPTH_S
from hindrax_ident.tuning import LAG_DIFFERENCE_S, LAG_SIGMA_S, USUAL_LAG_S, Tuning

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
SHAPES = 4
"""Shapes for what lag and delay of the thrust differ from those assumed."""
LEAST_LAG_S = 0.1
"""Shortest lag of the filter that they belong to: with it they describe any lag below."""
DELAYS_AFTER_S = 5.0
"""Time of learning after which the delays found are looked at; again after twice of it, and so on."""
LAST_LOOK_S = 25.0
"""Time of learning after which nobody looks any more: delays that are a little off cost less than learning again."""
MOST_REMEMBERED = 30_000
"""Inputs that are kept until then, to be learned from again: of more, as of an hour before the dive, the later half."""
OFF_S, CLEARLY = 0.03, 2.0
"""Change of lag or latency that is worth to begin anew, at least and in its standard deviations."""
MEAN_KNOWN_S = 0.05
"""Standard deviation of lag and delay together below which they are known."""
TOO_LATE_S = 0.003
"""Time by which the latency assumed is less than that found: what comes too late can be described, and nothing before
its cause. With 50 ms assumed of punctual velocities yaw's inertia was 6 % too small."""
MOST_LATE_S = 1.0
"""Longest lag or latency that is followed: more is another defect."""
MOST_OUTLIERS_IN_A_ROW = 20
"""Consecutive outliers after which samples are accepted again: then the estimate is wrong, not the samples."""


Input: TypeAlias = "Callable[[AxisEstimator], SampleVerdict | None]"
"""Gives it to an estimator; the verdict is that of a velocity."""


class AxisEstimator:
    """Inputs in time order. Times in seconds, forces in N or N m, velocities in m/s or rad/s."""

    def __init__(
        self,
        model: Model,
        lag_s: float,
        prior: Prior,
        tuning: Tuning,
        usual_lag_s: float = USUAL_LAG_S,
        *,
        shapes: int = SHAPES,
        cross: CrossForces | None = None,
    ) -> None:
        """With `tuning.plateaus_only` the mass stays at its prior, and three coefficients are estimated.

        Otherwise the delay of the thrust is estimated too, about `usual_lag_s` and no latency. With 0 `shapes`, `lag_s`
        is taken for the truth, as the joint filter always does. `cross`: what the other axes do, None where they are
        held.
        """
        self.model, self._tuning, self._cross = model, tuning, cross
        self._fixed_mass = float(prior.values[-1]) if tuning.plateaus_only else 0.0
        self._shapes = 0 if self._fixed_mass else shapes
        self._known_after = KNOWN_AFTER * (len(model.names) - bool(self._fixed_mass))
        self._lag_s = lag_s
        self._prior = prior
        self._look_s = DELAYS_AFTER_S
        # What came so far, to be learned from again with other delays; None: nobody looks for them any more.
        self._past: Samples[Input] | None = Samples() if self._shapes else None
        self._begin(usual_lag_s if self._shapes else lag_s, 0.0)

    def _begin(self, lag_s: float, late_s: float) -> None:
        """Begin to learn from the prior, with this lag of the thrust, and velocities late by so much.

        Deviations are in units of `NOISE`, as `Rls` wants them. The shapes are zero but for delays that differ from
        those assumed: a delay of d makes their k-th coefficient about d^k / M.
        """
        tuning, model, prior = self._tuning, self.model, self._prior
        self._inputs: deque[tuple[float, str, float | Sequence[float]]] = deque()
        self._thrusts: deque[tuple[float, str, float]] = deque()
        self._thrust_s = math.nan
        self._outliers, self._learned_s = 0, 0.0
        lag_s = max(LEAST_LAG_S, lag_s) if self._shapes else lag_s
        self._late_s = late_s
        self.regression = FilteredRegression(model, lag_s, tuning.filter_rate, self._shapes, self._cross)
        # Without any, the noise of the first samples would choose the direction: heave begins at rest.
        self.regression.noise_variance = NOISE**2
        scaled_values, covariance = scaled(prior.values.tolist(), np.diag(prior.sigmas**2))
        known = len(scaled_values) - bool(self._fixed_mass)
        values = scaled_values[:known].tolist()
        sigmas = (np.sqrt(np.diag(covariance))[:known] / NOISE).tolist()
        delay_sigma_s = math.sqrt(2.0) * (tuning.lag_doubt_s or LAG_SIGMA_S)
        delay_sigmas = [delay_sigma_s**order for order in range(1, self._shapes + 1)]
        delay_sigmas += [LAG_DIFFERENCE_S * delay_sigma_s**order for order in range(GOES)] * bool(self._shapes)
        cross_sigmas = [1.0] * (len(self._cross) if self._cross else 0)
        sigmas += [one * values[-1] / NOISE for one in (*delay_sigmas, *cross_sigmas)]
        values += [0.0] * (len(delay_sigmas) + len(cross_sigmas))
        # Of many unknowns numpy is quicker than text that is made for their number.
        self._rls = (WideRls if self._cross else Rls)(values, sigmas, tuning.forgetting)
        self._whitener = RowWhitener(len(values) + 1 + model.turns, lag_s, float(prior.values[-1]))
        # Sum over the rows of x times the column of the drag by incidence, and the highest speed: `_by_incidence`.
        self._along, self._fastest = (0.0,) * len(values), 0.0
        self.correlator = Correlator()
        self._filter = JointFilter(model, self._lag_s) if tuning.estimator == "ekf" and not self._fixed_mass else None
        self._sum: tuple[float, ...] = ()
        self._rows: list[tuple[float, ...]] = []
        self._blocks: list[Array] = []
        self._length = SHORTEST_BLOCK
        # What the last block of samples told: how much parts of the run differ, and lag and delay of the thrust.
        self._widening: Array = np.ones((len(values),) * 2)
        self._delay_columns = slice(len(model.names), len(model.names) + len(delay_sigmas))
        usual_s = array(np.array([lag_s, 0.0, 0.0]))
        self._thruster = thruster(usual_s, lag_s, self._shapes + GOES) if self._shapes else None

    def _other_delays_s(self) -> tuple[float, float] | None:
        """Lag and latency to begin anew with, where they are known, and clearly others than those assumed [s].

        A filter with wrong ones describes the thrust by shapes that it has to estimate, and by too few of them: worth a
        new beginning if the change is clear. Of a delay much longer than the filter's lag the shapes tell the sum with
        the lag better than its parts; the latency is then that which is left by the longer of both lags.
        """
        values, covariance = np.array(self._rls.values), self._covariance()
        if self._thruster is None or not self._tells_delays(values, covariance):
            return None
        found = conditioned(values, covariance, self._delay_columns, self._thruster)
        spread_s2, (found_s, delay_s, _) = found.covariance_s2, found.found_s.tolist()
        lag_sigma_s, mean_sigma_s = math.sqrt(spread_s2[0, 0]), math.sqrt(max(0.0, spread_s2[:2, :2].sum()))
        before_s, lag_s = self.regression.lag_s, max(LEAST_LAG_S, found_s)
        late_s = self._late_s + found_s + delay_s - max(lag_s, min(before_s, found_s + lag_sigma_s)) - TOO_LATE_S
        late_s = min(MOST_LATE_S, max(0.0, late_s))
        lag_off = abs(lag_s - before_s) > max(OFF_S, CLEARLY * lag_sigma_s)
        off = lag_off or abs(late_s - self._late_s) > max(OFF_S, CLEARLY * mean_sigma_s)
        return (lag_s, late_s) if off and mean_sigma_s < MEAN_KNOWN_S and lag_s < MOST_LATE_S else None

    def _tells_delays(self, values: Array, covariance: Array) -> bool:
        """Whether there is a mass at all, and whether all of it is known in numbers."""
        return bool(values[len(self.model.names) - 1] > 0.0 and np.all(np.isfinite(covariance)))

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
        """Thrust commanded from this time on.

        Parameters
        ----------
        t_s : [s]
            In time order.
        force : [N, N m]
            On the axis.
        effort : [N^2, N^2 m^2]
            Sum of the squared parts of the thrusters, as in a record; None: that of a single thruster.
        """
        self._remember(lambda one: one.thrust(t_s, force, effort))
        if self._filter:
            self._inputs.append((t_s, "thrust", force))
        self._thrusts.append((t_s, "thrust", force))
        self._thrusts.append((t_s, "effort", force * force if effort is None else effort))

    def known(self, t_s: float, force: float) -> None:
        """Known force from this time on."""
        self._remember(lambda one: one.known(t_s, force))
        self._inputs.append((t_s, "known", force))

    def position(self, t_s: float, position: float) -> None:
        """Angle, for the restoring moment, or depth."""
        self._remember(lambda one: one.position(t_s, position))
        self._inputs.append((t_s, "position", position))

    def others(self, t_s: float, nu: Sequence[float]) -> None:
        """Velocities of all axes from this time on, for what the others do (6,) [m/s, rad/s]."""
        if self._cross:
            self._remember(lambda one: one.others(t_s, nu))
            self._inputs.append((t_s, "others", nu))

    def across(self, t_s: float, speed: float, by_areas: float = 0.0) -> None:
        """Speed across the axis from this time on.

        Parameters
        ----------
        t_s : [s]
            In time order.
        speed : [m/s, rad/s]
            For the drag by it (`motion_model.speed_across`).
        by_areas : [m/s]
            Weighted by areas, for the drag by incidence (`motion_model.areas_across`).
        """
        self._remember(lambda one: one.across(t_s, speed, by_areas))
        self._inputs.append((t_s, "across", speed))
        if self.model.turns:
            self._inputs.append((t_s, "areas", by_areas))

    def _remember(self, given: Input) -> None:
        """Keep an input, as long as it may be wanted again."""
        if self._past is not None:
            self._past.append(given)
            if self._learned_s > LAST_LOOK_S:
                self._past = None
            elif len(self._past) > MOST_REMEMBERED:
                del self._past[: MOST_REMEMBERED // 2]

    def _apply_inputs_until(self, t_s: float) -> None:
        """Apply inputs up to this time: velocities are means, so they are older than inputs received with them."""
        thrusts, inputs, late_s = self._thrusts, self._inputs, self._late_s
        while thrusts or inputs:
            first = inputs if not thrusts or (inputs and inputs[0][0] < thrusts[0][0] + late_s) else thrusts
            at_s, kind, value = first[0]
            # Before the first command the thrust was as it was then.
            acts_s = at_s if first is inputs or math.isnan(self._thrust_s) else at_s + late_s
            if acts_s > t_s:
                break
            first.popleft()
            if first is thrusts or kind != "thrust":
                getattr(self._whitener if kind == "effort" else self.regression, kind)(acts_s, value)
            if self._filter and first is inputs and kind not in ("areas", "others"):
                getattr(self._filter, kind)(at_s, value)
            if kind == "effort":
                self._thrust_s = at_s

    def _received_s(self, t_s: float) -> float:
        """Stamp of the last thrust up to this time, though it may not act yet."""
        waiting = itertools.takewhile(lambda at_s: at_s <= t_s, (at_s for at_s, _, _ in self._thrusts))
        return max(waiting, default=self._thrust_s)

    def velocity(
        self, t_s: float, v: float, refusal: Coded[NotLearned] = LEARNED, *, derived: bool = False
    ) -> SampleVerdict:
        """Add one velocity, and learn from it where nothing speaks against that.

        Parameters
        ----------
        t_s : [s]
            Later than the one before.
        v : [m/s, rad/s]
            Mean over a sample of its instrument.
        refusal
            Why the estimate is not to be updated; the filters are nevertheless.
        derived
            Whether it was computed from positions, which the joint filter has used already.

        Returns
        -------
        SampleVerdict
            Whether it was learned from; the reason where not, the innovation where it was.
        """
        self._remember(lambda one: one.velocity(t_s, v, refusal, derived=derived))
        regression, tuning = self.regression, self._tuning
        self._apply_inputs_until(t_s)
        pause = t_s - regression.velocity_time_s
        if pause <= 0.0:
            return SampleVerdict(not_learned(NotLearned.NOT_LATER))
        if pause > tuning.gap_s:
            regression.restart()
            self._whitener.restart()
            self._sum = ()
        age = t_s - self._received_s(t_s)
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
            return SampleVerdict(refusal)
        verdict = self._learn(sample, t_s, derived=derived)
        self._learned_s += pause
        # Differences of positions are too seldom to tell a delay better than the shapes describe it.
        if self._past is not None and not derived and self._learned_s > self._look_s:
            self._look_s *= 2.0
            delays_s = self._other_delays_s()
            if delays_s:
                return self._learn_again(*delays_s)
        return verdict

    def _learn_again(self, lag_s: float, late_s: float) -> SampleVerdict:
        """Begin anew with other delays, and learn from all that came so far; the verdict on the last velocity."""
        past, self._past = self._past or Samples(), None
        self._begin(lag_s, late_s)
        verdict = SampleVerdict()
        for give in past:
            verdict = give(self) or verdict
        self._past = past
        return verdict

    def _summed(self, sample: Sample, pause: float) -> Sample:
        """Leaky integral of the rows, which turns differences of measured positions back into positions."""
        keep = math.exp(-pause / SUMMED_S)
        row = (*sample.x, *sample.shapes, *sample.cross, sample.y, *sample.incidence)
        past = self._sum or (0.0,) * len(row)
        self._sum = tuple(keep * old + new for old, new in zip(past, row, strict=True))
        columns = len(sample.x)
        delays = columns + len(sample.shapes)
        y = delays + len(sample.cross)
        x, shapes, cross, incidence = (
            self._sum[:columns],
            self._sum[columns:delays],
            self._sum[delays:y],
            self._sum[y + 1 :],
        )
        return replace(sample, x=x, shapes=shapes, cross=cross, y=self._sum[y], incidence=incidence)

    def _refusal(self, sample: Sample | None, pause_s: float, age_s: float) -> Coded[NotLearned]:
        if math.isnan(age_s):
            return not_learned(NotLearned.NO_THRUST)
        if age_s > self._tuning.thrust_age_s:
            return not_learned(NotLearned.OLD_THRUST, age_s=age_s)
        if sample is None:
            first = math.isnan(pause_s)
            return not_learned(NotLearned.FIRST_VELOCITY if first else NotLearned.GAP, pause_s=pause_s)
        return LEARNED if sample.settled else not_learned(NotLearned.SETTLING)

    def _learn(self, sample: Sample, t_s: float, *, derived: bool) -> SampleVerdict:
        """Whiten a row, judge it, learn from it, and let what depends on the estimate follow it.

        With a fixed mass its term is known: it goes over to the response, and the row has a column less. Derived
        velocities are summed instead of whitened: their noise is that of a difference, not of a disturbance. An outlier
        leaves no trace, neither in the filters nor in the whitening; so nothing is updated before it is judged.
        """
        x, y, incidence = (*sample.x, *sample.shapes, *sample.cross), sample.y, sample.incidence
        if self._fixed_mass:
            x, y = x[:-1], y - x[-1] / self._fixed_mass
        scale = 1.0
        if not derived:
            scale = self._whitener.scale
            whitened = [scale * value for value in self._whitener.unpredicted((*x, y, *incidence))]
            x, y, incidence = tuple(whitened[: len(x)]), whitened[len(x)], tuple(whitened[len(x) + 1 :])
        innovation, information = self._rls.evaluate(x, y)
        self._outliers = self._outliers + 1 if self._is_outlier(innovation, information) else 0
        if 0 < self._outliers <= MOST_OUTLIERS_IN_A_ROW:
            self.regression.undo_last()
            return SampleVerdict(not_learned(NotLearned.OUTLIER), innovation / scale)
        if self.samples > self._known_after and not derived:
            # The noise of a velocity is in x as well as in y, which would bias the estimate: subtract from x what the
            # unexpected part of the velocity, the innovation, has added to it. Not before the estimate is known, when
            # an innovation is mostly its error.
            slopes = (*sample.slope, *(0.0 for _ in (*sample.shapes, *sample.cross)))
            x = tuple(value - scale**2 * slope * innovation for value, slope in zip(x, slopes, strict=False))
        self._rls.update(x, y)
        self.correlator.add(innovation / (1.0 + information))
        if not derived and math.isfinite(innovation):
            self._whitener.update([value / scale for value in (*x, y, *incidence)])
        self._add_to_block((*x, y))
        if math.isfinite(innovation):
            for column in incidence:
                kept = self._tuning.forgetting
                self._along = tuple(kept * sum_ + column * one for sum_, one in zip(self._along, x, strict=True))
            self._fastest = max(self._fastest, abs(sample.speed))
        self._follow(sample, innovation, derived=derived)
        if self._filter and not self._filter.started and self.samples > START_FILTER_AFTER * len(self.model.names):
            theta, covariance = self.estimate()
            self._filter.start(t_s, theta, covariance, self._rls.variance)
        return SampleVerdict(innovation=innovation / scale)

    def _follow(self, sample: Sample, innovation: float, *, derived: bool) -> None:
        """Let filter and whitening follow what is known of noise and drag after a sample."""
        if self.samples > ROUGHLY_AFTER * self._rls.n:
            # The noise of a sum of differences is that of the positions: a difference has twice its variance.
            self.regression.noise_variance = self._rls.variance * (2.0 if derived else 1.0)
        if self.samples > self._known_after:
            self._adapt_filter(sample)
            if not derived:
                self._whitener.adapt(innovation, self.noise)

    def _is_outlier(self, innovation: float, information: float) -> bool:
        if self.samples <= self._known_after:
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
        self._blocks.append(rows.T @ rows)
        if len(self._blocks) == MOST_BLOCKS:
            self._blocks = [one + other for one, other in zip(self._blocks[::2], self._blocks[1::2], strict=True)]
            self._length *= 2
        self._widening = self._measured_widening()
        values, covariance, columns = np.array(self._rls.values), self._covariance(), self._delay_columns
        if self._thruster and self._tells_delays(values, covariance):
            self._thruster = settled(values, covariance, columns, self._thruster, self.regression.lag_s)

    def _adapt_filter(self, sample: Sample) -> None:
        """Set the filter's pole so that residuals are white: drag slope over mass, plus a margin for disturbances.

        That slope, d(drag)/dv / M = 2 k_q |v| / M + k_l / M, is the rate at which the vehicle itself forgets a
        disturbance (Young 2011, chapter 8). Negative estimates count as zero, and the margin adds like a square, so
        that the filter neither stops nor jumps at rest.
        """
        q, tuning = self._rls.values, self._tuning
        back = 2 if self.model.split and sample.speed < 0.0 else 0
        slope = max(0.0, 2.0 * q[back] * abs(sample.speed) + q[back + 1])
        if self.model.crossed:
            at = self.model.drags + 1
            slope += max(0.0, q[at] * slope_by_speed_across(sample.speed, self.regression.speed_across))
        self.regression.rate = min(tuning.filter_fastest, math.hypot(slope, tuning.filter_slowest))

    def estimate(self) -> tuple[Array, Array]:
        """Parameters in the model's order and their covariance: (p,), (p, p)."""
        if self._filter and self._filter.started:
            return self._filter.estimate()
        values, covariance = np.array(self._rls.values), self._covariance()
        if self._fixed_mass:
            return self._with_fixed_mass(values, covariance)
        p = len(self.model.names)
        if self._thruster:
            values, covariance = self._with_all_priors(values, covariance)
            left_out = self._left_out(values, covariance)
            if self._tells_delays(values, covariance):
                values, covariance = conditioned(values, covariance, self._delay_columns, self._thruster).estimate
            values, covariance = self._not_before_its_cause(values, covariance + left_out)
        covariance = covariance + self._by_incidence(values)
        return physical(values[:p].tolist(), covariance[:p, :p])

    def _covariance(self) -> Array:
        """That of the unknowns of least squares, as wide as parts of the run differ: (n, n)."""
        return array(self._rls.unit_covariance * self._noise_variance * self._widening)

    def _with_all_priors(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        """Estimate and covariance, (n,) and (n, n), by all that is known before of lags that differ and of other axes.

        Least squares began with it in units of `NOISE`. Where forces that nobody knows make the noise larger, it would
        count less just where it is needed: they look like thrust that goes half a second later.
        """
        lacking = max(0.0, 1.0 - NOISE**2 / self._noise_variance)
        if not lacking > 0.0:
            return values, covariance
        after = self._delay_columns.stop
        at = [after - GOES, *range(after, len(values))]
        usual = float(values[len(self.model.names) - 1]) * np.array([LAG_DIFFERENCE_S, *[1.0] * (len(at) - 1)])
        along = covariance[:, at]
        gain = np.linalg.solve(along[at] + np.diag(usual**2 / lacking), along.T).T
        return array(values - gain @ values[at]), array(covariance - gain @ along.T)

    def _left_out(self, values: Array, covariance: Array) -> Array:
        """Covariance for the shapes of the delay beyond the last: (n, n).

        A series that converges leaves out no more than its last term, and what that one changed of the estimate is
        known; but only as far as it is more than its own noise.
        """
        last = len(self.model.names) + self._shapes - 1
        variance = float(covariance[last, last])
        changed = covariance[:, last] / variance
        return array(np.outer(changed, changed) * max(0.0, float(values[last]) ** 2 - variance))

    def _not_before_its_cause(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        """Estimate and covariance, (n,) and (n, n), with no motion that comes before its thrust.

        Mean of lag and delay is what the regression assumes less the first shape over 1 / M (`lag_and_delay`). Where a
        record contains forces that the model lacks, the shapes follow them, and the mass grows: with a mean delay below
        zero the estimate is taken at zero, and what that changed beyond noise is doubt.
        """
        at = len(self.model.names)
        early = np.zeros(len(values))
        early[at], early[at - 1] = 1.0, -(self.regression.lag_s + self._late_s)
        excess, along = float(early @ values), covariance @ early
        variance = float(early @ along)
        if excess <= 0.0:
            return values, covariance
        moved = along / variance
        doubt = np.outer(moved, moved) * max(0.0, excess**2 - variance)
        return array(values - moved * excess), array(covariance + doubt)

    def _by_incidence(self, values: Array) -> Array:
        """Covariance for the drag by incidence, which no record tells from drag along and is no unknown: (n, n).

        As the row of the budget has it after the run (`influences`): a share of the drag at the highest speed, over the
        square of that. A deviation of it moves the estimate by P times the sum of x and its column (Schmidt 1966).
        """
        size = abs(float(values[0]) + float(values[1]) / max(self._fastest, LEAST_SPEED)) * INCIDENCE
        moved = size * (self._rls.unit_covariance @ np.array(self._along))
        return array(np.outer(moved, moved))

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
        n, blocks, usual = self._rls.n, len(self._blocks), len(self.model.names) + self._shapes
        if blocks < 2 * len(self.model.names):
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
        # That of one coefficient, from so few blocks, is off by a fifth; the color of the noise is that of all. Thrust
        # that goes later than it comes is known to less than the times of the commands are: its scatter is its own.
        deviation = np.sqrt(np.maximum(ratio, ratio[:usual].mean()))
        return np.outer(deviation, deviation)

    def _with_fixed_mass(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        """Parameters with the fixed mass as the last, (p,), and their covariance, (p, p)."""
        mass = self._fixed_mass
        whole = np.zeros((len(values) + 1,) * 2)
        whole[:-1, :-1] = covariance * mass * mass
        return np.append(values * mass, mass), whole
