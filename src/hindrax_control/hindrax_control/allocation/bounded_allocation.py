"""The largest part of a wrench that the thrusters can give within their limits, in order of priority.

The axes of the first priority want the wrench w_1, those of the second w_2. Wanted: first the largest s_1, then the
largest s_2, both between 0 and 1, for which forces within their limits give s_1 w_1 + s_2 w_2. Each priority keeps its
direction and loses magnitude only as far as it must.

Such forces exist exactly where every facet of the attainable set is kept. A facet is a sum y'f over as few thrusters
as a sum can have that no pattern without wrench changes: the wrench alone decides it, and it must lie between the
least and the most that the limits allow. Every other such sum is one of these without cancellation (elementary vectors
of a subspace, Rockafellar 1969), so it is kept with them. The facets are worked out once for a set of thrusters; each
demand leaves a linear program in two unknowns: see `_newton`.

Symbols. m thrusters in use, with forces f [N] within low <= f <= high, and B (6, m) of `effectiveness`. The k patterns
without wrench span the null space of B: f + pattern makes the same wrench as f. A facet y (m,) is orthogonal to all of
them, so y'f = y'B+ w depends on the wrench w alone. B+ is the pseudo-inverse: B+ w are the least forces that give w,
those with the smallest sum of squares, within their limits or not. There are comb(m, k + 1) of them at
most, 56 for the eight thrusters of the Hindrax, of which 12 differ.

A solver of linear programs gives the same answer (a test holds it against one), in a time that depends on the demand:
ADR 23.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import TypeAlias

import numpy as np

from hindrax_control.allocation.deadband_bias import Interval
from hindrax_control.allocation.effectiveness import Matrix, ThrusterLayout

DEPENDENT = 1e-9
"""Thrusters whose shares in the patterns depend on each other up to this make no facet of their own: others decide the
same to this fraction of a force."""

DIGITS = 12
"""Decimals of a facet, whose largest entry is one: rounding leaves a few 1e-16 where geometry has zero."""

SLACK_N = 1e-9
"""By so much a facet may be passed to serve the first priority, and by so much again for the second. Else rounding
(1e-12 N) would decide where a demand lies on a facet: all of the second, or nothing. Small against `ROUNDING_N`."""

FITTED_N = 1e-6
"""Forces closer to their limits than this are at them: a pulse's rounding is 1e4 times as large."""

Row: TypeAlias = tuple[float, float, float, float]
"""low <= a s_1 + b s_2 <= high, as (a, b, low, high), b not below zero."""


def facets(patterns: Matrix) -> Matrix:
    """Facets of what thrusters can give, whatever is added of their patterns without wrench.

    Of any k + 1 thrusters, the patterns have k columns, so one sum over those thrusters is blind to all k patterns: the
    left singular vector without a singular value. Where the columns depend on each other there are several such sums,
    and each is found again over fewer thrusters. Opposite and repeated rows are one facet: the largest entry is made 1.

    Parameters
    ----------
    patterns : (m, k) [-]
        Forces of m thrusters that give no wrench together, as columns.

    Returns
    -------
    Matrix
        (F, m) [-]: each row a sum of forces that no pattern changes.
    """
    m, k = patterns.shape
    if k == 0:
        return np.eye(m)
    chosen = np.array(list(combinations(range(m), k + 1)))
    left, singular, _ = np.linalg.svd(patterns[chosen])
    rows = np.zeros((len(chosen), m))
    np.put_along_axis(rows, chosen, left[:, :, -1], axis=1)
    rows = rows[singular[:, -1] > DEPENDENT]
    largest = np.take_along_axis(rows, np.argmax(np.abs(rows), axis=1)[:, None], axis=1)
    # Minus zero and zero are different bytes to `unique`.
    found: Matrix = np.unique(np.round(rows / largest, DIGITS) + 0.0, axis=0)
    return found


