"""Poses beside velocities: the frame of the velocities, and velocities from poses where there are none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, Index, array

BIN_S = 0.1
"""Averaging time of positions; differences of the means are velocities."""
COMPARED_S = 0.5
"""Shortest time over which positions are compared with velocities, so that noise is negligible."""
FEWEST = 20
CLEAR = 4.0
"""Ratio of mean squared errors above which one frame is the right one."""


class FrameErrors(NamedTuple):
    """Mean squared difference between velocities and rates of the positions, per assumption [m^2/s^2].

    `world`: velocities in the axes of the positions; `body`: in those of the vehicle; `still`: zero velocities.
    """

    world: float
    body: float
    still: float

    @property
    def is_world(self) -> bool:
        """Whether positions and velocities agree only in world axes."""
        return self.still > CLEAR * self.world and self.body > CLEAR * self.world

    @property
    def is_neither(self) -> bool:
        """Whether positions and velocities disagree in both frames."""
        return min(self.world, self.body) > 0.5 * self.still


def to_body(vectors: Array, quaternions: Array) -> Array:
    """World vectors (n, 3) in body axes, by unit quaternions x, y, z, w of the body in the world, (n, 4)."""
    return to_world(vectors, quaternions * np.array([-1.0, -1.0, -1.0, 1.0]))


def to_world(vectors: Array, quaternions: Array) -> Array:
    """Body vectors (n, 3) in world axes, rotated by unit quaternions."""
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    across = 2.0 * np.cross(axis, vectors)
    return array(vectors + w * across + np.cross(axis, across))


def compare_frames(t_s: Array, positions: Array, quaternions: Array, velocities: Array) -> FrameErrors | None:
    """Compare velocities (n, 3) with rates of the positions (n, 3) in both frames; None without comparable samples.

    Positions at least COMPARED_S apart are compared with the mean velocity between them.
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
    return FrameErrors(world, body, still)


def _apart(t: Array) -> list[int]:
    """Indices of times at least `COMPARED_S` apart."""
    places = [0]
    for i, at in enumerate(t.tolist()):
        if at - t[places[-1]] >= COMPARED_S:
            places.append(i)
    return places


def _means(t: Array, values: Array, starts: list[int]) -> Array:
    """Means between neighbors of `starts`, (m, k), by the trapezoidal rule."""
    steps = np.diff(t)[:, None]
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
    return array(np.diff(sums[starts], axis=0) / np.diff(t[starts])[:, None])


def velocities_from_poses(t_s: Array, positions: Array, quaternions: Array) -> tuple[Array, Array]:
    """Times (m,) [s] and velocities (m, 6) [m/s, rad/s] in body axes from positions (n, 3) and attitudes (n, 4)."""
    number = np.floor((t_s - t_s[0]) / max(BIN_S, float(np.median(np.diff(t_s))))).astype(int)
    _, place = np.unique(number, return_inverse=True)
    counts = np.bincount(place)[:, None]
    signed = quaternions * np.where(np.sum(quaternions * quaternions[:1], axis=1) < 0.0, -1.0, 1.0)[:, None]
    t, p, q = (_binned(one, place, counts) for one in (t_s[:, None], positions, signed))
    q = array(q / np.linalg.norm(q, axis=1)[:, None])
    steps = np.diff(t, axis=0)
    middle = q[1:] + q[:-1]
    middle = array(middle / np.linalg.norm(middle, axis=1)[:, None])
    rates = 2.0 * _rotation_vector(q[:-1], q[1:]) / steps
    return array(0.5 * (t[1:, 0] + t[:-1, 0])), array(
        np.column_stack([to_body(array(np.diff(p, axis=0) / steps), middle), rates])
    )


def _binned(values: Array, place: Index, counts: Index) -> Array:
    """Mean of the rows of each bin: (m, k)."""
    return array(np.column_stack([np.bincount(place, column) for column in values.T]) / counts)


def _rotation_vector(a: Array, b: Array) -> Array:
    """Vector part of the small rotation from a to b, in the axes of a: (n, 3)."""
    rotation = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] - np.cross(a[:, :3], b[:, :3])
    return array(rotation * np.sign(np.sum(a * b, axis=1))[:, None])
