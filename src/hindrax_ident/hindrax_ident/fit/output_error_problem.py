"""Output-error problem of one record: residuals and sensitivities, whitened, without the initial conditions.

The model is simulated over the recorded thrust; its velocity (and its position, where measured) is compared with the
measurements at their times. Initial velocity and position of each stretch are nuisance parameters, removed by
projection, so that only the parameters remain.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.fit.mean_velocities import MeanVelocities, mean_velocities
from hindrax_ident.fit.whitening import ErrorDynamics, Noise, Whitener
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, Trajectory, per_step, sensitivities, trajectory
from hindrax_ident.records.axis_record import Record, Series

LONGEST_STEP_S = 0.05
"""Longest step of the grid on which the motion is simulated."""
FEWEST_SAMPLES = 8
"""A stretch with fewer measurements is left out."""
SAME_S = 1e-6
"""Times nearer to each other than this are one."""
FIRST = 5
"""Measurements whose median the search takes for the first one."""


@dataclass(frozen=True, slots=True)
class OutputErrorProblem:
    """Grid and measurements of all stretches, the latter in time order, (n,) each.

    `index`: index on the grid; `channel`: 0 for a velocity, 1 for a position; `counts`: false for outliers; `spans`:
    measurements of each stretch; `guess`: initial guess of the motion; `lag_s`: lag of the thrust; `efforts`: integral
    of its squares up to each measurement; `means`: shares of means over time of which velocities
    are the sum; empty: they are those of the moment.
    """

    model: Model
    grid: Grid
    t: Array
    y: Array
    index: Index
    channel: Index
    counts: Flags
    spans: tuple[slice, ...]
    guess: Trajectory
    lag_s: float
    efforts: Array
    means: tuple[tuple[float, MeanVelocities], ...] = ()

    def predicted(self, states: Array) -> Array:
        """What is measured of velocity and position on the grid, or of their derivatives, (grid, 2, ...): (n, ...)."""
        out = states[self.index, self.channel]
        if self.means:
            out[self.channel == 0] = sum(share * means.of(states) for share, means in self.means)
        return array(out)

    @property
    def samples(self) -> int:
        """Number of measurements that count."""
        return int(self.counts.sum())

    @property
    def has_position(self) -> tuple[bool, ...]:
        """Whether each stretch has positions: then its initial position is a nuisance parameter too."""
        return tuple(bool(np.any(self.channel[span] == 1)) for span in self.spans)

    @property
    def nuisances(self) -> int:
        """Number of initial conditions."""
        return len(self.spans) + sum(self.has_position)

    @property
    def main(self) -> int:
        """Main channel, for residuals and quality: velocity where measured, otherwise position."""
        return 0 if bool(np.any(self.channel == 0)) else 1

    def starts(self) -> Flags:
        """Measurements that begin a stretch: (n,)."""
        out = np.zeros(len(self.t), bool)
        out[[span.start for span in self.spans]] = True
        return out


def build_problem(model: Model, record: Record) -> OutputErrorProblem:
    """Build grid and measurements of all stretches; ValueError when no stretch has enough samples."""
    cut = [record.within(stretch) for stretch in record.stretches]
    cut = [(v, s) for v, s in cut if len(v) + len(s) >= FEWEST_SAMPLES]
    if not cut:
        raise ValueError(f"no stretch of the record has enough samples, wanted {FEWEST_SAMPLES}")
    # Every measurement is a point of the grid: nothing is interpolated, so no error of that is taken for noise.
    grids = [_grid(_merged(v.t, s.t)) for v, s in cut]
    times = np.concatenate(grids)
    offsets = np.cumsum([0, *(len(grid) for grid in grids)])
    starts = np.zeros(len(times), bool)
    starts[offsets[:-1]] = True
    chains = [_interleaved(v, s, grid, int(at)) for (v, s), grid, at in zip(cut, grids, offsets, strict=False)]
    t, y, index, channel = (np.concatenate(parts) for parts in zip(*chains, strict=True))
    edges = np.cumsum([0, *(len(v) + len(s) for v, s in cut)]).tolist()
    grid = Grid(
        times, starts, per_step(record.impulse(times), starts), record.speed_across(times) if model.crossed else 0.0
    )
    index = index.astype(np.intp)
    velocities = channel == 0
    return OutputErrorProblem(
        model=model,
        grid=grid,
        t=t,
        y=y,
        index=index,
        channel=channel.astype(np.intp),
        counts=np.ones(len(t), bool),
        spans=tuple(slice(a, b) for a, b in itertools.pairwise(edges)),
        guess=_initial_guess(cut, grids),
        lag_s=record.lag_s,
        efforts=record.efforts(t),
        means=tuple(
            (share, mean_velocities(t[velocities], times, grid.bounds[:, index[velocities]], over_s))
            for share, over_s in record.means
        ),
    )


def _merged(first: Array, second: Array) -> Array:
    """Times of both, (n,) [s]; those within a microsecond once."""
    times = np.union1d(first, second)
    return array(times[np.concatenate([[True], np.diff(times) > SAME_S])])


def _grid(times: Array) -> Array:
    """Measurement times and points between them, (n,) [s], so that no step exceeds LONGEST_STEP_S."""
    steps = np.diff(times)
    parts = np.maximum(1, np.ceil(steps / LONGEST_STEP_S - 1e-6)).astype(int)
    # Between measurements that are far apart, points are added: the rule of fourth order of `simulation` (trapezoid
    # with end terms) wants short steps.
    index = np.repeat(np.arange(len(steps)), parts)
    within = np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(times[index] + steps[index] * within / parts[index], times[-1])


def _interleaved(v: Series, s: Series, grid: Array, offset: int) -> tuple[Array, Array, Array, Array]:
    """Times [s], values, grid indices and channels of both series in time order: (n,) each."""
    t = np.concatenate([v.t, s.t])
    channel = np.concatenate([np.zeros(len(v)), np.ones(len(s))])
    # Stable: at equal times a velocity stays before a position, whatever the machine.
    order = np.argsort(t, kind="stable")
    index = np.searchsorted(grid, t[order] - SAME_S) + offset
    return t[order], np.concatenate([v.y, s.y])[order], array(index), channel[order]


def _initial_guess(cut: list[tuple[Series, Series]], grids: list[Array]) -> Trajectory:
    """Motion as measured; missing quantities are derived from measured ones."""
    velocities, positions = [], []
    for (v, s), grid in zip(cut, grids, strict=True):
        speed = np.interp(grid, v.t, v.y) if len(v) else np.zeros(len(grid))
        place = np.interp(grid, s.t, s.y) if len(s) else None
        if place is None:
            # Where no position was measured only its changes count, so any origin serves.
            place = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(grid) * (speed[1:] + speed[:-1]))])
        # The search begins with the first of each, which may be an outlier: the median of some is none.
        for values, measured in ((speed, v.y), (place, s.y)):
            if len(measured):
                values[0] = np.median(measured[:FIRST])
        velocities.append(speed)
        positions.append(place)
    return Trajectory(np.concatenate(velocities), np.concatenate(positions))


@dataclass(frozen=True, slots=True)
class LinearizedProblem:
    """Problem linearized about one set of parameters.

    `r` (n,) and `J` (n, p) are whitened, in units of the innovations' standard deviations, without the initial
    conditions; `start` (stretches, 2, 1 + p): residuals and sensitivities of the initial conditions; `raw` (n,): plain
    residuals [m/s or rad/s; m or rad]; `whole`: sum of the squared residuals with the initial conditions as they are.
    """

    r: Array
    J: Array
    start: Array
    raw: Array
    path: Trajectory
    whole: float

    @property
    def cost(self) -> float:
        """Sum of the squared residuals, as the best initial conditions would leave them if all were linear."""
        return float(self.r @ self.r)

    @property
    def information(self) -> Array:
        """J'J: (p, p)."""
        return self.J.T @ self.J

    @property
    def gradient(self) -> Array:
        """J'r: (p,)."""
        return self.J.T @ self.r


