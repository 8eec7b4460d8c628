"""Joint estimation of thrust lag, latency of the stamps and coefficients, for records that give neither delay.

An unmodeled lag appears as mass: 0.2 s may double that of a small vehicle. Lag and latency differ only in the rounding
of the delayed signal, which an alternating search does not find: so both are unknowns of one fit. It begins with all
measurements and without whitening: samples rejected or explained as disturbance at a wrong lag would be just those
that reveal it. It ends with the whitening of the fit at the delays found: slow forces that nobody knows look like a
delay to a search that takes each residual for new.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.fit.output_error_problem import (
    LinearizedProblem,
    OutputErrorProblem,
    build_problem,
    linearize,
    mean_error,
    restarted,
)
from hindrax_ident.fit.scores import score
from hindrax_ident.fit.whitening import Whitener
from hindrax_ident.model.model_parameters import Prior, newton_step
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, Trajectory, per_step
from hindrax_ident.model.thrust_lag import ONE_LAG, LaggedThrust, SumOfThrusts
from hindrax_ident.records.axis_record import Record, Stretch

SMALL_S = 1e-4
LONGEST_DELAY_S = 1.0
STEPS, MOST_DAMPING = 25, 1e6
SETTLED_S, NEGLIGIBLE = 1e-3, 0.1
"""Largest change of the delays that have settled, and in their standard deviations: of an axis that barely moves
they may be anywhere, and go on changing."""
ROUNDS = 4
ROBUST = 3.0
"""Standard deviations beyond which residuals get less weight, but never zero: delayed thrust is among them, as are
glitches."""
STARTS = ((0.1, 0.0), (0.3, 0.0), (0.0, 0.2))
"""Initial lags and latencies of the search [s]."""
CLEAR, LEAST_LATER_S = 5.0, 0.04
"""Deviations from which lags differ, and by how much one of them does at least. Records of MuJoCo, whose thrust has one
lag, show up to 6 deviations of 0.03 s where forces of other axes look like it; 0.1 and 0.15 s show 7 and more."""
EARLY_S = -0.02
"""Time by which a motion comes before its command, from which something else than a lag was found."""
SEARCHED_S = 600.0
"""Time in stretches beyond which search and fit begin over a part of them."""


def lag_impulse(record: Record, grid: Grid) -> Array:
    """Change of the impulse over each step per second of lag: (n, 1) [N, N m]."""
    return per_step(_by_lag(record, grid, record.lagged())[:, None], grid.starts)


def latency_impulse(record: Record, grid: Grid) -> Array:
    """Change of the impulse over each step per second of latency: (n, 1) [N, N m]."""
    return per_step(_by_latency(record, grid, record.lagged())[:, None], grid.starts)


def later_impulses(record: Record, grid: Grid) -> Array:
    """Change of the impulse over each step per second of both of `Record.later_s`: (n, 2) [N, N m]."""
    thrust = record.lagged()
    return per_step(np.stack([by(record, grid, thrust) for by in (_by_goes, _by_turns)], axis=1), grid.starts)


def delay_impulses(record: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts, delays: int = 2) -> Array:
    """All columns at once, as a search of the delays needs them.

    Parameters
    ----------
    record
        With the delays.
    grid
        Of n steps.
    thrust
        Of the record, after its lag.
    delays
        How many.

    Returns
    -------
    Array
        (n, delays) [N, N m]: `lag_impulse`, `latency_impulse`, `later_impulses`.
    """
    columns = [by(record, grid, thrust) for by in (_by_lag, _by_latency, _by_goes, _by_turns)[:delays]]
    return per_step(np.stack(columns, axis=1), grid.starts)


def _by_lag(record: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts) -> Array:
    return _change(replace(record, lag_s=record.lag_s + SMALL_S), grid, thrust)


def _by_goes(record: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts) -> Array:
    goes_s, turns_s = record.later_s
    return _change(replace(record, later_s=(goes_s + SMALL_S, turns_s)), grid, thrust)


def _by_turns(record: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts) -> Array:
    goes_s, turns_s = record.later_s
    return _change(replace(record, later_s=(goes_s, turns_s + SMALL_S)), grid, thrust)


def _change(slower: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts) -> Array:
    times = grid.times_s - slower.latency_s
    return (slower.lagged().impulse(times) - thrust.impulse(times)) / SMALL_S


def _by_latency(record: Record, grid: Grid, thrust: LaggedThrust | SumOfThrusts) -> Array:
    return -thrust.force(grid.times_s - record.latency_s)


def prior_delays(record: Record) -> Array:
    """Prior lag and latency: (2,) [s]."""
    return np.array(record.prior_delays_s)


class DelayEstimate(NamedTuple):
    """Result of a search: mean absolute residual, parameters (p,), delays and their deviations (2,) or (4,) [s].

    Delays are lag and latency, perhaps with both of `Record.later_s`. The deviations are those of the
    weighted or whitened residuals and of the prior.
    """

    error: float
    theta: Array
    delays_s: Array
    sigmas_s: Array

    def within(self, record: Record) -> Record:
        """The record with these delays."""
        return _delayed(record, self.delays_s)


def _delayed(record: Record, delays_s: Array) -> Record:
    """The record with these delays, (2,) or (4,)."""
    lag_s, latency_s, *later_s = delays_s.tolist()
    return replace(record, lag_s=lag_s, latency_s=latency_s, later_s=tuple(later_s) or ONE_LAG)


def search_delay(model: Model, record: Record, start: Array, prior: Prior, sigma_s: float) -> DelayEstimate:
    """Find lag, latency and parameters together, by the best fit without whitening.

    Levenberg-Marquardt over p + 2 unknowns from several lags and latencies (STARTS): the residual has a basin for each.

    Parameters
    ----------
    model
        With p parameters.
    record
        Of one axis.
    start : (p,)
        Parameters to begin with.
    prior
        Of the parameters.
    sigma_s : [s]
        Prior standard deviation of both delays, about those of the record.

    Returns
    -------
    DelayEstimate
        Of the smallest mean absolute residual; an infinite one where every simulation diverged.
    """
    search = _Search(build_problem(model, record), record, prior, sigma_s)
    return min((search.run(start, np.array(begin)) for begin in STARTS), key=lambda found: found.error)


def _spread(stretches: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
    """All of a short record; of a long one evenly every so many stretches."""
    lasts_s = sum(one.end_s - one.start_s for one in stretches)
    return stretches[:: max(1, math.ceil(lasts_s / SEARCHED_S))]


class _Search:
    """Levenberg-Marquardt over parameters and delays; weighted by residuals, or by a `whitener`."""

    def __init__(
        self,
        problem: OutputErrorProblem,
        record: Record,
        prior: Prior,
        sigma_s: float,
        *,
        usual_s: Array | None = None,
        whitener: Whitener | None = None,
    ) -> None:
        """`sigma_s`: prior deviation of delays; `usual_s`: their values, (2,) or (4,), by default for the record."""
        self._problem, self._record, self._size = problem, record, len(prior.values)
        self._whitener = whitener
        self._known_impulse = record.known_impulse(problem.grid.times_s)
        usual_s = prior_delays(record) if usual_s is None else usual_s
        self._mean = np.concatenate([prior.values, usual_s])
        self._information = np.concatenate([1.0 / prior.sigmas**2, np.full(len(usual_s), 1.0 / sigma_s**2)])

    def run(self, theta: Array, delays: Array) -> DelayEstimate:
        """Search from there, or from the prior where the simulation diverges; infinite error where both do."""
        damping = 1e-2
        x, now = self._begin(theta, delays)
        weights = self._weights(now)
        now = now and self._at(x, now.path, weights)
        for _ in range(STEPS):
            if now is None or damping > MOST_DAMPING:
                break
            tried = self._step(now, x, damping)
            then = self._at(tried, restarted(self._problem, now, tried - x), weights)
            if then is None or self._cost(then, tried) >= self._cost(now, x):
                damping *= 10.0
                continue
            moved = float(np.abs(tried - x)[self._size :].max())
            x, damping, before, weights = tried, 0.1 * damping, weights, self._weights(then)
            now = then if weights is before else self._at(x, then.path, weights)
            if moved < SETTLED_S:
                break
        return DelayEstimate(self._error(now), x[: self._size], x[self._size :], self._sigmas_s(now))

    def _begin(self, theta: Array, delays: Array) -> tuple[Array, LinearizedProblem | None]:
        """Initial unknowns and the problem about them; None where the simulation diverges."""
        for one in (theta, self._mean[: self._size]):
            x = np.concatenate([one, delays])
            found = self._at(x, self._problem.guess, lambda table: table)
            if found is not None:
                break
        return x, found

    def _step(self, linear: LinearizedProblem, x: Array, damping: float) -> Array:
        """Unknowns after a damped step."""
        normal = linear.information + np.diag(self._information)
        gradient = linear.gradient + self._information * (self._mean - x)
        scale = np.sqrt(np.diag(normal))
        damped = normal / np.outer(scale, scale) + damping * np.eye(len(x))
        room = scale[self._mass] * (self._problem.model.least_mass - x[self._mass])
        return self._bounded(x + newton_step(damped, gradient / scale, float(room), self._mass) / scale)

    def _at(self, x: Array, path: Trajectory, weigh: Callable[[Array], Array]) -> LinearizedProblem | None:
        delays_s = x[self._size :]
        record, grid = _delayed(self._record, delays_s), self._problem.grid
        thrust = record.lagged()
        impulse = thrust.impulse(grid.times_s - record.latency_s) + self._known_impulse
        problem = replace(self._problem, grid=replace(grid, impulse=per_step(impulse, grid.starts)))
        columns = delay_impulses(record, grid, thrust, len(delays_s))
        return linearize(problem, x[: self._size], path, weigh, columns) if x[self._mass] > 0.0 else None

    @property
    def _mass(self) -> int:
        """Index of the total mass among the unknowns: the delays follow it."""
        return self._size - 1

    def _sigmas_s(self, linear: LinearizedProblem | None) -> Array:
        """Standard deviations of the delays, all other unknowns as uncertain as they are [s]."""
        if linear is None:
            return np.zeros(len(self._mean) - self._size)
        variances = np.diag(np.linalg.inv(linear.information + np.diag(self._information)))
        return array(np.sqrt(np.maximum(0.0, variances[self._size :])))

    def _bounded(self, x: Array) -> Array:
        """Unknowns with all delays within limits."""
        least_s = [0.0, *[-LONGEST_DELAY_S] * (len(x) - self._size - 1)]
        x[self._size :] = np.clip(x[self._size :], least_s, LONGEST_DELAY_S)
        return x

    def _weights(self, linear: LinearizedProblem | None) -> Callable[[Array], Array]:
        """Whitening, or robust weighting of measurements by their residuals."""
        if self._whitener is not None:
            return self._whitener
        if linear is None:
            return lambda table: table
        weights = np.ones(len(linear.raw))
        for own in (self._problem.channel == 0, self._problem.channel == 1):
            if own.any():
                usual = max(1e-9, float(np.percentile(np.abs(linear.raw[own]), 90.0)) / 1.645)
                far = np.maximum(1.0, np.abs(linear.raw[own]) / (ROBUST * usual))
                weights[own] = 1.0 / (usual * np.sqrt(far))
        return lambda table: table * weights[:, None]

    def _cost(self, linear: LinearizedProblem, x: Array) -> float:
        return linear.cost + float(self._information @ (x - self._mean) ** 2)

    def _error(self, linear: LinearizedProblem | None) -> float:
        """Mean absolute residual of the main channel; infinite where the simulation diverges."""
        return math.inf if linear is None else mean_error(self._problem, linear.raw)


def fit_with_delays(
    record: Record, start: Array, model: Model, prior: Prior, sigma_s: float
) -> tuple[Record, OutputErrorFit]:
    """Fit with lag and latency that agree with the whitened residuals and with their prior.

    Of a long record first over a part of it: delays, outliers and noise take many steps to find, and few to improve.

    Parameters
    ----------
    record
        Of one axis.
    start : (p,)
        Parameters to begin with.
    model, prior
        Of the axis.
    sigma_s : [s]
        Prior standard deviation of both delays.

    Returns
    -------
    tuple[Record, OutputErrorFit]
        The record with the delays found, and its fit.
    """
    few, usual_s = record.with_stretches(_spread(record.stretches)), prior_delays(record)
    first = search_delay(model, few, start, prior, sigma_s)
    few = first.within(few)
    found, fit = _settled(few, refine(model, few, first.theta, prior, rough=True), prior, sigma_s, usual_s)
    if found.stretches != record.stretches:
        whole = found.with_stretches(record.stretches)
        found, fit = _settled(whole, refine(model, whole, fit.theta, prior, fit), prior, sigma_s, usual_s)
    elif found is few:
        fit = refine(model, found, fit.theta, prior, fit)
    return found, fit


def _settled(
    record: Record, fit: OutputErrorFit, prior: Prior, sigma_s: float, usual_s: Array
) -> tuple[Record, OutputErrorFit]:
    """Record and fit after searches of the delays and fits in turn, until neither changes the other."""
    for _ in range(ROUNDS):
        before = np.array([record.lag_s, record.latency_s, *record.later_s][: len(usual_s)])
        search = _Search(fit.problem, record, prior, sigma_s, usual_s=usual_s, whitener=fit.whitener)
        found = search.run(fit.theta, before)
        if not math.isfinite(found.error):
            break
        moved_s = np.abs(found.delays_s - before)
        if np.all(moved_s < np.maximum(SETTLED_S, NEGLIGIBLE * found.sigmas_s)):
            break
        record = found.within(record)
        fit = refine(fit.model, record, found.theta, prior, fit)
    return record, fit


def lags_differ(record: Record, fit: OutputErrorFit, sigma_s: float) -> bool:
    """Whether thrust clearly goes, or turns round, by another lag than it comes (score test).

    Parameters
    ----------
    record
        Of one axis, with the lag and latency of the fit.
    fit
        With one lag.
    sigma_s : [s]
        Prior standard deviation of all delays.

    Returns
    -------
    bool
        By CLEAR deviations of both together, and LEAST_LATER_S of one.
    """
    shown = score(fit, delay_impulses(record, fit.problem.grid, record.lagged(), 4))
    covariance = np.linalg.inv(shown.information + np.eye(4) / sigma_s**2)
    later_s = (covariance @ shown.gradient)[2:]
    clear = float(later_s @ np.linalg.solve(covariance[2:, 2:], later_s)) > CLEAR**2
    return clear and float(np.abs(later_s).max()) > LEAST_LATER_S


def fit_with_uneven_lag(
    record: Record, fit: OutputErrorFit, prior: Prior, sigma_s: float
) -> tuple[Record, OutputErrorFit]:
    """Fit as well by how much the lags of thrust that goes, and turns round, are longer than that of what comes.

    Parameters
    ----------
    record
        Of one axis, with the lag and latency of the fit.
    fit
        With one lag.
    prior
        Of the parameters.
    sigma_s : [s]
        Prior standard deviation of all delays.

    Returns
    -------
    tuple[Record, OutputErrorFit]
        The record with the delays found, and its fit; both as they were where no body has those.
    """
    found, better = _settled(record, fit, prior, sigma_s, np.append(prior_delays(record), ONE_LAG))
    possible = better.theta[-1] >= fit.model.rigid and found.lag_s + found.latency_s >= EARLY_S
    return (found, better) if possible else (record, fit)
