"""Bounded least squares for a wrench that the thrusters cannot give.

Axes of equal priority form a group; each group g has the wanted part d_g n_g (unit direction, magnitude, in weighted
axes; n_g no larger than all thrusters together could ever make) and gets the part s_g of its magnitude,
0 <= s_g <= n_g. Over forces f within their limits and parts s,

    |W B f - sum_g d_g s_g|^2  +  sum_g (c_g (n_g - s_g))^2  +  (c_free |N' f|)^2

is made least, W the axis weights, N the patterns without wrench. The grading 1 > c_1 > c_2 > ... > c_free makes the
order: first every group keeps its direction, then the first group gets all it can, then the next, and no force is
wasted on patterns that cancel. A step gives way to the one before by about the square of their ratio, of what is
missing: the direction of a wrench 100 N out of reach is wrong by a millinewton.

The unknowns are changed so that the Hessian is the identity: the wrench error e = W B f - sum d s, the scaled parts
and the scaled free sizes; the limits then become m general constraints. DAQP (Arnstrom, Bemporad, Axehill 2022)
solves such least-distance problems exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np

from hindrax_control.bias import Interval
from hindrax_control.effectiveness import Matrix
from hindrax_control.layout import Layout

MAGNITUDE = 0.003
NEXT_GROUP = 0.03
FREE = 0.03
"""Grading: c_1 = MAGNITUDE, c_(g+1) = NEXT_GROUP c_g, c_free = FREE c_G. Steeper or with a third
group, the solver runs out of digits."""

SOLVED = 1
TOLERANCE = 1e-12


def grading(groups: int) -> tuple[float, ...]:
    """Return c_1 to c_G and c_free, which every step of the order weighs against the one before."""
    parts = [MAGNITUDE * NEXT_GROUP**g for g in range(groups)]
    return (*parts, FREE * parts[-1] if parts else FREE)


class BoundedAllocation:
    """The problem for one layout and its force limits; `forces` solves it for a wrench."""

    def __init__(self, layout: Layout, limits_N: Sequence[Interval]) -> None:
        self.layout = layout
        groups, free, m = len(layout.groups), layout.free.shape[1], len(layout.used)
        axes = [axis for group in layout.groups for axis in group]
        least, most = np.array(limits_N).reshape(m, 2).T
        # Unknowns: scaled parts (groups), wrench error of the served axes, scaled free sizes (free).
        per_error = layout.pseudo_inverse[:, axes] / layout.weights[axes]
        strongest = np.maximum(-least, most)
        scales = grading(groups)
        self._groups = [
            _group(layout, g, per_error[:, [axes.index(axis) for axis in layout.groups[g]]], strongest, scales[g])
            for g in range(groups)
        ]
        self._rows = np.hstack([np.zeros((m, groups)), per_error, layout.free / scales[-1]])
        self._hessian = np.eye(groups + len(axes) + free)
        self._linear = np.zeros(groups + len(axes) + free)
        self._upper, self._lower = np.concatenate([np.zeros(groups), most]), np.concatenate([np.zeros(groups), least])
        self._sense = np.zeros(groups + m, dtype=np.int32)
        self._least, self._most = least, most

    def forces(self, wrench: Sequence[float]) -> tuple[list[float], bool]:
        """Forces [N] of the thrusters in use, within limits, and whether the solver found the best ones.

        When it does not, the forces are those of the largest part of the whole wrench that fits.
        """
        for g, group in enumerate(self._groups):
            magnitude, column = group.part_of(wrench)
            self._rows[:, g] = column
            self._linear[g], self._upper[g] = -magnitude, magnitude
        x, _, flag, _ = daqp.solve(
            self._hessian, self._linear, self._rows, self._upper, self._lower, self._sense, primal_tol=TOLERANCE
        )
        if flag != SOLVED:
            return self._fitted(wrench), False
        forces: list[float] = np.minimum(np.maximum(self._rows.dot(x), self._least), self._most).tolist()
        return forces, True

    def _fitted(self, wrench: Sequence[float]) -> list[float]:
        wanted = self.layout.pseudo_inverse @ np.asarray(wrench, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(wanted > 0.0, self._most / wanted, np.where(wanted < 0.0, self._least / wanted, np.inf))
        fitted: list[float] = (wanted * min(1.0, float(np.min(room, initial=1.0)))).tolist()
        return fitted


@dataclass(frozen=True, slots=True)
class _Group:
    """One priority: its axes with their weights, forces per weighted wrench (m, axes), scale and reach of its part."""

    axes: tuple[tuple[int, float], ...]
    per_error: Matrix
    scale: float
    reach: float

    def part_of(self, wrench: Sequence[float]) -> tuple[float, Matrix]:
        """Scaled magnitude of the part of a wrench, no more than could ever be had, and the forces per scaled part."""
        part = [wrench[axis] * weight for axis, weight in self.axes]
        length = math.hypot(*part)
        if length == 0.0:
            return 0.0, self.per_error.dot(part)
        column = self.per_error.dot([value / length / self.scale for value in part])
        return min(length, self.reach) * self.scale, column


def _group(layout: Layout, g: int, per_error: Matrix, strongest_N: Matrix, scale: float) -> _Group:
    axes = list(layout.groups[g])
    weights = layout.weights[axes]
    reach = float((weights @ np.abs(layout.B[axes])) @ strongest_N)
    return _Group(tuple(zip(axes, weights.tolist(), strict=True)), np.ascontiguousarray(per_error), scale, reach)