def linearize(
    problem: OutputErrorProblem,
    theta: Array,
    path: Trajectory,
    white: Callable[[Array], Array],
    impulses: Array | None = None,
    *,
    readings: Array | None = None,
    refinements: int = 0,
) -> LinearizedProblem | None:
    """Simulate from the start of each stretch of a path and differentiate.

    Parameters
    ----------
    problem
        Measurements, grid and model of one axis.
    theta : (p,)
        Parameters.
    path
        Motion whose states at the start of each stretch count.
    white
        Whitens a table, (n, k) to (n, k).
    impulses : (grid, m) [N s, N m s per unit]
        Unmodeled impulses over each step: columns of J after those of the parameters.
    readings : (n, k) [m/s, rad/s, m, rad per unit]
        Errors of each measurement: the last columns of J.
    refinements
        As of `sensitivities`.

    Returns
    -------
    LinearizedProblem | None
        Whitened residuals and sensitivities, initial conditions projected out; None where the motion diverges.
    """
    moved = trajectory(problem.model, theta, problem.grid, path)
    if moved is None:
        return None
    S = sensitivities(problem.model, theta, problem.grid, moved, impulses, refinements=refinements)
    # Of velocity and position at every point, those that were measured.
    S = problem.predicted(S)
    raw = _residuals(problem, moved)
    p = len(theta)
    extra = np.zeros((len(raw), 0)) if readings is None else readings
    table = white(np.column_stack([raw, S[:, :p], S[:, p + 2 :], extra, S[:, p : p + 2]]))
    whole = float(table[:, 0] @ table[:, 0])
    # Initial conditions of each stretch are nuisances: what they explain is taken out of all columns, exactly.
    start = _project(problem, table)
    return LinearizedProblem(table[:, 0], table[:, 1:-2], start, raw, moved, whole)


