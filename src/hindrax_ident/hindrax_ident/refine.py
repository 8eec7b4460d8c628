"""Output error: the parameters whose simulated motion lies closest to the measured one (Ljung 1999, section 4.3).

Gauss-Newton with a damped step, started from the recursive estimate; what unknown forces do to the motion is whitened
by a Kalman filter whose noise is estimated too. The estimate reaches the Cramer-Rao bound. Its covariance is checked
against the color that is left and against the scatter between blocks of the record: where that is larger than chance
allows, the model is not the whole truth, and the scatter is what is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.stats import chi2

from hindrax_ident.arrays import Array, array
from hindrax_ident.belief import Belief
from hindrax_ident.likelihood import fit_noise
from hindrax_ident.models import Model
from hindrax_ident.noise import color_backward, effective_samples, fit_autoregression
from hindrax_ident.problem import Linear, Problem, chain_of, linearize, pose, restarted, whitener_of
from hindrax_ident.record import Record
from hindrax_ident.simulate import Trajectory
from hindrax_ident.whitening import Noise, Whitener

STEPS = 40
TOLERANCE = 1e-10
ROUGH = 1e-4
"""Steps, in standard deviations per sample to the power of a half, at which a search ends: the last, and those before
outliers and noise are known."""
NEGLIGIBLE = 1e-3
"""Step, in standard deviations, that may be left when rounding keeps the cost from falling any further."""
TRIMMINGS = 2
REWEIGHTINGS = 3
ALIKE = 0.2
"""Change of the noise, in natural logarithms, below which it is taken as found."""
OUTLIER_SIGMAS = 5.0
ATTITUDE_SIGMA_rad = 0.01
"""Weight of a measured angle. Its error is slow, and partly that of the rate, of which it is the integral: so it only
keeps the angle from drifting away."""
BLOCK_S = 15.0
CHANGE_S = 0.5
CHANCE = 0.999


@dataclass(frozen=True, slots=True)
class Fit:
    """Parameters in the model's order, their covariance, and what the record says about both.

    `effective_samples` are those that the plain residuals leave for their color; the covariance has them whitened.

    `inflation` (p,) is by how much the scatter between blocks widened the standard deviations (1: not at all);
    `sigmas` are the standard deviations of the velocity and position residuals.
    """

    model: Model
    theta: Array
    covariance: Array
    samples: int
    effective_samples: float
    sigmas: tuple[float, float]
    inflation: Array
    problem: Problem
    linear: Linear
    noise: Noise
    whitener: Whitener
    converged: bool


def refine(model: Model, record: Record, start: Array, belief: Belief) -> Fit:
    """Fit a record; ValueError when it holds too few samples.

    Deterministic: equal records give equal results, wherever the search starts within the basin of the solution.
    """
    problem = pose(model, record)
    noise = _first_noise(problem)
    white = whitener_of(problem, belief.values, problem.guess, noise)
    linear, theta, _ = _descend(problem, start, problem.guess, white, belief, tolerance=ROUGH)
    # Outliers first: what they have done to the motion would be taken for unknown forces.
    for _ in range(TRIMMINGS):
        problem = _without_outliers(problem, linear)
        white = whitener_of(problem, theta, linear.path, noise)
        linear, theta, _ = _descend(problem, theta, linear.path, white, belief, tolerance=ROUGH)
    for _ in range(REWEIGHTINGS):
        chain = chain_of(problem, theta, linear.path)
        fresh = fit_noise(chain, linear.raw, noise, given_position=model.restores)
        settled, noise = _alike(fresh, noise), fresh
        white = Whitener(chain, noise)
        linear, theta, converged = _descend(problem, theta, linear.path, white, belief)
        if settled:
            break
    return _concluded(problem, linear, theta, white, belief, converged=converged)


def reweighted(fit: Fit, noise: Noise, belief: Belief) -> Fit:
    """Fit the same measurements again, weighed by another noise."""
    problem = fit.problem
    white = whitener_of(problem, fit.theta, fit.linear.path, noise)
    linear, theta, converged = _descend(problem, fit.theta, fit.linear.path, white, belief)
    return _concluded(problem, linear, theta, white, belief, converged=converged)


def retrained(fit: Fit, record: Record, belief: Belief) -> tuple[Array, tuple[float, float]]:
    """Parameters of another record, weighed as this fit, and the standard deviations of its residuals."""
    problem = pose(fit.model, record)
    theta, path = fit.theta, problem.guess
    for _ in range(TRIMMINGS):
        white = whitener_of(problem, theta, path, fit.noise)
        linear, theta, _ = _descend(problem, theta, path, white, belief, tolerance=ROUGH)
        kept, problem, path = problem.samples, _without_outliers(problem, linear), linear.path
        if problem.samples == kept:
            break
    return theta, (_spread(_raw(problem, linear, 0)), _spread(_raw(problem, linear, 1)))


def _first_noise(problem: Problem) -> Noise:
    """Before the first fit: white noise of the size of the sample-to-sample changes."""
    variances = []
    for channel in (0, 1):
        changes = [np.diff(problem.y[span][problem.channel[span] == channel], n=2) for span in problem.spans]
        joined = np.concatenate(changes)
        variances.append(max(1e-12, float(np.mean(joined**2) / 6.0)) if len(joined) else 1.0)
    return Noise(variances[0], ATTITUDE_SIGMA_rad**2 if problem.model.restores else variances[1])


def _alike(a: Noise, b: Noise) -> bool:
    least = 1e-12
    pairs = ((getattr(a, one.name) + least, getattr(b, one.name) + least) for one in fields(Noise))
    return all(abs(math.log(x / y)) < ALIKE for x, y in pairs)


def _descend(
    problem: Problem, start: Array, path: Trajectory, white: Whitener, belief: Belief, *, tolerance: float = TOLERANCE
) -> tuple[Linear, Array, bool]:
    """Gauss-Newton with Levenberg's damping until a step no longer matters; parameters are scaled by their sigma."""
    theta, linear = _somewhere(problem, start, path, white, belief)
    damping = 1e-3
    for _ in range(STEPS):
        information = linear.information + belief.information
        gradient = linear.gradient + belief.information @ (belief.values - theta)
        scale = array(np.sqrt(np.diag(information)))
        normal = array(information / np.outer(scale, scale))
        wanted = float(np.abs(np.linalg.solve(normal, gradient / scale)).max())
        step = np.linalg.solve(normal + damping * np.eye(len(theta)), gradient / scale) / scale
        if float(np.abs(step * scale).max()) < tolerance * math.sqrt(1.0 + problem.samples):
            return linear, theta, True
        tried = linearize(problem, theta + step, restarted(problem, linear, step), white)
        if tried is not None and _total(tried, theta + step, belief) < _total(linear, theta, belief):
            theta, linear, damping = theta + step, tried, damping * 0.02
        elif wanted < NEGLIGIBLE or damping > 1e8:
            return linear, theta, wanted < NEGLIGIBLE
        else:
            damping = max(1e-6, damping) * 10.0
    return linear, theta, False


