"""Maximum-likelihood split of residuals into measurement noise and unknown force.

The Kalman filter of `whitening` runs over many short pieces of the record and many candidates at once, which maps the
whole likelihood, so none of its several maxima is missed.

Symbols are those of `whitening`. The unknowns are not the four variances of `Noise` but, because the likelihood is then
smooth and its scale can be maximized in closed form:

    ratio  decades of (mean density of the unknown acceleration / variance of the main channel)
    part   share of that density that grows with the thrust, 0 to 1
    other  decades of (variance of positions / of velocities), where both are measured

The main channel is the velocity, or the position where there is no velocity. g candidates are filtered side by side, so
arrays of the filter are (pieces, g).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hindrax_ident.arrays import Array, Flags, Index
from hindrax_ident.fit.whitening import ErrorDynamics, Noise, transitions
from hindrax_ident.model.thrust_lag import LEAST_MEMORY_S

ENOUGH_SAMPLES = 5000
"""Samples sufficient to estimate the noise; a longer record is subsampled by pieces."""
PIECE = 200
"""Samples per piece: long compared with the memory of the motion."""
DECADES = (-7.0, 3.0)
"""Range of the search, in decades of the ratio of force noise to measurement noise."""
START_VARIANCE = 1e3
"""Variance of the velocity and the position at the start of a piece, in units of the measurement's."""
FLOORS = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Candidate densities independent of the thrust, as shares of the total estimate: a grid, finer towards none."""
PENALTY = 4.0
"""Penalty, in twice the negative log-likelihood, of an unknown force independent of the thrust. Chosen, not derived: as
much as one more parameter of no use gains in about one record of twenty (3.84)."""
ZOOMS = ((1.0, 7, 0.4, 5), (0.25, 5, 0.15, 5))
"""Half width and points of each refinement, in decades of the ratio and in shares of the thrust."""
OTHERS = np.linspace(-2.0, 2.0, 21)
"""Candidate variances of the other channel, in decades about the last one."""


class _Candidate(NamedTuple):
    """The three unknowns of the module's head, and the most likely variance of the main channel with them."""

    ratio: float
    part: float
    other: float
    variance: float


def fit_noise(chain: ErrorDynamics, residual: Array, before: Noise, *, given_position: bool = False) -> Noise:
    """Most likely split of a residual into measurement noise and unknown force.

    Parameters
    ----------
    chain
        Error dynamics between the n measurements.
    residual : (n,) [m/s, rad/s, m, rad]
        Measured minus simulated.
    before
        Noise of the last round, about which the variance of positions is searched.
    given_position
        Whether the variance of positions stays as it is.

    Returns
    -------
    Noise
        Of the largest likelihood over the candidates of the module's head.
    """
    # The variance of the positions is found in turns with the other two: all three at once would be a grid of 21 times
    # as many candidates, and one turn moves it by less than the spacing of OTHERS.
    main = _main(chain)
    both = bool(np.any(chain.channel != main)) and not given_position
    pieces = _Pieces(chain, residual, main)
    best = _ratio_and_part(pieces, math.log10(before.position / before.velocity))
    if both:
        best = _best(pieces, [best.ratio], [best.part], best.other + OTHERS)
        best = _ratio_and_part(pieces, best.other)
        best = _best(pieces, [best.ratio], [best.part], best.other + OTHERS)
    found = pieces.noise(best)
    return replace(found, position=before.position) if given_position and main == 0 else found


def _main(chain: ErrorDynamics) -> int:
    """Channel of the velocities, or of the positions where there are no velocities."""
    return int(not np.any(chain.channel == 0))


def _ratio_and_part(pieces: _Pieces, other: float) -> _Candidate:
    """Search the whole range, then refine around the best."""
    best = _best(pieces, np.linspace(*DECADES, 11), np.linspace(0.0, 1.0, 3), [other])
    for half, points, half_part, points_part in ZOOMS:
        ratios = np.clip(best.ratio + np.linspace(-half, half, points), *DECADES)
        parts = np.clip(best.part + np.linspace(-half_part, half_part, points_part), 0.0, 1.0)
        # At an end of the range, where the best often lies, several become one.
        best = _best(pieces, np.unique(ratios), np.unique(parts), [other])
    return best