def _residuals(problem: OutputErrorProblem, path: Trajectory) -> Array:
    """Measurements minus what a motion predicts of them: (n,) [m/s or rad/s; m or rad]."""
    return problem.y - problem.predicted(np.stack([path.v, path.s], axis=1))


def mean_error(problem: OutputErrorProblem, residuals: Array) -> float:
    """Mean absolute residual of the main channel: comparable between parameters, and between searches."""
    return float(np.mean(np.abs(residuals[problem.channel == problem.main])))


def nearest_start(model: Model, record: Record, starts: Sequence[Array]) -> Array:
    """Choose the parameters whose motion is nearest to the record; the first where several are.

    A descent ends in the basin in which it begins, and a live estimate of a short run may be in another one.

    Parameters
    ----------
    model, record
        Of the axis.
    starts : (p,) each
        Candidates.

    Returns
    -------
    Array
        (p,), one of them.
    """
    problem = build_problem(model, record)

    def error(theta: Array) -> float:
        """Error of the motion; infinite where the parameters are implausible."""
        moved = trajectory(model, theta, problem.grid, problem.guess)
        return math.inf if moved is None else mean_error(problem, _residuals(problem, moved))

    return min(starts, key=error)


def error_dynamics_of(problem: OutputErrorProblem, theta: Array, path: Trajectory) -> ErrorDynamics:
    """Error dynamics v' = -d v - k s + a between the measurements, linearized along a path.

    Parameters
    ----------
    problem
        With n measurements.
    theta : (p,)
        Parameters: d is the slope of the drag over the mass, k that of the restoring moment.
    path
        Motion along which they are linearized.

    Returns
    -------
    ErrorDynamics
        (n,) each.
    """
    model, index, starts = problem.model, problem.index, problem.starts()
    v, s = path.v[index], path.s[index]
    stiffness = theta[-2] * np.cos(s) / theta[-1] if model.restores else np.zeros(len(s))
    steps = per_step(problem.t, starts)
    across = problem.grid.across
    slope = model.slope(theta, v, across if isinstance(across, float) else across[index])
    damping, thrust_density = slope / theta[-1], _effort(problem, steps) / theta[-1] ** 2
    return ErrorDynamics(
        problem.channel, starts, steps, damping, stiffness, problem.counts, thrust_density, problem.lag_s
    )


