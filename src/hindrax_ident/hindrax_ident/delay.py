"""Records that tell neither the lag of the thrust nor that of the stamps: both are sought beside the coefficients.

A lag that nobody allows for comes out as mass: 0.2 s of it may double that of a small vehicle. Its two kinds are told
apart by the rounding of what is delayed, which a search from one to the other does not find: so both are unknowns of
one fit, at first with every measurement counted and none whitened. What is thrown out or taken for gusts while the
lag is wrong is just what would have told it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.belief import Belief
from hindrax_ident.lag import LaggedThrust
from hindrax_ident.models import Model
from hindrax_ident.problem import Linear, Problem, linearize, pose, restarted
from hindrax_ident.record import Record
from hindrax_ident.refine import Fit, refine
from hindrax_ident.score import score
from hindrax_ident.simulate import Grid, Trajectory

SMALL_S = 1e-4
LONGEST_S = 1.0
STEPS = 25
SETTLED_S = 1e-3
ROUNDS = 4
ROBUST = 3.0
"""Residuals beyond this many standard deviations weigh less, but never nothing: glitches are among them, and thrust
that comes late."""
USUAL_LAG_S = 0.15
"""Lag of the thrust of small vehicles, where no vehicle file says it."""
USUAL_LATENCY_S = 0.05
"""Latency of velocities that a filter or a camera gives, where nobody says it."""
STARTS = ((0.1, 0.0), (0.3, 0.0), (0.0, 0.2))
"""Lags and latencies from which the search begins [s]."""


def per_step(totals: Array, grid: Grid) -> Array:
    """Impulses over each step from impulses up to each time: (n, m); none at the start of a stretch."""
    steps = np.diff(totals, axis=0, prepend=0.0)
    steps[grid.starts] = 0.0
    return array(steps)


def by_lag(record: Record, grid: Grid) -> Array:
    """Impulse over each step that another second of lag would bring: (n, 1)."""
    times = grid.times_s - record.late_s
    slower = LaggedThrust(record.thrust.t, record.thrust.y, record.lag_s + SMALL_S).impulse(times)
    as_is = LaggedThrust(record.thrust.t, record.thrust.y, record.lag_s).impulse(times)
    return per_step(((slower - as_is) / SMALL_S)[:, None], grid)


def by_latency(record: Record, grid: Grid) -> Array:
    """Impulse over each step that another second of latency would bring: (n, 1)."""
    thrust = LaggedThrust(record.thrust.t, record.thrust.y, record.lag_s).force(grid.times_s - record.late_s)
    return per_step(-thrust[:, None], grid)


def impulses(record: Record, grid: Grid) -> Array:
    """Both beside each other: (n, 2)."""
    return array(np.hstack([by_lag(record, grid), by_latency(record, grid)]))


def believed(record: Record) -> Array:
    """Lag and latency before the record was looked at: (2,) [s]."""
    return np.array([record.lag_s or USUAL_LAG_S, record.late_s or USUAL_LATENCY_S])


class Found(NamedTuple):
    """Where a search has ended: mean size of the residuals, lag and latency [s], parameters (p,)."""

    error: float
    lag_s: float
    late_s: float
    theta: Array


def sought(model: Model, record: Record, start: Array, belief: Belief, doubt_s: float) -> Found:
    """Lag and latency of the best plain fit, believed to within `doubt_s`, and its parameters."""
    search = _Search(pose(model, record), record, belief, doubt_s)
    return min((search.run(start, np.array(begin)) for begin in STARTS), key=lambda found: found.error)


class _Search:
    """Gauss-Newton with Levenberg's damping over parameters, lag and latency."""

    def __init__(self, problem: Problem, record: Record, belief: Belief, doubt_s: float) -> None:
        self._problem, self._record, self._size = problem, record, len(belief.values)
        self._mean = np.concatenate([belief.values, believed(record)])
        self._information = np.concatenate([1.0 / belief.sigmas**2, np.full(2, 1.0 / doubt_s**2)])

    def run(self, theta: Array, delays: Array) -> Found:
        """Search from there, or from the belief where nothing moves so; the error is infinite where nothing does."""
        path, damping = self._problem.guess, 1e-2
        x, now = self._begin(theta, delays)
        weights = self._weights(now)
        for _ in range(STEPS):
            now = self._at(x, path, weights)
            if now is None or damping > 1e6:
                break
            tried = self._step(now, x, damping)
            then = self._at(tried, restarted(self._problem, now, tried - x), weights)
            if then is None or self._cost(then, tried) >= self._cost(now, x):
                damping *= 10.0
                continue
            moved = float(np.abs(tried - x)[self._size :].max())
            x, path, damping, weights = tried, then.path, 0.1 * damping, self._weights(then)
            if moved < SETTLED_S:
                break
        return Found(self._error(now), float(x[-2]), float(x[-1]), array(x[: self._size]))

    def _begin(self, theta: Array, delays: Array) -> tuple[Array, Linear | None]:
        for one in (theta, self._mean[: self._size]):
            x = np.concatenate([one, delays])
            found = self._at(x, self._problem.guess, lambda table: table) if np.all(np.isfinite(x)) else None
            if found is not None:
                break
        return x, found

    def _step(self, linear: Linear, x: Array, damping: float) -> Array:
        normal = linear.information + np.diag(self._information)
        gradient = linear.gradient + self._information * (self._mean - x)
        scale = np.sqrt(np.diag(normal))
        damped = normal / np.outer(scale, scale) + damping * np.eye(len(x))
        return self._bounded(x + np.linalg.solve(damped, gradient / scale) / scale)

    def _at(self, x: Array, path: Trajectory, weigh: Callable[[Array], Array]) -> Linear | None:
        record = replace(self._record, lag_s=float(x[-2]), late_s=float(x[-1]))
        grid = self._problem.grid
        moved = Grid(grid.times_s, grid.starts, per_step(record.impulse(grid.times_s)[:, None], grid)[:, 0])
        problem = replace(self._problem, grid=moved)
        return linearize(problem, x[: self._size], path, weigh, impulses(record, grid)) if x[-3] > 0.0 else None

    def _bounded(self, x: Array) -> Array:
        x[-2:] = np.clip(x[-2:], [0.0, -LONGEST_S], LONGEST_S)
        return x

    def _weights(self, linear: Linear | None) -> Callable[[Array], Array]:
        """Weight of each measurement by its residual."""
        if linear is None:
            return lambda table: table
        weights = np.ones(len(linear.raw))
        for channel in (0, 1):
            own = self._problem.channel == channel
            if own.any():
                usual = max(1e-9, float(np.percentile(np.abs(linear.raw[own]), 90.0)) / 1.645)
                far = np.maximum(1.0, np.abs(linear.raw[own]) / (ROBUST * usual))
                weights[own] = 1.0 / (usual * np.sqrt(far))
        return lambda table: array(table * weights[:, None])

    def _cost(self, linear: Linear, x: Array) -> float:
        return linear.cost + float(self._information @ (x - self._mean) ** 2)

    def _error(self, linear: Linear | None) -> float:
        """Mean size of the residuals, large ones counted by their size: comparable between searches."""
        own = self._problem.channel == self._problem.main
        return float(np.mean(np.abs(linear.raw[own]))) if linear is not None else np.inf