def _best(pieces: _Pieces, ratios: ArrayLike, parts: ArrayLike, others: ArrayLike) -> _Candidate:
    """Most likely of all combinations, in the units of `_Pieces.scores`."""
    ratio, part, other = (one.ravel() for one in np.meshgrid(ratios, parts, others, indexing="ij"))
    scores, variances = pieces.scores(ratio, part, other)
    best = int(np.argmin(scores))
    return _Candidate(float(ratio[best]), float(part[best]), float(other[best]), float(variances[best]))


def disturbance_profile(chain: ErrorDynamics, residual: Array, noise: Noise, thrusts: Array) -> tuple[Array, Array]:
    """Likelihood of a residual over densities of the thrust noise; the variances of the measurements stay fixed.

    For a fit over several motions: the thrust noise is one of the thrusters, so their profiles add up, while each
    motion has unknown forces of its own, over which its profile is maximized here. Of two explanations that are as
    likely, the one without such forces counts (PENALTY).

    Parameters
    ----------
    chain
        Error dynamics between the n measurements of one motion.
    residual : (n,) [m/s, rad/s, m, rad]
        Measured minus simulated.
    noise
        Variances of the measurements, and the total density that is shared out.
    thrusts : (m,) [s]
        Candidate densities, per squared acceleration due to the thrusters.

    Returns
    -------
    tuple[Array, Array]
        Twice the negative log-likelihood (m,), and the most likely density of the other unknown acceleration (m,)
        [m^2/s^3, rad^2/s^3].
    """
    main = _main(chain)
    pieces = _Pieces(chain, residual, main)
    size = noise.velocity if main == 0 else noise.position
    forces = (noise.force + noise.thrust * pieces.mean_thrust) * np.array(FLOORS)
    candidates, beside = np.meshgrid(thrusts, forces, indexing="ij")
    other = np.full(candidates.size, math.log10(noise.position / noise.velocity))
    squares, logs, n = pieces.filtered(beside.ravel() / size, candidates.ravel() / size, other)
    cost = (squares / size + logs + n * math.log(size)).reshape(candidates.shape) + PENALTY * (forces > 0.0)
    best = cost.argmin(axis=1)
    # Pieces sample a long record: scale the cost to all of it.
    return cost.min(axis=1) * (chain.counts.sum() / n), forces[best]


def _piece_rows(starts: Flags) -> tuple[Index, Flags]:
    """Rows of each piece, (length, pieces), and which of them exist: pieces end with their stretch."""
    edges = np.append(np.flatnonzero(starts), len(starts))
    firsts, ends = [], []
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        cut = list(range(begin, end, PIECE))
        firsts += cut
        ends += [*cut[1:], end]
    # Every so many pieces over the whole record, rather than its beginning: noise differs between slow and fast legs.
    every = max(1, round(len(starts) / ENOUGH_SAMPLES))
    first, end = np.array(firsts[::every]), np.array(ends[::every])
    rows = first + np.arange(int((end - first).max()))[:, None]
    return np.minimum(rows, end - 1), rows < end


