"""The output-error problem of one record: residuals and sensitivities, whitened, without the initial conditions.

The model is simulated over the recorded thrust; what is compared is its velocity (and its position, where one was
measured) with the measurements at their own times. Each stretch starts from a velocity and a position of its own,
which are nuisances: they are taken out by projection, so that only the parameters remain.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.models import Model
from hindrax_ident.record import Record, Series, Stretch
from hindrax_ident.simulate import Grid, Trajectory, sensitivities, trajectory
from hindrax_ident.whitening import Chain, Noise, Whitener

LONGEST_STEP_S = 0.05
FEWEST_SAMPLES = 8
SAME_S = 1e-6


@dataclass(frozen=True, slots=True)
class Problem:
    """Grid and measurements of all stretches, the latter in the order of time, (n,) each.

    `index` is the place on the grid, `channel` 0 for a velocity and 1 for a position; `counts` is false for outliers;
    `spans` are the measurements of each stretch, `guess` a first guess of the motion, `lag_s` the lag of
    the thrust, `efforts` the integral of its squares up to each measurement.
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

    @property
    def samples(self) -> int:
        """Number of measurements that count."""
        return int(self.counts.sum())

    @property
    def placed(self) -> tuple[bool, ...]:
        """Whether positions were measured, per stretch: then the initial position is a nuisance too."""
        return tuple(bool(np.any(self.channel[span] == 1)) for span in self.spans)

    @property
    def nuisances(self) -> int:
        """Number of initial conditions."""
        return len(self.spans) + sum(self.placed)

    @property
    def main(self) -> int:
        """Channel that the motion is judged by: velocity where it was measured."""
        return 0 if bool(np.any(self.channel == 0)) else 1

    def starts(self) -> Flags:
        """Measurements that begin a stretch: (n,)."""
        out = np.zeros(len(self.t), bool)
        out[[span.start for span in self.spans]] = True
        return out


def pose(model: Model, record: Record) -> Problem:
    """Lay the grid through every measurement of every stretch; ValueError when no stretch has enough of them."""
    cut = [_measured(record, stretch) for stretch in record.stretches]
    cut = [(v, s) for v, s in cut if len(v) + len(s) >= FEWEST_SAMPLES]
    if not cut:
        raise ValueError("no stretch of the record holds enough samples")
    grids = [_grid(_merged(v.t, s.t)) for v, s in cut]
    times = np.concatenate(grids)
    offsets = np.cumsum([0, *(len(grid) for grid in grids)])
    starts = np.zeros(len(times), bool)
    starts[offsets[:-1]] = True
    impulse = np.where(starts, 0.0, np.diff(record.impulse(times), prepend=0.0))
    chains = [_interleaved(v, s, grid, int(at)) for (v, s), grid, at in zip(cut, grids, offsets, strict=False)]
    t, y, index, channel = (np.concatenate(parts) for parts in zip(*chains, strict=True))
    edges = np.cumsum([0, *(len(chain[0]) for chain in chains)]).tolist()
    return Problem(
        model=model,
        grid=Grid(times, starts, impulse),
        t=t,
        y=y,
        index=index.astype(np.intp),
        channel=channel.astype(np.intp),
        counts=np.ones(len(t), bool),
        spans=tuple(slice(a, b) for a, b in itertools.pairwise(edges)),
        guess=_guess(cut, grids),
        lag_s=record.lag_s,
        efforts=record.efforts(t),
    )


def _measured(record: Record, stretch: Stretch) -> tuple[Series, Series]:
    return (
        record.velocity.between(stretch.start_s, stretch.end_s),
        record.position.between(stretch.start_s, stretch.end_s),
    )


def _merged(first: Array, second: Array) -> Array:
    """All times of both, those within a microsecond once."""
    times = np.union1d(first, second)
    return array(times[np.concatenate([[True], np.diff(times) > SAME_S])])


def _grid(times: Array) -> Array:
    """Every measurement time, and points between them so that no step is too long."""
    steps = np.diff(times)
    parts = np.maximum(1, np.ceil(steps / LONGEST_STEP_S - 1e-6)).astype(int)
    index = np.repeat(np.arange(len(steps)), parts)
    within = np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)
    return array(np.append(times[index] + steps[index] * within / parts[index], times[-1]))


def _interleaved(v: Series, s: Series, grid: Array, offset: int) -> tuple[Array, Array, Array, Array]:
    """Times, values, grid indices and channels of both series in the order of time."""
    t = np.concatenate([v.t, s.t])
    channel = np.concatenate([np.zeros(len(v)), np.ones(len(s))])
    order = np.argsort(t, kind="stable")
    index = np.searchsorted(grid, t[order] - SAME_S) + offset
    return t[order], np.concatenate([v.y, s.y])[order], array(index), channel[order]


