"""Velocities that an estimator has smoothed: the time constant of its filter, and the record without it.

A filter of a second is no lag of the thrust: drag is not linear, so a fit that knows lags alone makes mass of it, six
times the true one, and of its residuals an inflow loss that is none. What a first-order filter did is undone exactly,
v = y + T y', at the price of noise. Which T is told by the fit of what is then left: its motion, smoothed again, is
nearer to the record than without any filter. A thrust lag leaves no such gain.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import fit_with_delays, search_delay
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import Record, Series

SUSPECT_LAG_S = 0.2
"""Fitted lag from which a filter is looked for: most thrusters have less."""
TRIED_S = (0.3, 0.45, 0.68, 1.0, 1.5, 2.3, 3.4)
"""Time constants that are tried, each 1.5 of the one before, for an error of one by a third is clearly seen."""
NEARER = 0.8
"""Error of the motion with a filter, in that without, up to which there is one: of nine records with one of 0.5 to 2 s
it was 0.13 to 0.77, of thrust that ramps 0.75 and more, of other records 0.95 and more."""
HINT = 0.95
"""The same up to which there is one where another axis has one: no more than what roll and pitch have without any."""
FAR = 1.5
"""Error from which longer filters are no longer tried."""
CLOSE, MOST_CLOSER = 0.03, 6
"""Share of the time constant to which the best is searched, and fits for it at most."""


class _Tried(NamedTuple):
    """A filter, the parameters (p,) without it, and the error of their motion once the filter has smoothed it again."""

    time_s: float
    theta: Array
    error: float


def with_smoothing(
    record: Record, fit: OutputErrorFit, model: Model, prior: Prior, sigma_s: float
) -> tuple[Record, OutputErrorFit]:
    """Undo the filter that has smoothed the velocities, where the record shows one.

    Parameters
    ----------
    record
        Of one axis, with the delays of the fit.
    fit
        Without any filter.
    model, prior
        Of the axis.
    sigma_s : [s]
        Prior standard deviation of lag and latency.

    Returns
    -------
    tuple[Record, OutputErrorFit]
        The record without its filter (`smoothing_s`) and its fit; both as they were where there is none. But for the
        doubt (`filter_doubt_s`) where the record has one, and without it the body could not be, and for the hint
        (`filter_hint_s`) of one that explains little.
    """
    if record.lag_s < SUSPECT_LAG_S or fit.problem.main != 0:
        return record, fit

    def tried(time_s: float, theta: Array) -> _Tried | None:
        """Rough fit without a filter of this time constant; None where no motion follows."""
        without = unsmoothed(record, time_s)
        try:
            delays = search_delay(model, without, theta, prior, sigma_s)
            late = replace(without, lag_s=delays.lag_s, latency_s=delays.latency_s)
            fitted = refine(model, late, delays.theta, prior, rough=True)
        except ValueError:
            return None
        return _Tried(time_s, fitted.theta, _error(record, fitted, time_s))

    none = _Tried(0.0, fit.theta, _error(record, fit, 0.0))
    all_tried = [none]
    for time_s in TRIED_S:
        one = tried(time_s, all_tried[-1].theta)
        if one is None or one.error > FAR * none.error:
            break
        all_tried.append(one)
    best = min(all_tried, key=lambda one: one.error)
    if best.error > NEARER * none.error:
        return (replace(record, filter_hint_s=best.time_s), fit) if best.error < HINT * none.error else (record, fit)
    at = all_tried.index(best)
    low, high = (math.log(all_tried[max(1, min(i, len(all_tried) - 1))].time_s) for i in (at - 1, at + 1))

    def error(logarithm: float) -> float:
        """Error of one more, which is kept; that of no filter where no motion follows."""
        one = tried(math.exp(logarithm), best.theta)
        all_tried.extend([one] if one else [])
        return one.error if one else none.error

    if low < high:
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  # slow, and only records of other stacks need it

        minimize_scalar(error, bounds=(low, high), method="bounded", options={"xatol": CLOSE, "maxiter": MOST_CLOSER})
    best = min(all_tried, key=lambda one: one.error)
    # Thrust that ramps looks like a filter, and without it moves a body that is too light, and before its command.
    # Where the velocities of other axes were smoothed as well, their forces act late, with the same signs. One axis
    # alone does not tell which.
    in_doubt = replace(record, filter_doubt_s=best.time_s), fit
    try:
        found, better = fit_with_delays(unsmoothed(record, best.time_s), best.theta, model, prior, sigma_s)
    except ValueError:
        return in_doubt
    nearer = _error(record, better, best.time_s) <= NEARER * none.error
    possible = better.theta[-1] >= model.rigid and found.latency_s >= 0.0
    return (found, better) if nearer and possible else in_doubt


def unsmoothed(record: Record, time_s: float) -> Record:
    """Record before a first-order filter of its velocities."""
    return replace(record, velocity=before_filter(record.velocity, time_s), smoothing_s=time_s)


def before_filter(samples: Series, time_s: float) -> Series:
    """Samples before a first-order filter, which hold their new value from one to the next."""
    t, y = samples.t, samples.y
    kept = np.exp(-np.maximum(np.diff(t), 1e-3) / time_s)
    return Series(t, array(np.concatenate([y[:1], (y[1:] - kept * y[:-1]) / (1.0 - kept)])))


def _error(record: Record, fit: OutputErrorFit, time_s: float) -> float:
    """Root mean square of the velocities of a record less those of a fit behind a filter [m/s, rad/s]."""
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
