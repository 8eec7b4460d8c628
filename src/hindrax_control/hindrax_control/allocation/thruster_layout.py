"""Everything about the thrusters in use that does not depend on the wrench: worked out once, used every cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.deadband_bias import NullPattern, patterns
from hindrax_control.allocation.effectiveness import Matrix, served_axes
from hindrax_core.vehicle import AXES


@dataclass(frozen=True, slots=True)
class ThrusterLayout:
    """The thrusters in use (m of n) and what they can do.

    `used`: their indices; `pseudo_inverse` (m, 6): least forces for a wrench, zero for lost axes;
    `groups`: axes of equal priority, highest first, without lost ones; `patterns`: sparse, all that has no wrench.
    """

    used: tuple[int, ...]
    pseudo_inverse: Matrix
    groups: tuple[tuple[int, ...], ...]
    patterns: tuple[NullPattern, ...]
    lost_axes: tuple[str, ...]


def thruster_layout(B: Matrix, used: Sequence[int], priority: Sequence[int]) -> ThrusterLayout:
    """Work out the layout of the thrusters `used` out of the full B (6, n); lower priority numbers are served first."""
    mine = B[:, list(used)]
    served = served_axes(mine)
    mine = np.where(np.isin(np.arange(6), served)[:, None], mine, 0.0)
    groups = tuple(
        tuple(axis for axis in served if priority[axis] == level)
        for level in sorted({priority[axis] for axis in served})
    )
    return ThrusterLayout(
        used=tuple(used),
        pseudo_inverse=np.ascontiguousarray(np.linalg.pinv(mine)),
        groups=groups,
        patterns=patterns(mine),
        lost_axes=tuple(name for index, name in enumerate(AXES) if index not in served),
    )
