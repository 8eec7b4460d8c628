"""Normal equations of all six axes of a record: velocities of every step and parameters, linearized.

The new part of the unknown force of a step depends on three neighboring states, so the matrix of the velocities has a
narrow band. The Schur complement leaves the parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.fit.scatter import BLOCK_S
from hindrax_ident.model.six_axes import State, Term, inertial_force, symmetric
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.six_axis_record import Grid, SixAxisRecord

OUTLIER = 4.0
"""Error of a measurement, in deviations, beyond which its weight falls (Huber)."""
SHORT_S, NUDGE = 1e-3, 1e-4
"""Steps of numerical derivatives: of the lag, and of velocities."""
MEMORY_SPAN_S, LONGEST_MEMORY_S = 0.2, 2.0
"""Spans whose covariance gives the memory of unknown forces, and its longest time constant."""
DIFFERENCES = (2, 3, 4, 5)
NOISE_SHARES = (0.2, 5.0)
"""Least and largest variance of a measurement, of that of its fast changes [-]."""
FIRST_FORCE, DEPTH_NOISE_mps = 0.03, 0.01
"""Unknown force of a step before it is known, of the largest thrust [-]; and of a depth, as angles are not exact."""
LAG, LATENCY = 0, 1
"""Places of the delays among the parameters: the lag of the thrust, then the latencies of velocities and rates."""
DELAYS = 3


@dataclass(frozen=True, slots=True)
class Noise:
    """Variances by state: what is new in the unknown force of each step, and of a measurement.

    `of_changes`: the latter by its fast changes alone; `kept`: share of the unknown force of a step that is left in the
    next [-]. Drag and lift that the model lacks are slow: as white noise they would be taken for mass and delay where a
    pilot or a controller answers them.
    """

    force: Array
    velocity: Array
    of_changes: Array
    kept: Array

    def updated(self, squares: Array, free: Array, kept: Array) -> Noise:
        """One step of the fixed point of the restricted likelihood, within a factor of ten.

        Measurements that say everything would leave nothing to the model: so their variance is not far below what their
        fast changes show (NOISE_SHARES).

        Parameters
        ----------
        squares : (2, states)
            Sums of squares of what is new in forces, and of the errors of measurements.
        free : (2, states)
            Degrees of freedom that the smoother leaves to each.
        kept : (states,) [-]
            Share of an unknown force that is left after a step.

        Returns
        -------
        Noise
            With variances of squares / free.
        """
        force, velocity = (
            np.clip(square / np.maximum(1.0, number), 0.1 * old, 10.0 * old)
            for square, number, old in zip(squares, free, (self.force, self.velocity), strict=True)
        )
        within = np.clip(velocity, *(share * self.of_changes for share in NOISE_SHARES))
        return Noise(np.maximum(force, 1e-12), within, self.of_changes, kept)


def first_noise(record: SixAxisRecord, pull: Array) -> Noise:
    """Noise before a fit: by the fast changes of the measurements, and a share of the largest thrust (6,)."""
    measured = [record.velocities[axis] for axis in record.axes] + ([record.depth] if len(record.depth) else [])
    of_changes = array([max(1e-10, min(_variance(one.y, order) for order in DIFFERENCES)) for one in measured])
    force = [(FIRST_FORCE * max(1e-6, pull[axis])) ** 2 for axis in record.axes]
    force += [DEPTH_NOISE_mps**2] * (len(measured) - len(force))
    return Noise(array(force), of_changes, of_changes, np.zeros(len(measured)))


def _variance(y: Array, order: int) -> float:
    """Variance of white noise from differences; of the orders, the least has least of the motion left."""
    return float(np.mean(np.diff(y, n=order) ** 2)) / math.comb(2 * order, order) if len(y) > order else 1.0


def first_velocities(record: SixAxisRecord, grid: Grid) -> Array:
    """States of a stretch as measured: (n, states)."""
    measured = [record.velocities[axis] for axis in record.axes] + ([record.depth] if len(record.depth) else [])
    n = len(grid.times_s)
    return np.stack([np.interp(grid.times_s, o.t, o.y) if len(o) else np.zeros(n) for o in measured], axis=1)


def masses(terms: Sequence[Term], theta: Array) -> Array:
    """Total mass matrix: (6, 6) [kg, kg m, kg m^2]."""
    M = np.zeros((6, 6))
    for term, value in zip(terms, theta.tolist(), strict=True):
        if term.mass:
            M += value * symmetric(term.mass)
    return M


class Normal(NamedTuple):
    """Normal equations of the parameters: S (p, p), s (p,); scores (blocks, p) and information of blocks (p, p).

    `free` (2, states): numbers of unknown forces and of measurements, less what the fit takes of them. `steps`: of each
    stretch the step of its states (n states, 1 + p): where the parameters stay, and less this per unit of each.
    """

    S: Array
    s: Array
    scores: Array
    shares: list[Array]
    free: Array
    steps: list[Array]


class _Steps(NamedTuple):
    """Steps of a stretch: state, mass of the axes, unknown force (n - 1, states), acceleration by the model."""

    state: State
    M: Array
    w: Array
    predicted: Array


class _Measured(NamedTuple):
    """Measurements of a state: step, part of it that has passed, value; and the place of their latency."""

    step: Index
    part: Array
    y: Array
    latency: int

    def errors(self, v: Array) -> Array:
        """Of a state (n,): (m,)."""
        return self.y - (1.0 - self.part) * v[self.step] - self.part * v[self.step + 1]

    def placed(self, values: Array, n: int) -> Array:
        """Values at the measurements (m,), on the states between which they are: (n,)."""
        before = np.bincount(self.step, (1.0 - self.part) * values, n)
        return array(before + np.bincount(self.step + 1, self.part * values, n))


class _Dependence(NamedTuple):
    """What is new in the unknown force of a step, by the states: at its end, at its begin, and one step before.

    (n - 1, states, states) each; `columns` (n - 1, states, u): by the parameters; `w` (n - 1, states): its value.
    """

    late: Array
    mid: Array
    old: Array
    columns: Array
    w: Array

    def on_states(self, weighted: Array) -> Array:
        """Transposed, times weighted forces (n - 1, states, k): (n, states, k)."""
        out = np.zeros((len(self.w) + 1, *weighted.shape[1:]))
        late, mid, old = (one.transpose(0, 2, 1) @ weighted for one in (self.late, self.mid, self.old))
        out[1:] += late
        out[:-1] += mid
        out[:-2] += old[1:]
        return out


@dataclass(frozen=True)
class JointProblem:
    """A record, with parameters, noise and the terms that are in, where it is linearized."""

    record: SixAxisRecord
    terms: Sequence[Term]
    theta: Array
    kept: Flags
    noise: Noise

    @property
    def axes(self) -> list[int]:
        """Axes of the record."""
        return list(self.record.axes)

    def normal(self, velocities: Sequence[Array], *, all_terms: bool = False, begins: bool = False) -> Normal:
        """Normal equations of the parameters, summed over the stretches.

        Parameters
        ----------
        velocities : (n, states) each
            Motion of each stretch about which is linearized.
        all_terms
            Whether terms that are not in now have their columns too: for the odds.
        begins
            Whether masses act on accelerations as measured: as long as the model does not know better.

        Returns
        -------
        Normal
            S (p, p) and s (p,), with the part of each block.
        """
        used = np.flatnonzero(self.kept | all_terms)
        # The same probes in each step: else the noise would never settle.
        rng = np.random.default_rng(0)
        stretches = zip(self.record.grids, velocities, strict=True)
        parts = [self._stretch(grid, v, used, rng, begins=begins) for grid, v in stretches]
        return Normal(
            array(sum(one.S for one in parts)),
            array(sum(one.s for one in parts)),
            array(np.concatenate([one.scores for one in parts])),
            [share for one in parts for share in one.shares],
            array(sum(one.free for one in parts)),
            [step for one in parts for step in one.steps],
        )

    def cost(self, velocities: Sequence[Array], M: Array, prior: tuple[Array, Array]) -> float:
        """What is minimized: squares of forces, of measurements and of the parameters' distance from their prior.

        Parameters
        ----------
        velocities : (n, states) each
            Motion of each stretch.
        M : (6, 6)
            Mass in whose metric forces count.
        prior : (p,), (p,)
            Means and standard deviations of the parameters.

        Returns
        -------
        float
            Without unit.
        """
        squares = self.squares(velocities, M)
        of_prior = np.sum(((self.theta - prior[0]) / prior[1])[self.kept] ** 2)
        return float(np.sum(squares[0] / self.noise.force) + np.sum(squares[1] / self.noise.velocity) + of_prior)

    def squares(self, velocities: Sequence[Array], M: Array | None = None) -> Array:
        """Sums of the squares of what is new in unknown forces, and of measurement errors.

        Parameters
        ----------
        velocities : (n, states) each
            Motion of each stretch.
        M : (6, 6)
            With it, forces are those that would accelerate this mass as much: of two models, the one with the smaller
            mass has not the smaller forces by that. None: forces as they are.

        Returns
        -------
        Array
            (2, states) [N^2 or N^2 m^2; m^2/s^2, rad^2/s^2 or m^2].
        """
        out, na = np.zeros((2, velocities[0].shape[1])), len(self.axes)
        for grid, v in zip(self.record.grids, velocities, strict=True):
            step = self._steps(grid, v)
            w = step.w
            if M is not None:
                # w M^-1 is the acceleration that the model does not explain; times the given mass it is a force again.
                w = np.column_stack([w[:, :na] @ np.linalg.inv(step.M) @ M[np.ix_(self.axes, self.axes)], w[:, na:]])
            out[0] += np.sum(self._fresh(w) ** 2, axis=0)
            for place in range(v.shape[1]):
                if (own := self._measured(place, grid)) is not None:
                    e = own.errors(v[:, place])
                    out[1, place] += np.sum(self._robust(e, place) * e**2)
        return out

    def memory(self, velocities: Sequence[Array]) -> Array:
        """Share of an unknown force that is left after a step, from its covariance after one span and after two.

        The covariance after none has the noise of the measurements in it.

        Parameters
        ----------
        velocities : (n, states) each
            Motion of each stretch.

        Returns
        -------
        Array
            (states,) [-]; zero for a depth.
        """
        step_s, axes = self.record.grids[0].step_s, len(self.axes)
        # Over a span, not a step: what is new in one step is small beside the noise of two velocities.
        span = max(1, round(MEMORY_SPAN_S / step_s))
        sums = np.zeros((2, velocities[0].shape[1]))
        for grid, v in zip(self.record.grids, velocities, strict=True):
            w = self._steps(grid, v).w
            sums += [np.sum(w[one:] * w[:-one], axis=0) for one in (span, 2 * span)]
        share = np.divide(sums[1], sums[0], out=np.zeros_like(sums[0]), where=sums[0] > 0.0)
        # From the share over a span to that over a step, and never so near to 1 that a force would be a drift.
        found = np.minimum(np.maximum(share, 0.0) ** (1.0 / span), math.exp(-step_s / LONGEST_MEMORY_S))
        return np.where(np.arange(len(found)) < axes, found, 0.0)

    # ---- one stretch

    def _thrust(self, grid: Grid, lag_s: float) -> Array:
        """Mean thrust of each step: (n - 1, 6) [N, N m]."""
        r = self.record
        impulses = [LaggedThrust(r.wrench_t, one, lag_s).impulse(grid.times_s) for one in r.wrench.T]
        return np.diff(np.stack(impulses, axis=1), axis=0) / grid.step_s

    def _resisting(self, state: State) -> Array:
        """Forces of all terms that are in, and C(M) v, without M v': (n, 6)."""
        theta = np.where(self.kept, self.theta, 0.0)
        out = inertial_force(masses(self.terms, theta), state.nu, np.zeros_like(state.nu))
        for term, value in zip(self.terms, theta.tolist(), strict=True):
            if value != 0.0 and not term.mass:
                for axis, force in term.force(state).items():
                    out[:, axis] += value * force
        return out

    def _steps(self, grid: Grid, v: Array) -> _Steps:
        """Unknown force of each step of a stretch, and what it was computed from."""
        axes, na = self.axes, len(self.axes)
        thrust = self._thrust(grid, max(0.0, float(self.theta[LAG])))
        M = masses(self.terms, np.where(self.kept, self.theta, 0.0))[np.ix_(axes, axes)]
        nu, predicted = np.zeros((len(v) - 1, 6)), np.zeros((len(v) - 1, 6))
        # Forces in the middle of a step, so that the difference of the velocities is right to second order.
        nu[:, axes] = 0.5 * (v[:-1, :na] + v[1:, :na])
        state = State(nu, np.zeros_like(nu), thrust, grid.angles_rad)
        missing = (self._resisting(state) - thrust)[:, axes]
        predicted[:, axes] = -missing @ np.linalg.inv(M)
        w = np.diff(v, axis=0) / grid.step_s
        w[:, :na] = w[:, :na] @ M + missing
        if v.shape[1] > na:
            # A depth is a state without a force: its rate is the velocity along the vertical.
            w[:, na] -= np.sum(nu[:, :3] * grid.down, axis=1)
        return _Steps(state, M, w, predicted)

    def _fresh(self, w: Array) -> Array:
        """What is new in each step of unknown forces (n, states, ...), of equal variance."""
        kept = self.noise.kept.reshape(-1, *[1] * (w.ndim - 2))
        out = w.copy()
        out[1:] -= kept * w[:-1]
        # The first one has the stationary variance; this brings it down to that of what is new.
        out[0] *= np.sqrt(1.0 - kept**2)
        return out

    def _robust(self, e: Array, place: int) -> Array:
        """Weights of measurement errors: 1 but for outliers."""
        return array(np.minimum(1.0, OUTLIER * math.sqrt(self.noise.velocity[place]) / np.maximum(np.abs(e), 1e-12)))

    def _measured(self, place: int, grid: Grid) -> _Measured | None:
        """Measurements of a state within a stretch; None without any."""
        axis, one = 2, self.record.depth
        if place < len(self.axes):
            axis = self.axes[place]
            one = self.record.velocities[axis]
        latency = LATENCY + (axis >= 3)
        # Stamps are late by the latency, so each velocity is compared with the state of before.
        t = one.t - float(self.theta[latency])
        inside = (t >= grid.times_s[0]) & (t <= grid.times_s[-1])
        return _Measured(*grid.places(t[inside]), one.y[inside], latency) if inside.any() else None

    def _dependence(self, grid: Grid, v: Array, used: Index, *, begins: bool) -> _Dependence:
        """Derivatives of what is new in the unknown forces."""
        axes, na, ns, h = self.axes, len(self.axes), v.shape[1], grid.step_s
        steps = self._steps(grid, v)
        inertia, slope = np.eye(ns) / h, np.zeros((len(v) - 1, ns, ns))
        inertia[:na, :na] = steps.M / h
        for place, axis in enumerate(axes):
            # By differences: a new term then needs no derivative of its own.
            nudge = NUDGE * np.eye(6)[axis]
            ahead, back = (self._resisting(replace(steps.state, nu=steps.state.nu + one)) for one in (nudge, -nudge))
            slope[:, :na, place] = ((ahead - back) / (2.0 * NUDGE))[:, axes]
            if ns > na and axis < 3:
                slope[:, na, place] = -grid.down[:, axis]
        # Half of the slope at each end of the step, since the forces are taken in its middle.
        late, before = inertia + 0.5 * slope, -inertia + 0.5 * slope
        kept = self.noise.kept[:, None]
        mid, old = before.copy(), np.zeros_like(before)
        # What is new in a step is its force less the kept share of that before, which depends on one state more.
        mid[1:] -= kept * late[:-1]
        old[1:] = -kept * before[:-1]
        for one in (late, mid):
            one[0] *= np.sqrt(1.0 - kept**2)
        # The acceleration of the model has no noise; that of a difference would bias the masses towards zero.
        acceleration = steps.predicted
        if begins:
            acceleration = np.zeros_like(steps.predicted)
            acceleration[:, axes] = np.diff(v[:, :na], axis=0) / h
        columns = np.zeros((len(v) - 1, ns, len(used)))
        state, place_of = replace(steps.state, acceleration=acceleration), {axis: at for at, axis in enumerate(axes)}
        for k, index in enumerate(used.tolist()):
            for axis, force in self.terms[index].force(state).items():
                if axis in place_of:
                    columns[:, place_of[axis], k] = force
        if len(used) and used[0] == LAG:
            # No term of a force: the lag moves the thrust itself.
            more = self._thrust(grid, max(0.0, float(self.theta[LAG])) + SHORT_S)
            columns[:, :na, 0] = -((more - steps.state.thrust) / SHORT_S)[:, axes]
        return _Dependence(late, mid, old, self._fresh(columns), self._fresh(steps.w))

    def _stretch(self, grid: Grid, v: Array, used: Index, rng: np.random.Generator, *, begins: bool) -> Normal:
        """Normal equations of one stretch."""
        (n, ns), u, W = v.shape, len(used), 1.0 / self.noise.force
        d = self._dependence(grid, v, used, begins=begins)
        whitened = (d.columns * np.sqrt(W)[:, None]).reshape(-1, u)
        S, rows = whitened.T @ whitened, -np.matmul((W * d.w)[:, None, :], d.columns)[:, 0, :]
        weighted = np.concatenate([-d.w[:, :, None], d.columns], axis=2) * W[:, None]
        signs = rng.choice([-1.0, 1.0], (n - 1, ns))
        of_forces = signs[:, :, None] * np.eye(ns) * np.sqrt(W)[:, None]
        # One factorization for all: the step, its dependence on the parameters, and a random probe for each variance.
        right = d.on_states(np.concatenate([weighted, of_forces, np.zeros((n - 1, ns, ns))], axis=2))
        D, L, L2 = _blocks(d, W)
        free = np.stack([np.full(ns, n - 1.0), np.zeros(ns)])
        for place in range(ns):
            if (own := self._measured(place, grid)) is None:
                continue
            e = own.errors(v[:, place])
            weight = self._robust(e, place) / self.noise.velocity[place]
            # A measurement between two states is their weighted mean, so it is in both diagonals and beside them.
            D[:, place, place] += np.bincount(own.step, weight * (1.0 - own.part) ** 2, n)
            D[:, place, place] += np.bincount(own.step + 1, weight * own.part**2, n)
            L[:, place, place] += np.bincount(own.step, own.part * (1.0 - own.part) * weight, n - 1)
            right[:, place, 0] += own.placed(weight * e, n)
            right[:, place, 1 + u + ns + place] = own.placed(np.sqrt(weight) * rng.choice([-1.0, 1.0], len(e)), n)
            free[1, place] = len(e)
            for k in np.flatnonzero(used == own.latency).tolist():
                # A latency moves the place at which the state is read: by its rate.
                moved = (v[own.step, place] - v[own.step + 1, place]) / grid.step_s
                right[:, place, 1 + k] += own.placed(weight * moved, n)
                S[k, k] += np.sum(weight * moved**2)
                rows[:, k] += np.bincount(own.step, weight * moved * e, n - 1)
        flat = right.reshape(n * ns, -1)
        solved = solveh_banded(_banded(D, L, L2), flat, lower=True, check_finite=False)
        # A random probe of each state estimates the trace: how many of its numbers the fit takes.
        free -= np.sum(flat[:, 1 + u :] * solved[:, 1 + u :], axis=0).reshape(2, ns)
        S -= flat[:, 1 : u + 1].T @ solved[:, 1 : u + 1]
        s = rows.sum(axis=0) - flat[:, 1 : u + 1].T @ solved[:, 0]
        p = len(self.terms)
        steps = np.zeros((n * ns, 1 + p))
        steps[:, 0], steps[:, 1 + used] = solved[:, 0], solved[:, 1 : u + 1]
        block = ((grid.times_s[:-1] - grid.times_s[0]) // BLOCK_S).astype(int)
        parts = [whitened.reshape(n - 1, ns, u)[block == one].reshape(-1, u) for one in np.unique(block)]
        scores = array([rows[block == one].sum(axis=0) for one in np.unique(block)])
        return Normal(
            _spread(0.5 * (S + S.T), used, p),
            _spread(s, used, p),
            array([_spread(one, used, p) for one in scores]),
            [_spread(one.T @ one, used, p) for one in parts],
            free,
            [steps],
        )


def _spread(values: Array, used: Index, p: int) -> Array:
    """Numbers of the parameters that are used, among all p; a vector or a square."""
    out = np.zeros([p] * values.ndim)
    out[np.ix_(*[used] * values.ndim)] = values
    return out


def _blocks(d: _Dependence, W: Array) -> tuple[Array, Array, Array]:
    """Blocks of the matrix of the states by the unknown forces: its diagonal, and the two below it."""
    n, ns = len(d.w) + 1, d.w.shape[1]
    late, mid = ((W[:, None] * one).transpose(0, 2, 1) for one in (d.late, d.mid))
    D, L, L2 = np.zeros((n, ns, ns)), np.zeros((n - 1, ns, ns)), np.zeros((n - 2, ns, ns))
    D[1:] += late @ d.late
    D[:-1] += mid @ d.mid
    D[:-2] += ((W[:, None] * d.old).transpose(0, 2, 1) @ d.old)[1:]
    L += late @ d.mid
    L[:-1] += (mid @ d.old)[1:]
    L2 += (late @ d.old)[1:]
    return D, L, L2


def _banded(*blocks: Array) -> Array:
    """Lower band of a matrix of square blocks: those of its diagonal (n, s, s), and of each one below it."""
    n, s, _ = blocks[0].shape
    out = np.zeros((len(blocks) * s, n * s))
    for below, block in enumerate(blocks):
        for a in range(s):
            for b in range(s):
                if below or a >= b:
                    out[below * s + a - b, b : (n - below) * s : s] = block[:, a, b]
    return out
