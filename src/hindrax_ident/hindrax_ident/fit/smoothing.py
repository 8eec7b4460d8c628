"""Velocities that somebody has smoothed: by how much, and a fit that knows it.

A filter of a second is no lag of the thrust: drag is not linear, so a fit that knows lags alone makes mass of it, six
times the true one, and of its residuals an inflow loss that is none. Three kinds stand for all. What a first-order
filter did, as that of an estimator, is undone exactly, v = y + T y', at the price of noise. What a moving average
leaves, or a filter forward and backward, is computed from the motion of the fit (`mean_velocities`); with a latency it
is one of the past. Which kind and how long is told by the fit of what was before: its motion, smoothed again, is nearer
to the record than without any. A thrust lag leaves no such gain; thrust that ramps, or that goes by another lag than it
comes, looks like smoothing, and is looked for with it (`ramping_thrust`, `delay`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import EARLY_S, fit_with_delays, fit_with_uneven_lag, lags_differ, search_delay
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.fit.ramping_thrust import ramping
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import Record, Series

SUSPECT_LAG_S = 0.2
"""Fitted lag from which smoothing is looked for: most thrusters have less."""
NEARER = 0.8
"""Error of the motion with a filter, in that without, up to which there is one: of nine records with one of 0.5 to 2 s
it was 0.13 to 0.77, of thrust that ramps 0.75 and more, of other records 0.95 and more."""
HINT = 0.95
"""The same up to which there is one where another axis has one: no more than what roll and pitch have without any."""
MOST_LEFT = 0.5
"""Share of the motion that the fit without any may leave: where the thrust explains less, no smoothing of what it does
is seen. Of 13 smoothed and ramping records it left 0.007 to 0.09."""
FAR = 1.3
"""Error, in the least so far, from which longer ones are no longer tried."""
CLOSE, MOST_CLOSER = 0.03, 6
"""Share of the time constant to which the best is searched, and fits for it at most."""


def unsmoothed(record: Record, time_s: float) -> Record:
    """Record before a first-order filter of its velocities."""
    return replace(record, velocity=before_filter(record.velocity, time_s), smoothing_s=time_s)


def averaged(record: Record, time_s: float) -> Record:
    """Record whose velocities are means over time."""
    return replace(record, means=((1.0, time_s),))


def flattened(record: Record, time_s: float) -> Record:
    """Record whose velocities are what a flat passband leaves, forward and backward: a parabola stays one."""
    return replace(record, means=((4.0 / 3.0, time_s), (-1.0 / 3.0, 2.0 * time_s)))


def before_filter(samples: Series, time_s: float) -> Series:
    """Samples before a first-order filter, which hold their new value from one to the next."""
    t, y = samples.t, samples.y
    kept = np.exp(-np.maximum(np.diff(t), 1e-3) / time_s)
    return Series(t, array(np.concatenate([y[:1], (y[1:] - kept * y[:-1]) / (1.0 - kept)])))


def _behind_filter(record: Record, fit: OutputErrorFit, time_s: float) -> float:
    """Root mean square of the velocities of a record less those of a fit behind a first-order filter [m/s, rad/s]."""
    problem = fit.problem
    measured = np.flatnonzero(problem.channel == 0)
    t, v = problem.t[measured], fit.linear.path.v[problem.index[measured]]
    y = np.interp(t, record.velocity.t, record.velocity.y)
    if time_s > 0.0:
        begins = np.isin(measured, [span.start for span in problem.spans])
        kept = np.exp(-np.diff(t, prepend=t[:1]) / time_s)
        # As `unsmoothed` undoes it, step by step: a perfect motion has no error.
        out: list[float] = []
        for now, first, share, start in zip(v.tolist(), y.tolist(), kept.tolist(), begins, strict=True):
            out.append(first if start else now + (out[-1] - now) * share)
        v = np.array(out)
    return float(np.sqrt(np.mean((y - v) ** 2)))


def _as_means(_record: Record, fit: OutputErrorFit, _time_s: float) -> float:
    """The same of a fit whose predictions are means."""
    problem, path = fit.problem, fit.linear.path
    left = problem.y - problem.predicted(np.stack([path.v, path.s], axis=1))
    return float(np.sqrt(np.mean(left[problem.channel == 0] ** 2)))


class _Kind(NamedTuple):
    """A kind of smoothing: the record of what was before it, and the error [m/s, rad/s] of a fit of that one behind it.

    `spread`: its time, in time constants of the first-order filter that spreads as much (root of the second moment).
    """

    tried_s: tuple[float, ...]
    spread: float
    without: Callable[[Record, float], Record]
    error: Callable[[Record, OutputErrorFit, float], float]


FILTER = _Kind((0.3, 0.45, 0.68, 1.0, 1.5, 2.3, 3.4), 1.0, unsmoothed, _behind_filter)
MEAN = _Kind((0.4, 0.6, 0.9, 1.35, 2.0, 3.0), math.sqrt(12.0), averaged, _as_means)
FLAT = _Kind((0.4, 0.6, 0.9, 1.35, 2.0, 3.0), math.sqrt(12.0), flattened, _as_means)
"""Each time is 1.5 of the one before, for an error of one by a third is clearly seen."""
RAMP = _Kind((0.3, 0.5, 0.8, 1.2, 1.8), 1.0, ramping, _as_means)
"""No smoothing, but what looks like it: thrust that follows its command otherwise than by a lag."""


class _Tried(NamedTuple):
    """A smoothing, the parameters (p,) of what was before it, and the error of their motion behind it."""

    time_s: float
    theta: Array
    error: float


def with_smoothing(
    record: Record, fit: OutputErrorFit, model: Model, prior: Prior, sigma_s: float
) -> tuple[Record, OutputErrorFit]:
    """Let the fit know what has smoothed the velocities, where the record shows it.

    Parameters
    ----------
    record
        Of one axis, with the delays of the fit.
    fit
        Without any smoothing.
    model, prior
        Of the axis.
    sigma_s : [s]
        Prior standard deviation of lag and latency.

    Returns
    -------
    tuple[Record, OutputErrorFit]
        The record without its filter (`smoothing_s`), of means (`means`), or with thrust that is more than a lag
        (`later_s`, `ramps_s`), and its fit; both as they were where there is none. But for the doubt
        (`filter_doubt_s`) where the record has one, and without it the body could not be, and for the hint
        (`filter_hint_s`) of a filter that explains little.
    """
    suspect = record.lag_s >= SUSPECT_LAG_S or record.lag_s + record.latency_s < EARLY_S
    # Thrust that goes later than it comes is no smoothing either, but what looks like it.
    differ = fit.problem.main == 0 and lags_differ(record, fit, sigma_s)
    uneven = fit_with_uneven_lag(record, fit, prior, sigma_s) if differ else (record, fit)
    if not suspect or fit.problem.main != 0:
        return uneven
    search = _Search(record, fit, model, prior, sigma_s)
    none, measured = search.none, fit.problem.y[fit.problem.channel == 0]
    if none.error > MOST_LEFT * float(np.sqrt(np.mean(measured**2))):
        return uneven
    found = {kind: search.coarse(kind) for kind in (FILTER, MEAN, RAMP)}
    # What is nearly alike is far off as well.
    if search.best(found[MEAN]).error < HINT * none.error:
        found[FLAT] = search.coarse(FLAT)
    kind = min(found, key=lambda one: search.best(found[one]).error)
    best = search.best(found[kind])
    if differ and _as_means(*uneven, 0.0) < min(best.error, HINT * none.error):
        return uneven
    if best.error > NEARER * none.error:
        hint = search.best(found[FILTER])
        likely = hint.error < HINT * none.error
        return (replace(uneven[0], filter_hint_s=hint.time_s), uneven[1]) if likely else uneven
    best = search.fine(kind, found[kind])
    # What is no such thing may look like it, and without it moves a body that is too light, and before its command.
    # Where the velocities of other axes were smoothed as well, their forces act late, with the same signs. One axis
    # alone does not tell which.
    in_doubt = uneven if kind is RAMP else (replace(record, filter_doubt_s=best.time_s / kind.spread), fit)
    try:
        known, better = fit_with_delays(kind.without(record, best.time_s), best.theta, model, prior, sigma_s)
    except ValueError:
        return in_doubt
    # A mean hides what tells lag from latency: only both together may not be before the command.
    late_s, least_s = (known.latency_s, 0.0) if kind is FILTER else (known.lag_s + known.latency_s, EARLY_S)
    possible = better.theta[-1] >= model.rigid and late_s >= least_s
    nearer = kind.error(record, better, best.time_s) <= NEARER * none.error
    return (known, better) if nearer and possible else in_doubt


class _Search:
    """Rough fits of what was before smoothing of a kind, for several times."""

    def __init__(self, record: Record, fit: OutputErrorFit, model: Model, prior: Prior, sigma_s: float) -> None:
        self._record, self._model, self._prior, self._sigma_s = record, model, prior, sigma_s
        self.none = _Tried(0.0, fit.theta, _behind_filter(record, fit, 0.0))

    @staticmethod
    def best(tried: Sequence[_Tried]) -> _Tried:
        """The one that is nearest to the record."""
        return min(tried, key=lambda one: one.error)

    def coarse(self, kind: _Kind) -> list[_Tried]:
        """No smoothing, and then of one time after the other, as long as the motion is not far off."""
        tried = [self.none]
        for time_s in kind.tried_s:
            one = self._at(kind, time_s, tried[-1].theta)
            if one is None or one.error > FAR * self.best(tried).error:
                break
            tried.append(one)
            if kind is RAMP and self.best(tried) not in tried[-2:]:
                break
        return tried

    def fine(self, kind: _Kind, coarse: Sequence[_Tried]) -> _Tried:
        """The best between the neighbors of the best."""
        best, tried = self.best(coarse), list(coarse)
        at = tried.index(best)
        low, high = (math.log(tried[max(1, min(i, len(tried) - 1))].time_s) for i in (at - 1, at + 1))

        def error(logarithm: float) -> float:
            """Error of one more, which is kept; that of no smoothing where no motion follows."""
            one = self._at(kind, math.exp(logarithm), best.theta)
            tried.extend([one] if one else [])
            return one.error if one else self.none.error

        if low < high:
            from scipy.optimize import minimize_scalar  # noqa: PLC0415  # slow, and only records of other stacks need it

            ends = (low, high)
            minimize_scalar(error, bounds=ends, method="bounded", options={"xatol": CLOSE, "maxiter": MOST_CLOSER})
        return self.best(tried)

    def _at(self, kind: _Kind, time_s: float, theta: Array) -> _Tried | None:
        """Rough fit for one time; None where no motion follows."""
        without = kind.without(self._record, time_s)
        try:
            delays = search_delay(self._model, without, theta, self._prior, self._sigma_s)
            fitted = refine(self._model, delays.within(without), delays.theta, self._prior, rough=True)
        except ValueError:
            return None
        return _Tried(time_s, fitted.theta, kind.error(self._record, fitted, time_s))
