"""Normal equations of all six axes of a record: velocities of every step and parameters, linearized.

Symbols, for one stretch with a grid of times t_0 ... t_n-1 and the step h:

    v_k       state at t_k: velocities of the axes of the record, and a depth where there is one
    theta     parameters: lag, latencies, and the factor of each `Term`
    w_k       unknown force of step k: M (v_k+1 - v_k)/h + [C(M) v + sum theta_i f_i - tau], in the middle of the step
    e_k       what is new in it: w_k = kept w_k-1 + e_k, an autoregressive process with innovations e ~ N(0, Q)
    y_j       measurement between two grid times: (1 - part) v_k + part v_k+1 + r_j, with r ~ N(0, R)

The most probable motion and parameters together minimize  J = sum e'Q^-1 e + sum r'R^-1 r + (the distance of theta from
its prior). So motion is neither integrated from an assumed start (which diverges where a law is wrong) nor taken from
noisy differences: it is a smoother whose model has parameters. One Gauss-Newton step about the present v and theta:

    | A  B | |dv    |   |a|      A = E'Q^-1 E + H'R^-1 H,   E = de/dv, H = dy/dv     (states)
    | B' C | |dtheta| = |c|      B, C likewise with the columns de/dtheta            (parameters)

e_k depends on v_k+1, v_k and v_k-1, so A is a band of blocks two wide, and a stretch of an hour is solved in time
proportional to its length. Its elimination (the Schur complement) leaves the parameters:

    S = C - B'A^-1 B,   s = c - B'A^-1 a,   S dtheta = s,   dv = A^-1 a - A^-1 B dtheta
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
    """Variance of white noise from differences of an order: of white noise it is (2m over m) times the variance.

    A motion that is smooth over a few samples vanishes in them; of the orders, the least has least of the motion left.
    """
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
    """Steps of a stretch: state in the middle of each, M of the axes, w (n - 1, states), M^-1 (tau - resisting)."""

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


class _Jacobian(NamedTuple):
    """Innovations e_k of a stretch and their derivatives: the three blocks that each row of E has, and those by theta.

    `end`, `begin`, `earlier` (n - 1, states, states): de_k by v_k+1, v_k and v_k-1; `columns` (n - 1, states, u): by
    the parameters in use; `e` (n - 1, states): their values.
    """

    end: Array
    begin: Array
    earlier: Array
    columns: Array
    e: Array

    def transposed_times(self, weighted: Array) -> Array:
        """E' times numbers of each step (n - 1, states, k): (n, states, k), a sum over the rows that have a state."""
        out = np.zeros((len(self.e) + 1, *weighted.shape[1:]))
        end, begin, earlier = (one.transpose(0, 2, 1) @ weighted for one in (self.end, self.begin, self.earlier))
        out[1:] += end
        out[:-1] += begin
        out[:-2] += earlier[1:]
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

    def normal(self, velocities: Sequence[Array], *, all_terms: bool = False, as_measured: bool = False) -> Normal:
        """Normal equations of the parameters, summed over the stretches.

        Parameters
        ----------
        velocities : (n, states) each
            Motion of each stretch about which is linearized.
        all_terms
            Whether terms that are not in now have their columns too: for the odds.
        as_measured
            Whether masses act on differences of the velocities: before the first fit the model knows no better.

        Returns
        -------
        Normal
            S (p, p) and s (p,), with the part of each block.
        """
        used = np.flatnonzero(self.kept | all_terms)
        # The same probes in each step: else the noise would never settle.
        rng = np.random.default_rng(0)
        stretches = zip(self.record.grids, velocities, strict=True)
        parts = [self._stretch(grid, v, used, rng, as_measured=as_measured) for grid, v in stretches]
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
            out[0] += np.sum(self._innovations(w) ** 2, axis=0)
            for place in range(v.shape[1]):
                if (own := self._measured(place, grid)) is not None:
                    r = own.errors(v[:, place])
                    out[1, place] += np.sum(self._robust(r, place) * r**2)
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
        # Of an autoregressive process the covariance falls by the same share with each span.
        share = np.divide(sums[1], sums[0], out=np.zeros_like(sums[0]), where=sums[0] > 0.0)
        # From the share over a span to that over a step, and never so near to 1 that a force would be a drift.
        found = np.minimum(np.maximum(share, 0.0) ** (1.0 / span), math.exp(-step_s / LONGEST_MEMORY_S))
        return np.where(np.arange(len(found)) < axes, found, 0.0)

    # ---- one stretch

    def _thrust(self, grid: Grid, lag_s: float) -> Array:
        """Mean thrust of each step: (n - 1, 6) [N, N m]."""
        r = self.record
        impulses = [LaggedThrust(r.wrench_t, one, lag_s, r.later_s).impulse(grid.times_s) for one in r.wrench.T]
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
        """Unknown force w of each step of a stretch, and what it was computed from.

        w = M (v_k+1 - v_k)/h + C(M) v + sum theta_i f_i - tau: what the step has beyond the model. Thrust is its mean
        over the step, after the lag; velocities are those of the middle.
        """
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

    def _innovations(self, w: Array) -> Array:
        """What is new in each step of unknown forces or of their derivatives, e_k = w_k - kept w_k-1: (n, states, ...).

        Linear in w, so the derivatives of e are those of w through the same function. All have the variance Q: before
        the first step there is none, so it has the stationary variance Q / (1 - kept^2), and is brought down to Q.
        """
        kept = self.noise.kept.reshape(-1, *[1] * (w.ndim - 2))
        out = w.copy()
        out[1:] -= kept * w[:-1]
        out[0] *= np.sqrt(1.0 - kept**2)
        return out

    def _robust(self, r: Array, place: int) -> Array:
        """Weights of measurement errors r: 1, beyond OUTLIER deviations one over the error (Huber 1964).

        So an outlier pulls no more than an error of that size would.
        """
        return array(np.minimum(1.0, OUTLIER * math.sqrt(self.noise.velocity[place]) / np.maximum(np.abs(r), 1e-12)))

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

    def _jacobian(self, grid: Grid, v: Array, used: Index, *, as_measured: bool) -> _Jacobian:
        """Innovations of the unknown forces, and their derivatives by states and parameters.

        With the slope F = d(resisting forces)/dv, taken by central differences in the middle of the step,

            dw_k/dv_k+1 = M/h + F/2,   dw_k/dv_k = -M/h + F/2,   and  de_k = dw_k - kept dw_k-1

        so e_k has v_k-1 in it, by the begin of the step before. By a parameter, w changes by the force of its term per
        unit; that of a mass is the acceleration. It comes from the model, v' = M^-1 (tau - resisting): the difference
        of noisy velocities would have noise in the regressor, which biases masses towards zero (errors in variables).
        So the fit does not end at the least of J in the masses, but where the likelihood is largest: what the column
        leaves out, M^-1 w, makes a gradient whose mean is that of log det dw/dv, which the likelihood has and J lacks.
        """
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
        w_by_end, w_by_begin = inertia + 0.5 * slope, -inertia + 0.5 * slope
        kept = self.noise.kept[:, None]
        end, begin, earlier = w_by_end.copy(), w_by_begin.copy(), np.zeros_like(w_by_begin)
        begin[1:] -= kept * w_by_end[:-1]
        earlier[1:] = -kept * w_by_begin[:-1]
        for one in (end, begin):
            one[0] *= np.sqrt(1.0 - kept**2)  # as `_innovations` has it
        acceleration = steps.predicted
        if as_measured:
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
        return _Jacobian(end, begin, earlier, self._innovations(columns), self._innovations(steps.w))

    def _stretch(self, grid: Grid, v: Array, used: Index, rng: np.random.Generator, *, as_measured: bool) -> Normal:
        """Normal equations of one stretch: S and s of its parameters, with the states eliminated.

        One factorization of the band A serves three kinds of right sides, side by side in `right`:

        - a, the step of the states where the parameters stay;
        - B, one column for each parameter in use;
        - E'Q^-1/2 z and H'R^-1/2 z with random signs z, for each state. By Hutchinson (1990) the expectation of
          z'(.)A^-1(.)z is a trace: how many of the innovations, and of the measurements, the fitted motion takes. The
          rest are the degrees of freedom by which sums of squares become variances (`Noise.updated`).

        `scores` and `shares` are s and C of blocks of time, without the elimination: how much they scatter tells
        whether the model is wrong by more than its noise (`scatter`).
        """
        (n, ns), u, W = v.shape, len(used), 1.0 / self.noise.force
        d = self._jacobian(grid, v, used, as_measured=as_measured)
        whitened = (d.columns * np.sqrt(W)[:, None]).reshape(-1, u)
        S, rows = whitened.T @ whitened, -np.matmul((W * d.e)[:, None, :], d.columns)[:, 0, :]
        weighted = np.concatenate([-d.e[:, :, None], d.columns], axis=2) * W[:, None]
        signs = rng.choice([-1.0, 1.0], (n - 1, ns))
        of_forces = signs[:, :, None] * np.eye(ns) * np.sqrt(W)[:, None]
        right = d.transposed_times(np.concatenate([weighted, of_forces, np.zeros((n - 1, ns, ns))], axis=2))
        D, L, L2 = _blocks(d, W)
        free = np.stack([np.full(ns, n - 1.0), np.zeros(ns)])
        for place in range(ns):
            if (own := self._measured(place, grid)) is None:
                continue
            r = own.errors(v[:, place])
            weight = self._robust(r, place) / self.noise.velocity[place]
            # A measurement between two states is their weighted mean, so it is in both diagonals and beside them.
            D[:, place, place] += np.bincount(own.step, weight * (1.0 - own.part) ** 2, n)
            D[:, place, place] += np.bincount(own.step + 1, weight * own.part**2, n)
            L[:, place, place] += np.bincount(own.step, own.part * (1.0 - own.part) * weight, n - 1)
            right[:, place, 0] += own.placed(weight * r, n)
            right[:, place, 1 + u + ns + place] = own.placed(np.sqrt(weight) * rng.choice([-1.0, 1.0], len(r)), n)
            free[1, place] = len(r)
            for k in np.flatnonzero(used == own.latency).tolist():
                # A latency moves the place at which the state is read: by its rate.
                moved = (v[own.step, place] - v[own.step + 1, place]) / grid.step_s
                right[:, place, 1 + k] += own.placed(weight * moved, n)
                S[k, k] += np.sum(weight * moved**2)
                rows[:, k] += np.bincount(own.step, weight * moved * r, n - 1)
        flat = right.reshape(n * ns, -1)
        solved = solveh_banded(_banded(D, L, L2), flat, lower=True, check_finite=False)
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