def _effort(problem: OutputErrorProblem, steps_s: Array) -> Array:
    """Mean squared thrust between a measurement and the previous one: (n,) [N^2, N^2 m^2].

    For steps of no length, such as at the start of a stretch, that of the next step.
    """
    gained = np.diff(problem.efforts, prepend=problem.efforts[:1])
    known = steps_s > SAME_S
    # A step of no length has no rate of its own.
    following = np.searchsorted(np.flatnonzero(known), np.arange(len(known)))
    steps = np.append(np.flatnonzero(known), len(known) - 1)[following]
    return array(gained[steps] / np.maximum(SAME_S, steps_s[steps]))


def whitener_of(problem: OutputErrorProblem, theta: Array, path: Trajectory, noise: Noise) -> Whitener:
    """Whitener for the motion along a path.

    Parameters
    ----------
    problem, theta, path
        As of `error_dynamics_of`.
    noise
        Variances of the measurements and of unknown forces.

    Returns
    -------
    Whitener
        A Kalman filter whose innovations are white, of unit variance.
    """
    return Whitener(error_dynamics_of(problem, theta, path), noise)


def _project(problem: OutputErrorProblem, white: Array) -> Array:
    """Project out the initial conditions (last two columns) per stretch, in place: (stretches, 2, m - 2)."""
    width = white.shape[1] - 2
    starts = np.zeros((len(problem.spans), 2, width))
    has_position = problem.has_position
    if not any(has_position):
        starts[:, 0] = _project_velocities(problem, white)
        return starts
    for row, (span, both) in enumerate(zip(problem.spans, has_position, strict=True)):
        count = 1 + both
        psi = white[span, width : width + count]
        Q, R = np.linalg.qr(psi)
        along = Q.T @ white[span, :width]
        white[span, :width] -= Q @ along
        starts[row, :count] = np.linalg.lstsq(R, along, rcond=None)[0]
    return starts


def _project_velocities(problem: OutputErrorProblem, white: Array) -> Array:
    """The same where only the initial velocity (last column but one) is unknown, of all stretches at once: in place.

    One column needs no factors: what it explains of another one is the ratio of two sums. (stretches, m - 2)
    """
    table, psi = white[:, :-2], white[:, -2]
    begins = [span.start for span in problem.spans]
    squares = np.add.reduceat(psi**2, begins)[:, None]
    along = np.add.reduceat(psi[:, None] * table, begins, axis=0)
    steps = np.divide(along, squares, out=np.zeros_like(along), where=squares > 0.0)
    table -= psi[:, None] * np.repeat(steps, np.diff([*begins, len(psi)]), axis=0)
    return array(steps)


def restarted(
    problem: OutputErrorProblem, linear: LinearizedProblem, change: Array, damping: float = 0.0
) -> Trajectory:
    """Initial guess of the motion after a change of the parameters, its initial conditions updated to first order.

    Parameters
    ----------
    problem, linear
        The problem, and its linearization before the change.
    change : (p,)
        Of the parameters.
    damping : [-]
        Shortens the update by 1 + damping, as the step of the parameters.

    Returns
    -------
    Trajectory
        Right at the start of each stretch; elsewhere as before.
    """
    v, s = linear.path.v.copy(), linear.path.s.copy()
    steps = (linear.start[:, :, 0] - linear.start[:, :, 1:] @ change) / (1.0 + damping)
    v[problem.grid.starts] += steps[:, 0]
    s[problem.grid.starts] += steps[:, 1]
    return Trajectory(v, s)