def settled(record: Record, start: Array, model: Model, belief: Belief, doubt_s: float) -> tuple[Record, Fit]:
    """Record and fit once lag and latency agree with the whitened residuals, and with what is believed of them."""
    told, prior = believed(record), np.eye(2) / doubt_s**2
    first = sought(model, record, start, belief, doubt_s)
    record = replace(record, lag_s=first.lag_s, late_s=first.late_s)
    fit = refine(model, record, first.theta, belief)
    for _ in range(ROUNDS):
        found = score(fit, impulses(record, fit.problem.grid))
        before = np.array([record.lag_s, record.late_s])
        known = found.information
        after = np.linalg.solve(known + prior, known @ (before + found.values) + prior @ told)
        after = np.clip(after, [0.0, -LONGEST_S], LONGEST_S)
        if float(np.abs(after - before).max()) < SETTLED_S:
            break
        record = replace(record, lag_s=float(after[0]), late_s=float(after[1]))
        fit = refine(fit.model, record, fit.theta, belief)
    return record, fit


def by_delays(record: Record, fit: Fit, doubt_s: float) -> Array:
    """Covariance that lag and latency add, as far as neither residuals nor belief tell them: (p, p)."""
    found = score(fit, impulses(record, fit.problem.grid))
    open_s2 = np.linalg.inv(found.information + np.eye(2) / doubt_s**2)
    return array(found.shifts @ open_s2 @ found.shifts.T)