def _total(linear: Linear, theta: Array, belief: Belief) -> float:
    return linear.cost + float(np.sum(((theta - belief.values) / belief.sigmas) ** 2))


def _somewhere(
    problem: Problem, start: Array, path: Trajectory, white: Whitener, belief: Belief
) -> tuple[Array, Linear]:
    """Return the start, or the belief where the start makes no motion; its initial conditions fitted."""
    for theta in (start, belief.values):
        linear = linearize(problem, theta, path, white) if np.all(np.isfinite(theta)) else None
        if linear is not None:
            again = linearize(problem, theta, restarted(problem, linear, np.zeros(len(theta))), white)
            return theta, again or linear
    raise ValueError("neither the start nor the belief makes a motion")


def _raw(problem: Problem, linear: Linear, channel: int) -> Array:
    """Plain residuals of a channel, outliers left out."""
    return array(linear.raw[(problem.channel == channel) & problem.counts])


def _without_outliers(problem: Problem, linear: Linear) -> Problem:
    """Leave out what lies further from the model than noise reaches."""
    counts = np.ones(len(problem.t), bool)
    for channel in (0, 1):
        own = problem.channel == channel
        counts &= ~own | (np.abs(linear.raw) <= OUTLIER_SIGMAS * _usual(linear.raw[own]))
    return replace(problem, counts=counts)


def _usual(raw: Array) -> float:
    """Standard deviation by the 90th percentile: the median of rounded velocities may be far too small."""
    return float(np.percentile(np.abs(raw), 90.0)) / 1.645 if len(raw) else math.inf