def _guess(cut: list[tuple[Series, Series]], grids: list[Array]) -> Trajectory:
    """Motion as measured; what was not measured from what was."""
    velocities, positions = [], []
    for (v, s), grid in zip(cut, grids, strict=True):
        placed = np.interp(grid, s.t, s.y) if len(s) else None
        speed = np.interp(grid, v.t, v.y) if len(v) else np.zeros(len(grid))
        integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(grid) * (speed[1:] + speed[:-1]))])
        velocities.append(speed)
        positions.append(integral if placed is None else placed)
    return Trajectory(np.concatenate(velocities), np.concatenate(positions))


@dataclass(frozen=True, slots=True)
class Linear:
    """The problem about one set of parameters.

    `r` (n,) and `J` (n, p) are whitened, in units of the innovations' standard deviations, without the initial
    conditions; `start` (stretches, 2, 1 + p) are the initial conditions' own residuals and sensitivities, to be undone;
    `raw` (n,) are the plain residuals [m/s or rad/s; m or rad].
    """

    r: Array
    J: Array
    start: Array
    raw: Array
    path: Trajectory

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.r @ self.r)

    @property
    def information(self) -> Array:
        """J'J: (p, p)."""
        return array(self.J.T @ self.J)

    @property
    def gradient(self) -> Array:
        """J'r: (p,)."""
        return array(self.J.T @ self.r)


def linearize(
    problem: Problem, theta: Array, path: Trajectory, white: Callable[[Array], Array], impulses: Array | None = None
) -> Linear | None:
    """Simulate from the start of each stretch of `path` and differentiate; None where no motion follows from theta.

    With `impulses` (grid, m), J has their m columns behind those of the parameters.
    """
    moved = trajectory(problem.model, theta, problem.grid, path)
    if moved is None:
        return None
    S = sensitivities(problem.model, theta, problem.grid, moved, impulses)[problem.index, problem.channel]
    predicted = np.stack([moved.v, moved.s], axis=1)[problem.index, problem.channel]
    raw = problem.y - predicted
    p = len(theta)
    table = np.column_stack([raw, S[:, :p], S[:, p + 2 :], S[:, p : p + 2]])
    table = white(table)
    start = _project(problem, table)
    return Linear(table[:, 0], table[:, 1:-2], start, raw, moved)


def chain_of(problem: Problem, theta: Array, path: Trajectory) -> Chain:
    """Linearized error between the measurements."""
    model, index, starts = problem.model, problem.index, problem.starts()
    v, s = path.v[index], path.s[index]
    stiffness = theta[-2] * np.cos(s) / theta[-1] if model.restores else np.zeros(len(s))
    steps = np.where(starts, 0.0, np.diff(problem.t, prepend=problem.t[:1]))
    damping, push = model.slope(theta, v) / theta[-1], _effort(problem, steps) / theta[-1] ** 2
    return Chain(problem.channel, starts, steps, damping, stiffness, problem.counts, push, problem.lag_s)


def _effort(problem: Problem, steps_s: Array) -> Array:
    """Mean of the squared thrust between a measurement and the one before: (n,) [N^2, N^2 m^2].

    Where no time passes, at the start of a stretch above all, that of the next step.
    """
    gained = np.diff(problem.efforts, prepend=problem.efforts[:1])
    known = steps_s > SAME_S
    following = np.searchsorted(np.flatnonzero(known), np.arange(len(known)))
    steps = np.append(np.flatnonzero(known), len(known) - 1)[following]
    return array(gained[steps] / np.maximum(SAME_S, steps_s[steps]))


def whitener_of(problem: Problem, theta: Array, path: Trajectory, noise: Noise) -> Whitener:
    """Whitener for the motion along a path."""
    return Whitener(chain_of(problem, theta, path), noise)


def _project(problem: Problem, white: Array) -> Array:
    """Take the initial conditions (the last two columns) out of the others, stretch by stretch, in place."""
    width = white.shape[1] - 2
    starts = np.zeros((len(problem.spans), 2, width))
    for row, (span, placed) in enumerate(zip(problem.spans, problem.placed, strict=True)):
        count = 2 if placed else 1
        psi = white[span, width : width + count]
        Q, R = np.linalg.qr(psi)
        along = Q.T @ white[span, :width]
        white[span, :width] -= Q @ along
        starts[row, :count] = np.linalg.lstsq(R, along, rcond=None)[0]
    return starts


def restarted(problem: Problem, linear: Linear, change: Array) -> Trajectory:
    """First guess of the motion after a change of the parameters: the initial conditions follow theirs."""
    v, s = linear.path.v.copy(), linear.path.s.copy()
    steps = linear.start[:, :, 0] - linear.start[:, :, 1 : 1 + len(change)] @ change
    v[problem.grid.starts] += steps[:, 0]
    s[problem.grid.starts] += steps[:, 1]
    return Trajectory(v, s)
