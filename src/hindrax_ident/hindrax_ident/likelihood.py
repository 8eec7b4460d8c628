"""How much of a residual is measurement noise, and how much unknown force: the most likely noise.

The Kalman filter of `whitening` runs over many short pieces of the record and many candidates at once, so that the
whole likelihood is mapped and none of its several maxima is missed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.whitening import LEAST_MEMORY_S, Chain, Noise, transitions

ENOUGH = 5000
"""Samples that are enough to find the noise; from a longer record pieces are taken all over it."""
PIECE = 200
"""Samples per piece: long against the memory of the motion."""
DECADES = (-7.0, 3.0)
"""Decades of the ratio of force noise to measurement noise in which it is sought."""
ROUNDS = 2
WIDE = 1e3
"""Variance of the velocity and the position at the start of a piece, in units of the measurement's."""
MOVES = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 2))
"""Elements of a transition that are not zero."""
FLOORS = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Densities that do not go with the thrust, as shares of all that was found."""
DOUBT = 4.0
"""By how much an unknown force besides the thrust's must lower twice the logarithm before it is believed."""
ZOOMS = ((1.0, 7, 0.4, 5), (0.25, 5, 0.15, 5))
"""Half width and points of each closer look, in decades of the ratio and in parts of the thrust."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Noises to try, (g,) each, for a main channel of unit variance.

    `ratio`: decades of the mean density of the unknown acceleration; `part` of it that goes with the thrust; `other`:
    decades of the variance of positions where velocities are the main channel.
    """

    ratio: Array
    part: Array
    other: Array

    def one(self, index: int) -> tuple[float, float, float]:
        """Unknowns of one candidate."""
        return float(self.ratio[index]), float(self.part[index]), float(self.other[index])


def fit_noise(chain: Chain, residual: Array, before: Noise, *, given_position: bool = False) -> Noise:
    """Most likely noise of a residual (n,). With `given_position` the variance of the positions stays what it was."""
    main = 0 if bool(np.any(chain.channel == 0)) else 1
    both = bool(np.any(chain.channel != main)) and not given_position
    pieces = _Pieces(chain, residual, main)
    other = math.log10(before.position / before.velocity) if main == 0 else 0.0
    ratio, part = 0.0, 0.5
    for _ in range(ROUNDS if both else 1):
        ratio, part = _ratio_and_part(pieces, other)
        if both:
            spread = array(other + np.linspace(-2.0, 2.0, 21))
            tried = Candidates(np.full(21, ratio), np.full(21, part), spread)
            *_, other = tried.one(int(np.argmin(pieces.scores(tried)[0])))
    found = pieces.noise(ratio, part, other)
    return replace(found, position=before.position) if given_position and main == 0 else found


def _ratio_and_part(pieces: _Pieces, other: float) -> tuple[float, float]:
    """Look at the whole range first, then closer and closer at the best."""
    ratio, part = _best(pieces, array(np.linspace(*DECADES, 11)), array(np.linspace(0.0, 1.0, 3)), other)
    for half, points, half_part, points_part in ZOOMS:
        ratios = np.clip(ratio + np.linspace(-half, half, points), *DECADES)
        parts = np.clip(part + np.linspace(-half_part, half_part, points_part), 0.0, 1.0)
        ratio, part = _best(pieces, ratios, parts, other)
    return ratio, part


def _best(pieces: _Pieces, ratios: Array, parts: Array, other: float) -> tuple[float, float]:
    """Most likely of all pairs."""
    grid = np.meshgrid(ratios, parts, indexing="ij")
    tried = Candidates(grid[0].ravel(), grid[1].ravel(), np.full(grid[0].size, other))
    ratio, part, _ = tried.one(int(np.argmin(pieces.scores(tried)[0])))
    return ratio, part


@dataclass(frozen=True, slots=True)
class GustProfile:
    """How likely a record is for each of several gust densities of the thrust [s]: (m,) each.

    `cost` is twice the negative logarithm of the likelihood, `force` the density of the other unknown acceleration
    that goes best with each.
    """

    cost: Array
    force: Array


def gust_profile(chain: Chain, residual: Array, noise: Noise, thrusts: Array) -> GustProfile:
    """Profile of a residual (n,) over `thrusts` (m,) [s]; the measurements' variances stay what they are."""
    main = 0 if bool(np.any(chain.channel == 0)) else 1
    pieces = _Pieces(chain, residual, main)
    size = noise.velocity if main == 0 else noise.position
    forces = array((noise.force + noise.thrust * pieces.mean_thrust) * np.array(FLOORS))
    tried, beside = np.meshgrid(thrusts, forces, indexing="ij")
    other = np.full(tried.size, math.log10(noise.position / noise.velocity) if main == 0 else 0.0)
    squares, logs, n = pieces.filtered(beside.ravel() / size, tried.ravel() / size, other)
    cost = (squares / size + logs + n * math.log(size)).reshape(tried.shape) + DOUBT * (forces > 0.0)
    best = cost.argmin(axis=1)
    # Pieces are taken all over a long record: they stand for all of it.
    return GustProfile(array(cost.min(axis=1) * (chain.counts.sum() / n)), array(forces[best]))