class AttainableSet:
    """All wrenches that the thrusters of one layout can give within their limits, which include zero force."""

    def __init__(self, layout: ThrusterLayout, limits_N: Sequence[Interval]) -> None:
        self._limits = np.array(limits_N, dtype=float).reshape(-1, 2).T
        patterns = np.zeros((len(layout.used), len(layout.patterns)))
        for j, pattern in enumerate(layout.patterns):
            for index, share in pattern.shares:
                patterns[index, j] = share
        # A demand is w = s_1 w_1 + s_2 w_2; facet y allows low <= s_1 a + s_2 b <= high, with a and b its share in each
        # group's least forces. Rows that the second group does not touch bound s_1 alone: their a over the limit are
        # ratios, of which the largest above one is what s_1 has to be divided by. All that is linear in the demand is
        # one matrix, so that a demand costs one product and a few comparisons in Python's own numbers.
        rows = facets(patterns)
        low, high = _ranges(rows, self._limits)
        low, high = low - SLACK_N, high + SLACK_N
        first, second = (_of_group(layout, group) for group in (*layout.groups, (), ())[:2])
        a, b = np.round(rows @ first, DIGITS), np.round(rows @ second, DIGITS)
        shared = np.any(b, axis=1)
        alone = [a[~shared] / end[~shared, None] for end in (low, high)]  # one is the limit
        # Its rows: ratios at low and at high | a | b of the shared rows | least forces of each group. `_ends` are the
        # three ends (|); what follows the last is half first, half second.
        parts = [*alone, a[shared], b[shared], first, second]
        self._ends = np.cumsum([len(part) for part in parts])[1:4].tolist()
        self._gains = np.ascontiguousarray(np.vstack(parts))
        self._ranges = list(zip(low[shared].tolist(), high[shared].tolist(), strict=True))
        self._stages = [
            _stage(column, facets(patterns[:, j + 1 :]), self._limits) for j, column in enumerate(patterns.T)
        ]

    def forces(self, wrench: Sequence[float]) -> list[float]:
        """Return the least forces that give the largest part of a wrench [N, N m] that can be had."""
        # Rows that hold wherever both parts are given whole, or one of them, need no look: s_1, s_2 <= 1 and all bounds
        # are linear, so only corners can break them. A demand within reach leaves none.
        values: list[float] = self._gains.dot(wrench).tolist()
        alone, shared, seconds = self._ends
        first = 1.0 / max([1.0, *values[:alone]])
        rows = []
        for one, other, (least, most) in zip(values[alone:shared], values[shared:seconds], self._ranges, strict=True):
            row = a, b, low, high = (one, other, least, most) if other >= 0.0 else (-one, -other, -most, -least)
            if a + b > high or b > high or a < low:
                rows.append(row)
        first, second = _largest(first, rows)
        middle = (len(values) + seconds) // 2
        return [
            first * one + second * other for one, other in zip(values[seconds:middle], values[middle:], strict=True)
        ]

    def fitted(self, forces_N: Sequence[float]) -> tuple[list[float], bool]:
        """Bring forces within limits without a change of their wrench: pattern by pattern the size that moves least.

        Fourier and Motzkin's elimination, prepared once: the facets of the patterns after this one say how far it may
        go so that those can still mend the rest.

        Parameters
        ----------
        forces_N : (thrusters,) [N]
            With the wanted wrench.

        Returns
        -------
        tuple[list[float], bool]
            Forces, and whether they are within limits; where no such forces exist, they are as near as can be.
        """
        forces = np.array(forces_N)
        for pattern, rows, slopes, low, high in self._stages:
            at = rows @ forces
            ends = (low - at) / slopes, (high - at) / slopes
            least, most = np.max(np.minimum(*ends)), np.min(np.maximum(*ends))
            forces += pattern * min(max(0.0, least), most)
        least_N, most_N = self._limits
        clipped = np.clip(forces, least_N, most_N)
        found: list[float] = clipped.tolist()
        return found, bool(np.max(np.abs(clipped - forces), initial=0.0) <= FITTED_N)


def _largest(first: float, rows: Sequence[Row]) -> tuple[float, float]:
    """Return the largest s_1 up to `first` that leaves room for an s_2 between 0 and 1, and the largest such s_2."""
    for a, _, low, high in [row for row in rows if row[1] <= SLACK_N]:  # the second part has no effect here
        if a * first > high:
            first = high / a
        elif a * first < low:
            first = low / a
    return _newton(first, [row for row in rows if row[1] > SLACK_N])


def _newton(first: float, steep: Sequence[Row]) -> tuple[float, float]:
    """Return the largest s_1 up to `first` that leaves room for s_2, and the largest s_2 there.

    The room is the least upper less the greatest lower bound of s_2: concave in s_1, in straight pieces, not negative
    at zero. Newton's method from above goes to where two of the bounds meet, each time to the left of the last, so no
    two bounds come twice: it ends after as many steps as there are pieces, usually one or two. The bounds meet without
    the slack by which they are compared: what has met counts as met, whatever the rounding.
    """
    while True:
        most, a_most, b_most, c_most = 1.0, 0.0, 1.0, 1.0
        least, a_least, b_least, c_least = 0.0, 0.0, 1.0, 0.0
        for a, b, low, high in steep:
            at = a * first
            bound = (high + SLACK_N - at) / b
            if bound < most:
                most, a_most, b_most, c_most = bound, a, b, high
            bound = (low - SLACK_N - at) / b
            if bound > least:
                least, a_least, b_least, c_least = bound, a, b, low
        slope = b_least * a_most - b_most * a_least
        if least <= most or slope <= 0.0:
            break
        meeting = (b_least * c_most - b_most * c_least) / slope
        if not 0.0 <= meeting < first:  # only where the limits leave nothing at all
            break
        first = meeting
    return first, max(0.0, most)


def _of_group(layout: ThrusterLayout, group: Sequence[int]) -> Matrix:
    """Least forces per unit wrench on the axes of one group: (m, 6), columns [-]*3, [1/m]*3."""
    return np.where(np.isin(np.arange(6), group), layout.pseudo_inverse, 0.0)


def _ranges(rows: Matrix, limits: Matrix) -> tuple[Matrix, Matrix]:
    """Lower and upper bounds [N] of each facet, two arrays (F,), for facets (F, m) [-] and limits (2, m) [N]."""
    ends = rows * limits[:, None, :]
    low, high = np.minimum(*ends).sum(axis=1), np.maximum(*ends).sum(axis=1)
    return low, high


def _stage(pattern: Matrix, rows: Matrix, limits: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix, Matrix]:
    """Pattern (m,), the facets (G, m) that limit its size, their slopes (G,) [-], and their bounds (G,), (G,) [N]."""
    slopes = rows @ pattern
    limiting = np.abs(slopes) > DEPENDENT
    return (pattern, rows[limiting], slopes[limiting], *_ranges(rows[limiting], limits))