def _concluded(
    problem: Problem, linear: Linear, theta: Array, white: Whitener, belief: Belief, *, converged: bool
) -> Fit:
    inverse = array(np.linalg.inv(linear.information + belief.information))
    freedom = max(1, problem.samples - problem.nuisances - len(theta))
    plain = array(inverse * (linear.cost / freedom))
    covariance = _with_color(problem, linear, belief, inverse, plain)
    inflation = _inflation(linear, problem, inverse, covariance)
    return Fit(
        model=problem.model,
        theta=theta,
        covariance=covariance * np.outer(inflation, inflation),
        samples=problem.samples,
        effective_samples=_effective_samples(problem, linear),
        sigmas=(_spread(_raw(problem, linear, 0)), _spread(_raw(problem, linear, 1))),
        inflation=inflation,
        problem=problem,
        linear=linear,
        noise=white.noise,
        whitener=white,
        converged=converged,
    )


def _effective_samples(problem: Problem, linear: Linear) -> float:
    """Independent velocities that the residuals are worth; those of positions are errors of velocity, summed up."""
    own = (problem.channel == problem.main) & problem.counts
    pieces = [linear.raw[span][own[span]] for span in problem.spans]
    if problem.main == 0:
        return effective_samples(pieces)
    times = [problem.t[span][own[span]] for span in problem.spans]
    return effective_samples([_changes(t, r) for t, r in zip(times, pieces, strict=True) if len(t)])


def _changes(t: Array, r: Array) -> Array:
    """Changes of a residual over spans of CHANGE_S."""
    return array(np.diff(r[np.unique(np.searchsorted(t, np.arange(t[0], t[-1], CHANGE_S)))]))


def _spread(raw: Array) -> float:
    return float(np.sqrt(np.mean(raw**2))) if len(raw) else math.nan


def _with_color(problem: Problem, linear: Linear, belief: Belief, inverse: Array, plain: Array) -> Array:
    """Covariance for the color that is left in the residuals: H^-1 (J' Omega J + B) H^-1; `plain` where they are white.

    B is the information of the belief: it has an error too.
    """
    middle, colored = belief.information, False
    for channel in (0, 1):
        rows = [np.flatnonzero(problem.channel[span] == channel) + span.start for span in problem.spans]
        pieces = [linear.r[own] for own in rows]
        color = fit_autoregression(pieces)
        colored = colored or len(color) > 0
        size = _innovation_variance(pieces, color)
        for own in rows:
            moved = color_backward(color, linear.J[own])
            middle += moved.T @ moved * size
    return array(inverse @ middle @ inverse) if colored else plain


def _innovation_variance(pieces: list[Array], color: Array) -> float:
    """Variance of what an autoregression leaves of residuals."""
    errors = [_unpredicted(piece, color) for piece in pieces if len(piece) > len(color)]
    joined = np.concatenate(errors) if errors else np.zeros(0)
    return float(np.mean(joined**2)) if len(joined) else 0.0


def _unpredicted(piece: Array, color: Array) -> Array:
    n, order = len(piece) - len(color), len(color)
    terms = (a * piece[order - k : order - k + n] for k, a in enumerate(color, 1))
    return array(piece[order:] - sum(terms, np.zeros(n)))


def _inflation(linear: Linear, problem: Problem, inverse: Array, covariance: Array) -> Array:
    """Ratio of the scatter between blocks to the covariance, where it exceeds what chance allows: (p,)."""
    gradients, informations = _blocks(linear, problem)
    blocks = len(gradients)
    if blocks < 4:
        return np.ones(len(inverse))
    scatter = np.sum((gradients @ inverse) ** 2, axis=0) * blocks / (blocks - 1)
    ratio = scatter / np.diag(covariance)
    # Blocks that say little about a parameter do not count as degrees of freedom of its scatter.
    shares = np.array([np.diag(inverse @ information @ inverse) for information in informations])
    freedom = np.maximum(1.0, shares.sum(axis=0) ** 2 / np.sum(shares**2, axis=0) - 1.0)
    limit = array(chi2.ppf(CHANCE, freedom)) / freedom
    return array(np.where(ratio > limit, np.sqrt(ratio), 1.0))


def _blocks(linear: Linear, problem: Problem) -> tuple[Array, list[Array]]:
    """Gradient of the cost and information of each block of about BLOCK_S seconds: (blocks, p), (p, p) each."""
    gradients, informations = [], []
    for span in problem.spans:
        times, J, r = problem.t[span], linear.J[span], linear.r[span]
        length = float(times[-1] - times[0])
        count = max(1, round(length / BLOCK_S))
        block = np.minimum(count - 1, ((times - times[0]) / max(length, 1e-9) * count).astype(int))
        gradients += [J[block == one].T @ r[block == one] for one in range(count)]
        informations += [array(J[block == one].T @ J[block == one]) for one in range(count)]
    return np.array(gradients), informations