def _piece_rows(starts: Flags) -> tuple[Index, Flags]:
    """Rows of each piece, (length, pieces), and which of them are there: pieces end with their stretch."""
    edges = np.append(np.flatnonzero(starts), len(starts))
    firsts, ends = [], []
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        cut = list(range(begin, end, PIECE))
        firsts += cut
        ends += [*cut[1:], end]
    every = max(1, round(len(starts) / ENOUGH))
    first, end = np.array(firsts[::every]), np.array(ends[::every])
    rows = first + np.arange(int((end - first).max()))[:, None]
    return np.minimum(rows, end - 1), rows < end


class _Pieces:
    """Pieces of a chain side by side: (length, pieces) each; what is missing at the end of a piece does not count."""

    def __init__(self, chain: Chain, residual: Array, main: int) -> None:
        rows, present = _piece_rows(chain.starts)
        A, Q = transitions(chain)
        self._A, self._Q = A[rows], Q[rows]
        self._place, self._counts = chain.channel[rows], chain.counts[rows] & present
        self._thrust, self._residual = chain.thrust[rows], residual[rows]
        self.mean_thrust = max(1e-300, float(self._thrust.mean()))
        self._memory_s, self._main = max(LEAST_MEMORY_S, chain.memory_s), main

    def scores(self, tried: Candidates) -> tuple[Array, Array]:
        """Twice the negative logarithm of the likelihood per sample, and the main channel's variance: (g,) each.

        The size of the noise drops out of the likelihood: the most likely one is put in.
        """
        total = np.where(tried.ratio <= DECADES[0], 0.0, 10.0**tried.ratio)
        gust = total * tried.part / self.mean_thrust
        squares, logs, n = self.filtered(total * (1.0 - tried.part), gust, tried.other)
        return np.log(np.maximum(1e-300, squares / n)) + logs / n, squares / n

    def filtered(self, force: Array, thrust: Array, other: Array) -> tuple[Array, Array, int]:
        """Sums of the squared innovations over their variances and of the variances' logarithms, (g,); and how many.

        For densities `force` and `thrust` (see `Noise`), in units of the main channel's variance, (g,) each.
        """
        density = force + self._thrust[:, :, None] * thrust
        variances = np.ones((2, len(force)))
        variances[1 - self._main] = 10.0**other
        shape = density.shape[1:]
        vv = ss = np.broadcast_to(WIDE * variances.max(axis=0), shape)
        vs = va = sa = v = s = a = np.zeros(shape)
        aa = density[0] / (2.0 * self._memory_s)
        squares, logs = np.zeros(shape), np.zeros(shape)
        for k, (A, Q, q) in enumerate(zip(self._A[:, :, :, :, None], self._Q[:, :, :, :, None], density, strict=True)):
            if k:
                A00, A01, A02, A10, A11, A12, A22 = (A[:, i, j] for i, j in MOVES)
                pv, ps, pa = (
                    A00 * vv + A01 * vs + A02 * va,
                    A00 * vs + A01 * ss + A02 * sa,
                    A00 * va + A01 * sa + A02 * aa,
                )
                rv, rs, ra = (
                    A10 * vv + A11 * vs + A12 * va,
                    A10 * vs + A11 * ss + A12 * sa,
                    A10 * va + A11 * sa + A12 * aa,
                )
                v, s, a = A00 * v + A01 * s + A02 * a, A10 * v + A11 * s + A12 * a, A22 * a
                vv, vs = (
                    pv * A00 + ps * A01 + pa * A02 + Q[:, 0, 0] * q,
                    pv * A10 + ps * A11 + pa * A12 + Q[:, 0, 1] * q,
                )
                va, ss = pa * A22 + Q[:, 0, 2] * q, rv * A10 + rs * A11 + ra * A12 + Q[:, 1, 1] * q
                sa, aa = ra * A22 + Q[:, 1, 2] * q, A22 * A22 * aa + Q[:, 2, 2] * q
            placed, counts = self._place[k][:, None] == 1, self._counts[k][:, None]
            hv, hs, ha = np.where(placed, vs, vv), np.where(placed, ss, vs), np.where(placed, sa, va)
            total = np.where(placed, hs, hv) + variances[self._place[k]]
            error = self._residual[k][:, None] - np.where(placed, s, v)
            squares, logs = squares + counts * error * error / total, logs + counts * np.log(total)
            weight = counts / total
            kv, ks, ka = hv * weight, hs * weight, ha * weight
            v, s, a = v + kv * error, s + ks * error, a + ka * error
            vv, vs, va = vv - kv * hv, vs - kv * hs, va - kv * ha
            ss, sa, aa = ss - ks * hs, sa - ks * ha, aa - ka * ha
        return squares.sum(axis=0), logs.sum(axis=0), int(self._counts.sum())

    def noise(self, ratio: float, part: float, other: float) -> Noise:
        """Noise of these unknowns, at the size that the residual has."""
        _, sizes = self.scores(Candidates(np.array([ratio]), np.array([part]), np.array([other])))
        size = max(1e-18, float(sizes[0]))
        total = 0.0 if ratio <= DECADES[0] else size * 10.0**ratio
        position = size * 10.0**other if self._main == 0 else size
        return Noise(size, position, total * (1.0 - part), total * part / self.mean_thrust)
