"""Output error: the parameters whose simulated motion lies closest to the measured one (Ljung 1999, section 4.3).

Gauss-Newton with a damped step, started from the recursive estimate; disturbances are whitened by a Kalman filter
with estimated noise. The estimate reaches the Cramer-Rao bound. Its covariance is checked against the remaining color
and against the scatter between blocks of the record: where the scatter is significantly larger, the model is
incomplete, and the scatter is reported.

Symbols. theta (p,) parameters; r (n,) whitened residuals, measured minus simulated, and J (n, p) the derivatives of
the simulation (`LinearizedProblem`; initial conditions fitted, so they are in neither); prior with mean theta_0 and
information B (p, p), diagonal. Minimized is

    r.r + (theta - theta_0)' B (theta - theta_0)

with the normal matrix H = J'J + B and, downhill, half the gradient J'r + B (theta_0 - theta). Three things depend on
each other: which samples are outliers, how large the noise is, and theta. `refine` finds them in this order, roughly at
first: an outlier left in would be taken for noise of all samples, and noise for motion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.autoregression import color_backward, effective_samples, fit_autoregression
from hindrax_ident.fit.noise_likelihood import fit_noise
from hindrax_ident.fit.output_error_problem import (
    LinearizedProblem,
    OutputErrorProblem,
    build_problem,
    error_dynamics_of,
    linearize,
    restarted,
    whitener_of,
)
from hindrax_ident.fit.scatter import BLOCK_S, scatter_inflation
from hindrax_ident.fit.whitening import Noise, Whitener
from hindrax_ident.model.model_parameters import Prior, newton_step
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, Trajectory, trajectory
from hindrax_ident.records.axis_record import Record

STEPS, MANY_STEPS = 40, 200
"""Of a search, and of one that goes on with refined derivatives: it creeps where a valley is bent."""
TOLERANCE = 1e-10
REFINEMENTS = 3
ROUGH_STEP = 1e-4
"""Step, in standard deviations per square root of the samples, that ends a search before outliers and noise are known;
TOLERANCE is that of the final search."""
NEGLIGIBLE, LEFT = 1e-3, 0.25
"""Largest final steps, in standard deviations: where rounding keeps the cost from decreasing, of steps that are damped
or not; and of a search that has converged, whatever ended it: the last of STEPS, or no step that decreases the cost,
because the sensitivities of a fast motion and the fit of the initial conditions are not exact. A band has many such
steps. A cost that decreases by the square of NEGLIGIBLE was that near to its least."""
OUTLIER_ROUNDS = 2
REWEIGHTINGS = 3
SIMILAR = 0.2
"""Change of the noise, in natural logarithms, below which it has converged."""
OUTLIER_SIGMAS = 5.0
ATTITUDE_SIGMA_rad = 0.01
"""Standard deviation assigned to a measured angle. Its error is slow, and partly that of the rate, whose integral it
is: so it only prevents drift of the angle."""


@dataclass(frozen=True, slots=True)
class OutputErrorFit:
    """Parameters, (p,), in the model's order and units, their covariance, (p, p), and the fit behind them.

    `effective_samples`: equivalent independent samples of the velocity, after whitening.

    `inflation` (p,): factor by which the scatter between blocks widened the standard deviations (1: not at all);
    `sigmas`: standard deviations of the velocity and position residuals; `prior_information` (p, p) of the parameters.
    """

    model: Model
    theta: Array
    covariance: Array
    samples: int
    effective_samples: float
    sigmas: tuple[float, float]
    inflation: Array
    problem: OutputErrorProblem
    linear: LinearizedProblem
    noise: Noise
    whitener: Whitener
    converged: bool
    prior_information: Array


def refine(
    model: Model,
    record: Record,
    start: Array,
    prior: Prior,
    like: OutputErrorFit | None = None,
    *,
    rough: bool = False,
) -> OutputErrorFit:
    """Fit a record: outliers, noise and parameters in turn, see the head of this module.

    Deterministic: equal records give equal results, from any start within the basin of the solution.

    Parameters
    ----------
    model
        Of one axis.
    record
        Thrust, known forces, velocities and positions of that axis.
    start : (p,)
        Parameters to begin with, such as the recursive estimate.
    prior
        Values and deviations (p,).
    like
        A fit of nearly the same, such as with other delays or over a part of the record: the search begins with its
        noise, and not with the prior as well.
    rough
        Whether the search may end where the noise is known, and the parameters nearly.

    Returns
    -------
    OutputErrorFit
        Parameters with covariance, and what later assessments need. `converged` says whether the search ended well.

    Raises
    ------
    ValueError
        When the record has too few samples, or the simulation diverges from both start and prior.
    """
    problem = build_problem(model, record)
    if like:
        noise = like.noise
        white = whitener_of(problem, start, problem.guess, noise)
        theta, linear = _feasible_start(problem, start, problem.guess, white, prior)
    else:
        noise = _first_noise(problem)
        white = whitener_of(problem, prior.values, problem.guess, noise)
        linear, theta = _best_of((start, prior.values), problem, white, prior)
    # Outliers first: their effect on the motion would be attributed to unknown forces.
    for _ in range(OUTLIER_ROUNDS):
        problem = _without_outliers(problem, linear)
        white = whitener_of(problem, theta, linear.path, noise)
        linear, theta, _ = _descend(problem, theta, linear.path, white, prior, tolerance=ROUGH_STEP)
    for _ in range(REWEIGHTINGS):
        chain = error_dynamics_of(problem, theta, linear.path)
        # The noise of the last round is where the next search begins, so rounds agree after a few.
        fresh = fit_noise(chain, linear.raw, noise, given_position=model.restores)
        settled, noise = _similar(fresh, noise), fresh
        white = Whitener(chain, noise)
        if rough:
            linear, theta, converged = _descend(problem, theta, linear.path, white, prior, tolerance=ROUGH_STEP)
        else:
            linear, theta, converged = _searched(problem, theta, linear.path, white, prior)
        if settled:
            break
    return _fit_of(problem, linear, theta, white, prior, converged=converged)


def reweighted(fit: OutputErrorFit, noise: Noise, prior: Prior) -> OutputErrorFit:
    """Fit the same measurements again with another noise.

    Parameters
    ----------
    fit
        What is fitted again, from its own solution on and without its outliers.
    noise
        Of the whitening.
    prior
        Values and deviations (p,).

    Returns
    -------
    OutputErrorFit
        As of `refine`.
    """
    problem = fit.problem
    white = whitener_of(problem, fit.theta, fit.linear.path, noise)
    linear, theta, converged = _searched(problem, fit.theta, fit.linear.path, white, prior)
    return _fit_of(problem, linear, theta, white, prior, converged=converged)


def retrained(fit: OutputErrorFit, record: Record, prior: Prior) -> tuple[Array, Array, tuple[float, float]]:
    """Parameters of another record with the noise of this one, for the validation by a part held out.

    Parameters
    ----------
    fit
        Of the whole record: its noise, and where the search begins.
    record
        A part of it.
    prior
        Values and deviations (p,).

    Returns
    -------
    tuple[Array, Array, tuple[float, float]]
        Parameters (p,), covariance (p, p), and root mean squares of the residuals of velocity and position.
    """
    problem = build_problem(fit.model, record)
    theta, path = fit.theta, problem.guess
    for _ in range(OUTLIER_ROUNDS):
        white = whitener_of(problem, theta, path, fit.noise)
        linear, theta, _ = _descend(problem, theta, path, white, prior, tolerance=ROUGH_STEP)
        kept, problem, path = problem.samples, _without_outliers(problem, linear), linear.path
        if problem.samples == kept:
            break
    return theta, array(np.linalg.inv(linear.information + prior.information)), _deviations(problem, linear)


def _first_noise(problem: OutputErrorProblem) -> Noise:
    """Noise before the first fit: white, with the variance of the sample-to-sample changes.

    Of second differences, in which a motion hardly shows: y_k+1 - 2 y_k + y_k-1 has 1 + 4 + 1 times the variance.
    """
    variances = []
    for channel in (0, 1):
        changes = [np.diff(problem.y[span][problem.channel[span] == channel], n=2) for span in problem.spans]
        # Within stretches only: a gap between two is no change of the motion.
        joined = np.concatenate(changes)
        variances.append(max(1e-12, float(np.mean(joined**2) / 6.0)) if len(joined) else 1.0)
    return Noise(variances[0], ATTITUDE_SIGMA_rad**2 if problem.model.restores else variances[1])


def _similar(a: Noise, b: Noise) -> bool:
    least = 1e-12
    pairs = ((getattr(a, one.name) + least, getattr(b, one.name) + least) for one in fields(Noise))
    return all(abs(math.log(x / y)) < SIMILAR for x, y in pairs)


def _searched(
    problem: OutputErrorProblem, start: Array, path: Trajectory, white: Whitener, prior: Prior
) -> tuple[LinearizedProblem, Array, bool]:
    """As `_descend`; where that ends on the way, on with refined derivatives: those of a fast motion lead aside."""
    linear, theta, ended = _descend(problem, start, path, white, prior)
    if ended:
        return linear, theta, ended
    return _descend(problem, theta, linear.path, white, prior, refinements=REFINEMENTS)


def _descend(
    problem: OutputErrorProblem,
    start: Array,
    path: Trajectory,
    white: Whitener,
    prior: Prior,
    *,
    tolerance: float = TOLERANCE,
    refinements: int = 0,
) -> tuple[LinearizedProblem, Array, bool]:
    """Final linearization, parameters, (p,), and convergence of Levenberg-Marquardt, scaled by the sigmas.

    What ends it is the step without damping: a damped one is small wherever nothing lower is found. A step counts by
    what the motion with its initial conditions really leaves, not by the forecast without them: that is too low far
    from the solution, and nothing would be lower ever after. Damping shortens both, so that some step always is.
    Damping falls by 50 after a success, since near the solution plain Gauss-Newton steps are best, and rises by 10
    after a failure, until a step would be negligible: an axis that barely moves has nothing lower for many dampings.
    `room` keeps the mass above the least that is possible, with the rest of the step still optimal.
    """
    theta, linear = _feasible_start(problem, start, path, white, prior, refinements=refinements)
    damping, close = 1e-3, tolerance * math.sqrt(1.0 + problem.samples)
    little = max(NEGLIGIBLE, close)
    for _ in range(MANY_STEPS if refinements else STEPS):
        normal, gradient, scale = _scaled(linear, theta, prior)
        # In scaled units, as the step: a mass below the least has no motion to be compared with.
        room = scale[-1] * (problem.model.least_mass - theta[-1])
        wanted = float(np.abs(newton_step(normal, gradient, room)).max())
        if wanted < close:
            return linear, theta, True
        damped = newton_step(normal + damping * np.eye(len(theta)), gradient, room)
        step = damped / scale
        # The motion begins where the initial conditions would be by now: else each trial would seem worse than it is.
        begun = restarted(problem, linear, step, damping)
        tried = linearize(problem, theta + step, begun, white, refinements=refinements)
        gained = _total(linear, theta, prior) - (math.inf if tried is None else _total(tried, theta + step, prior))
        if tried is not None and gained > 0.0:
            theta, linear = theta + step, tried
            if damping < 1.0 and gained < max(little**2, tolerance * tried.whole):
                break
            damping *= 0.02
        elif (tried is not None and float(np.abs(damped).max()) < little) or damping > 1e8:
            break
        else:
            damping = max(1e-6, damping) * 10.0
    normal, gradient, scale = _scaled(linear, theta, prior)
    left = newton_step(normal, gradient, scale[-1] * (problem.model.least_mass - theta[-1]))
    return linear, theta, float(np.abs(left).max()) < LEFT


def _best_of(
    starts: Sequence[Array], problem: OutputErrorProblem, white: Whitener, prior: Prior
) -> tuple[LinearizedProblem, Array]:
    """Rough descent from the first of the starts, (p,) each, that ends well; where none does, the lowest.

    A live estimate over positions alone may be nowhere near, and a descent from there creeps along a bent valley.
    """
    found: list[tuple[LinearizedProblem, Array]] = []
    for start in starts:
        linear, theta, ended = _descend(problem, start, problem.guess, white, prior, tolerance=ROUGH_STEP)
        found.append((linear, theta))
        if ended:
            break
    return min(found, key=lambda one: _total(one[0], one[1], prior))


def _scaled(linear: LinearizedProblem, theta: Array, prior: Prior) -> tuple[Array, Array, Array]:
    """Normal matrix (p, p), gradient (p,), and the deviations' inverses that scale both, (p,).

    Scaled, the matrix has a diagonal of ones and a step is in standard deviations: one damping and one tolerance serve
    parameters of all units.
    """
    information = linear.information + prior.information
    gradient = linear.gradient + prior.information @ (prior.values - theta)
    scale = np.sqrt(np.diag(information))
    return information / np.outer(scale, scale), gradient / scale, scale


def _total(linear: LinearizedProblem, theta: Array, prior: Prior) -> float:
    """What the descent makes smallest: squared residuals and squared distance from the prior."""
    return linear.whole + float(np.sum(((theta - prior.values) / prior.sigmas) ** 2))


def _feasible_start(
    problem: OutputErrorProblem,
    start: Array,
    path: Trajectory,
    white: Whitener,
    prior: Prior,
    *,
    refinements: int = 0,
) -> tuple[Array, LinearizedProblem]:
    """Start, (p,), or the prior where the simulation diverges; with fitted initial conditions."""
    for theta in (start, prior.values):
        linear = linearize(problem, theta, path, white, refinements=refinements)
        if linear is not None:
            begun = restarted(problem, linear, np.zeros(len(theta)))
            again = linearize(problem, theta, begun, white, refinements=refinements)
            return theta, again or linear
    raise ValueError(_why_none(problem, prior.values))


def _why_none(problem: OutputErrorProblem, theta: Array) -> str:
    """Why no motion follows from the forces: in all stretches, or in some that contradict the others."""
    grid, none = problem.grid, "no motion follows from its forces with any usual drag"
    begins = np.flatnonzero(grid.starts)
    off = []
    for begin, end in zip(begins.tolist(), [*begins[1:].tolist(), len(grid.times_s)], strict=True):
        part = slice(begin, end)
        across = grid.across[part] if isinstance(grid.across, np.ndarray) else grid.across
        alone = Grid(grid.times_s[part], grid.starts[part], grid.impulse[part], across)
        if trajectory(problem.model, theta, alone, Trajectory(problem.guess.v[part], problem.guess.s[part])) is None:
            off.append((float(alone.times_s[0]), float(alone.times_s[-1])))
    if not 0 < len(off) < len(begins):
        return f"{none}: check their units and signs and the vehicle file, or fly it while the other axes are held"
    return (
        f"{none} in {len(off)} of the {len(begins)} stretches of the record, the first from {off[0][0]:.4g} to "
        f"{off[0][1]:.4g} s; from the others it does: leave that time out, or fly it while the other axes are held"
    )


def _deviations(problem: OutputErrorProblem, linear: LinearizedProblem) -> tuple[float, float]:
    """Root mean squares of the plain residuals without outliers, by channel: SI; NaN of none."""
    raw = (linear.raw[(problem.channel == channel) & problem.counts] for channel in (0, 1))
    of_velocity, of_position = (float(np.sqrt(np.mean(one**2))) if len(one) else math.nan for one in raw)
    return of_velocity, of_position


def _without_outliers(problem: OutputErrorProblem, linear: LinearizedProblem) -> OutputErrorProblem:
    counts = np.ones(len(problem.t), bool)
    for own in (problem.channel == 0, problem.channel == 1):
        counts &= ~own | (np.abs(linear.raw) <= OUTLIER_SIGMAS * _robust_sigma(linear.raw[own]))
    return replace(problem, counts=counts)


def _robust_sigma(raw: Array) -> float:
    """Standard deviation by the 90th percentile: the median of rounded velocities may be far too small."""
    return float(np.percentile(np.abs(raw), 90.0)) / 1.645 if len(raw) else math.inf


def _fit_of(
    problem: OutputErrorProblem,
    linear: LinearizedProblem,
    theta: Array,
    white: Whitener,
    prior: Prior,
    *,
    converged: bool,
) -> OutputErrorFit:
    inverse = array(np.linalg.inv(linear.information + prior.information))
    freedom = max(1, problem.samples - problem.nuisances - len(theta))
    plain = array(inverse * (linear.cost / freedom))
    covariance = _with_color(problem, linear, prior, inverse, plain)
    inflation = scatter_inflation(*_blocks(linear, problem), inverse, covariance)
    return OutputErrorFit(
        model=problem.model,
        theta=theta,
        covariance=covariance * np.outer(inflation, inflation),
        samples=problem.samples,
        effective_samples=_effective_samples(problem, linear),
        sigmas=_deviations(problem, linear),
        inflation=inflation,
        problem=problem,
        linear=linear,
        noise=white.noise,
        whitener=white,
        converged=converged,
        prior_information=prior.information,
    )


def _effective_samples(problem: OutputErrorProblem, linear: LinearizedProblem) -> float:
    """Equivalent independent samples of the main channel, whitened as the covariance has them."""
    own = (problem.channel == problem.main) & problem.counts
    return effective_samples([linear.r[span][own[span]] for span in problem.spans])


def _with_color(
    problem: OutputErrorProblem, linear: LinearizedProblem, prior: Prior, inverse: Array, plain: Array
) -> Array:
    """Covariance, (p, p), with remaining color: H^-1 (J' Omega J + B) H^-1; `plain` where residuals are white.

    H = J'J + B, and Omega (n, n) the covariance of the residuals, of which an autoregression is the model: with its
    transposed filter over the columns of J, J' Omega J is a square and never negative. B is the information of the
    prior, which has an error too. The estimate stays as it is: least squares is right on the average under any
    color, only its covariance is then not H^-1.
    """
    middle, colored = prior.information, False
    channels = (problem.channel == 0, problem.channel == 1)
    for measured in (one for one in channels if one.any()):
        rows = [np.flatnonzero(measured[span]) + span.start for span in problem.spans]
        pieces = [linear.r[own] for own in rows]
        color = fit_autoregression(pieces)
        colored = colored or len(color) > 0
        size = _innovation_variance(pieces, color)
        for own in rows:
            colored_columns = color_backward(color, linear.J[own])
            middle += colored_columns.T @ colored_columns * size
    return (inverse @ middle @ inverse) if colored else plain


def _innovation_variance(pieces: list[Array], color: Array) -> float:
    errors = [_unpredicted(piece, color) for piece in pieces if len(piece) > len(color)]
    return float(np.mean(np.concatenate(errors) ** 2))


def _unpredicted(piece: Array, color: Array) -> Array:
    """Innovations of an autoregression: (n - order,), in the unit of the piece."""
    n, order = len(piece) - len(color), len(color)
    terms = (a * piece[order - k : order - k + n] for k, a in enumerate(color, 1))
    return piece[order:] - sum(terms, np.zeros(n))


def _blocks(linear: LinearizedProblem, problem: OutputErrorProblem) -> tuple[Array, list[Array]]:
    """Gradient of the cost and information of each block of about BLOCK_S seconds: (blocks, p), (p, p) each."""
    gradients, informations = [], []
    for span in problem.spans:
        times, J, r = problem.t[span], linear.J[span], linear.r[span]
        length = float(times[-1] - times[0])
        count = max(1, round(length / BLOCK_S))
        block = np.minimum(count - 1, ((times - times[0]) / max(length, 1e-9) * count).astype(int))
        gradients += [J[block == one].T @ r[block == one] for one in range(count)]
        informations += [(J[block == one].T @ J[block == one]) for one in range(count)]
    return np.array(gradients), informations
