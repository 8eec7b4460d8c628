"""Positions and attitudes beside velocities: whose axes the velocities are in, and velocities where there are none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, Index, array

BIN_S = 0.1
"""Positions over this time are averaged; differences of the means are velocities."""
COMPARED_S = 0.5
"""Least time over which positions are compared with velocities: their noise does not matter then."""
FEWEST = 20
CLEAR = 4.0
"""Ratio of the mean squared errors above which one reading of the velocities is the right one."""


class Reading(NamedTuple):
    """Mean squared difference between velocities and the change of position, [m^2/s^2] each: as read, and of nothing.

    `world`: the velocities are in the axes of the positions; `body`: in those of the vehicle; `still`: they are zero.
    """

    world: float
    body: float
    still: float

    @property
    def is_world(self) -> bool:
        """Whether the positions change as the velocities say only if these are in the axes of the world."""
        return self.still > CLEAR * self.world and self.body > CLEAR * self.world

    @property
    def is_neither(self) -> bool:
        """Whether the positions change in another way than the velocities say."""
        return min(self.world, self.body) > 0.5 * self.still


def to_body(vectors: Array, quaternions: Array) -> Array:
    """Vectors (n, 3) of the world in body axes, by unit quaternions x, y, z, w of the body in the world: (n, 4)."""
    return _rotated(vectors, quaternions * np.array([-1.0, -1.0, -1.0, 1.0]))


def to_world(vectors: Array, quaternions: Array) -> Array:
    """Vectors (n, 3) of the body in the axes of the world."""
    return _rotated(vectors, quaternions)


def _rotated(vectors: Array, quaternions: Array) -> Array:
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    across = 2.0 * np.cross(axis, vectors)
    return array(vectors + w * across + np.cross(axis, across))


def read_axes(t_s: Array, positions: Array, quaternions: Array, velocities: Array) -> Reading | None:
    """Compare velocities (n, 3) with the change of the positions (n, 3) both ways; None where nothing can be compared.

    A velocity is compared with the mean over the steps up to the next position that is far enough.
    """
    known = np.isfinite(velocities[:, :2]).all(axis=1) & np.isfinite(quaternions).all(axis=1)
    t, p, q, v = t_s[known], positions[known, :2], quaternions[known], np.nan_to_num(velocities[known])
    if len(t) < FEWEST or np.ptp(p) == 0.0:
        return None
    starts = _apart(t)
    steps = np.diff(t[starts])
    moved = np.diff(p[starts], axis=0) / steps[:, None]
    usual = steps < 4.0 * float(np.median(steps))
    errors = [moved - _means(t, one[:, :2], starts) for one in (v, to_world(v, q))]
    world, body, still = (float(np.mean(np.sum(one[usual] ** 2, axis=1))) for one in (*errors, moved))
    return Reading(world, body, still)


def _apart(t: Array) -> list[int]:
    """Places of times that are at least `COMPARED_S` apart."""
    places = [0]
    for i, at in enumerate(t.tolist()):
        if at - t[places[-1]] >= COMPARED_S:
            places.append(i)
    return places


def _means(t: Array, values: Array, starts: list[int]) -> Array:
    """Means over the time between neighbors of `starts`, by the trapezoidal rule."""
    steps = np.diff(t)[:, None]
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
    return array(np.diff(sums[starts], axis=0) / np.diff(t[starts])[:, None])


def derived(t_s: Array, positions: Array, quaternions: Array) -> tuple[Array, Array]:
    """Times (m,) and velocities (m, 6) in body axes from positions (n, 3) and attitudes (n, 4) alone."""
    number = np.floor((t_s - t_s[0]) / max(BIN_S, float(np.median(np.diff(t_s))))).astype(int)
    _, place = np.unique(number, return_inverse=True)
    counts = np.bincount(place)[:, None]
    signed = quaternions * np.where(np.sum(quaternions * quaternions[:1], axis=1) < 0.0, -1.0, 1.0)[:, None]
    t, p, q = (_binned(one, place, counts) for one in (t_s[:, None], positions, signed))
    q = array(q / np.linalg.norm(q, axis=1)[:, None])
    steps = np.diff(t, axis=0)
    middle = q[1:] + q[:-1]
    middle = array(middle / np.linalg.norm(middle, axis=1)[:, None])
    rates = 2.0 * _turn(q[:-1], q[1:]) / steps
    return array(0.5 * (t[1:, 0] + t[:-1, 0])), array(
        np.column_stack([to_body(array(np.diff(p, axis=0) / steps), middle), rates])
    )


def _binned(values: Array, place: Index, counts: Index) -> Array:
    return array(np.column_stack([np.bincount(place, column) for column in values.T]) / counts)


def _turn(a: Array, b: Array) -> Array:
    """Vector part of the small rotation from a to b, in the axes of a: (n, 3)."""
    turn = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] - np.cross(a[:, :3], b[:, :3])
    return array(turn * np.sign(np.sum(a * b, axis=1))[:, None])