def _blocks(d: _Jacobian, W: Array) -> tuple[Array, Array, Array]:
    """Blocks of E'Q^-1 E, with W = 1 / Q: its diagonal D (n, s, s), and the first L and second L2 below it.

    Each e_k adds the squares of its three blocks to the diagonal, and their products below it: end by begin and begin
    by earlier next to it, end by earlier two below.
    """
    n, ns = len(d.e) + 1, d.e.shape[1]
    end, begin, earlier = ((W[:, None] * one).transpose(0, 2, 1) for one in (d.end, d.begin, d.earlier))
    D, L, L2 = np.zeros((n, ns, ns)), np.zeros((n - 1, ns, ns)), np.zeros((n - 2, ns, ns))
    D[1:] += end @ d.end
    D[:-1] += begin @ d.begin
    D[:-2] += (earlier @ d.earlier)[1:]
    L += end @ d.begin
    L[:-1] += (begin @ d.earlier)[1:]
    L2 += (end @ d.earlier)[1:]
    return D, L, L2


def _banded(*blocks: Array) -> Array:
    """Lower band of a matrix of square blocks, as LAPACK has it (`solveh_banded`): row i holds the i-th diagonal below.

    `blocks`: those of its diagonal (n, s, s), and of each one below it. Element (a, b) of a block `below` the diagonal
    is `below` s + a - b rows below it, in the column b of its block column; above the diagonal nothing is kept.
    """
    n, s, _ = blocks[0].shape
    out = np.zeros((len(blocks) * s, n * s))
    for below, block in enumerate(blocks):
        for a in range(s):
            for b in range(s):
                if below or a >= b:
                    out[below * s + a - b, b : (n - below) * s : s] = block[:, a, b]
    return out
