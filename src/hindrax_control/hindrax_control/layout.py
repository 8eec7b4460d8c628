"""Everything about the thrusters in use that does not depend on the wrench: worked out once, used every cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.bias import Pattern, patterns
from hindrax_control.effectiveness import Matrix, served_axes
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import AXES


@dataclass(frozen=True, slots=True)
class Layout:
    """The thrusters in use (m of n) and what they can do.

    `used`: their indices; `B` (6, m), rows of lost axes zero; `pseudo_inverse` (m, 6): least forces for a wrench;
    `weights` (6,): of the axes, zero where lost; `groups`: axes of equal priority, highest first, without lost ones;
    `free` (m, k): orthonormal patterns without wrench; `patterns`: the same space, sparse.
    """

    used: tuple[int, ...]
    B: Matrix
    pseudo_inverse: Matrix
    weights: Matrix
    groups: tuple[tuple[int, ...], ...]
    free: Matrix
    patterns: tuple[Pattern, ...]
    lost_axes: tuple[str, ...]


def layout(B: Matrix, used: Sequence[int], weights: Vec6, priority: Sequence[int]) -> Layout:
    """Work out the layout of the thrusters `used` out of the full B (6, n); lower priority numbers are served first."""
    mine = B[:, list(used)]
    served = served_axes(mine)
    mine = np.where(np.isin(np.arange(6), served)[:, None], mine, 0.0)
    weight = np.where(np.isin(np.arange(6), served), np.asarray(weights, dtype=float), 0.0)
    groups = tuple(
        tuple(axis for axis in served if priority[axis] == level)
        for level in sorted({priority[axis] for axis in served})
    )
    return Layout(
        used=tuple(used),
        B=mine,
        pseudo_inverse=np.ascontiguousarray(np.linalg.pinv(mine)),
        weights=weight,
        groups=groups,
        free=_free(mine, len(served)),
        patterns=patterns(mine),
        lost_axes=tuple(name for index, name in enumerate(AXES) if index not in served),
    )


def _free(B: Matrix, rank: int) -> Matrix:
    if B.shape[1] == 0:
        return np.zeros((0, 0))
    return np.ascontiguousarray(np.linalg.svd(B)[2][rank:].T)