class _Pieces:
    """Pieces of a chain side by side: (length, pieces) each; missing samples at the end of a piece do not count."""

    def __init__(self, chain: ErrorDynamics, residual: Array, main: int) -> None:
        rows, present = _piece_rows(chain.starts)
        A, Q = transitions(chain)
        # (length, 3, 3, pieces, 1), for all candidates.
        self._A, self._Q = (np.moveaxis(one[rows], 1, -1)[..., None].copy() for one in (A, Q))
        self._channel, self._counts = chain.channel[rows], chain.counts[rows] & present
        self._thrust, self._residual = chain.thrust[rows], residual[rows]
        self.mean_thrust = max(1e-300, float(self._thrust.mean()))
        self._memory_s, self._main = max(LEAST_MEMORY_S, chain.memory_s), main

    def scores(self, ratio: Array, part: Array, other: Array) -> tuple[Array, Array]:
        """Twice the negative log-likelihood per sample, and the main channel's variance: (g,) each.

        Of candidates, (g,) each, for a main channel of unit variance. `ratio`: decades of the mean density of the
        unknown acceleration; `part`: share proportional to the thrust; `other`: decades of the variance of positions
        where velocities are the main channel. The likelihood is maximized over the scale of the noise.
        """
        # With variances in units of the main channel's, sigma^2 = squares / n maximizes the likelihood over the scale;
        # put in, what is left is n log sigma^2 + sum of log S + n.
        total = np.where(ratio <= DECADES[0], 0.0, 10.0**ratio)
        squares, logs, n = self.filtered(total * (1.0 - part), total * part / self.mean_thrust, other)
        return np.log(np.maximum(1e-300, squares / n)) + logs / n, squares / n

    @np.errstate(over="ignore", invalid="ignore")  # see `transitions`
    def filtered(self, force: Array, thrust: Array, other: Array) -> tuple[Array, Array, int]:
        """Sums of squared normalized innovations, (g,), and of log variances, (g,), and their number.

        For densities `force` and `thrust` (see `Noise`), in units of the main channel's variance, (g,) each. Both are
        infinite where the filter diverges: such a candidate is never the most likely one.
        """
        # The recursion of `whitening.gains` and of its state (v, s, a) together, one entry per piece and candidate.
        # Arrays are small, so what counts is how many operations a step has: the covariance and, as a fourth column,
        # the state are one array X, (3, 4, pieces, g). Its upper triangle alone is computed, and mirrored to be read.
        # A piece begins in the middle of a motion, so its state is unknown: variances of START_VARIANCE, not zero.
        density = force + self._thrust[:, :, None] * thrust
        variances = np.ones_like([force, force])
        variances[1 - self._main] = 10.0**other
        X = np.zeros((3, 4, *density[0].shape))
        X[0, 0] = X[1, 1] = START_VARIANCE * variances.max(axis=0)
        X[2, 2] = density[0] / (2.0 * self._memory_s)
        squares = logs = np.zeros(len(force))
        both = bool(np.any(self._channel != self._main))
        for k, (A, Q, q) in enumerate(zip(self._A, self._Q, density, strict=True)):
            if k:
                # P = A X of velocity and position; then P A' + Q q. The acceleration depends on itself alone.
                A0, A1, A2, A22 = A[:2, 0], A[:2, 1], A[:2, 2], A[2, 2]
                P = A0[:, None] * X[0] + A1[:, None] * X[1] + A2[:, None] * X[2]
                noise = Q * q
                X[:2, :2] = P[:, 0, None] * A0 + P[:, 1, None] * A1 + P[:, 2, None] * A2 + noise[:2, :2]
                X[:2, 2] = P[:, 2] * A22 + noise[:2, 2]
                X[:2, 3] = P[:, 3]
                X[2, 2] = A22 * A22 * X[2, 2] + noise[2, 2]
                X[2, 3] *= A22
                X[1, 0] = X[0, 1]
            channel, counts = self._channel[k], self._counts[k][:, None]
            if both:
                is_position = channel[:, None] == 1
                row = np.where(is_position, X[1], X[0])
                total = np.where(is_position, row[1], row[0]) + variances[channel]
            else:
                row = X[self._main].copy()
                total = row[self._main] + variances[self._main]
            row[3] -= self._residual[k][:, None]
            weighted = counts * row[3]
            squares, logs = squares + weighted * row[3] / total, logs + counts * np.log(total)
            gain = row[:3] * (counts / total)
            X -= gain[:, None] * row
            X[1, 0], X[2, :2] = X[0, 1], X[:2, 2]
        squared, log = squares.sum(axis=0), logs.sum(axis=0)
        # Where the variances are finite, so are the errors.
        diverged = ~np.isfinite(log)
        return np.where(diverged, np.inf, squared), np.where(diverged, np.inf, log), int(self._counts.sum())

    def noise(self, found: _Candidate) -> Noise:
        """Noise of these unknowns, scaled to the residuals."""
        size = max(1e-18, found.variance)
        total = 0.0 if found.ratio <= DECADES[0] else size * 10.0**found.ratio
        position = size * 10.0**found.other if self._main == 0 else size
        return Noise(size, position, total * (1.0 - found.part), total * found.part / self.mean_thrust)
