"""Off-diagonal added mass, which need not be symmetric (as measured by Xu, Ma, Han 2017)."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec6, vec6
from hindrax_core.vehicle import Hydrodynamics

Rows: TypeAlias = list[list[float]]
Accelerations: TypeAlias = Callable[[Vec6, Vec6], Vec6]
"""Solves M a = forces - C v; the forces hold all but what the off-diagonal momenta add to C v."""


def coupling(inertia: Vec6, hydrodynamics: Hydrodynamics) -> Accelerations | None:
    """Accelerations of forces and velocities with off-diagonal added mass; None where there is none.

    Its symmetric part makes momenta (Fossen 2011, property 6.2), all of it resists; see Xu, Ma, Han 2017.
    """
    if not hydrodynamics.added_mass_cross:
        return None
    cross = np.array(hydrodynamics.added_mass_cross, dtype=float)
    if cross.shape != (6, 6) or np.any(np.diag(cross)):
        raise UsageError("hydrodynamics.added_mass_cross: wanted 6 rows of 6 with a zero diagonal (see added_mass)")
    whole = np.diag(inertia) + cross
    lowest = float(np.linalg.eigvalsh(0.5 * (whole + whole.T))[0])
    if lowest <= 0.0:
        raise UsageError(f"hydrodynamics.added_mass_cross: energy can be negative ({lowest:g} kg), make it smaller")
    momentum: Rows = (0.5 * (cross + cross.T)).tolist()
    inverse: Rows = np.linalg.inv(whole).tolist()

    def accelerations(forces: Vec6, velocities: Vec6) -> Vec6:
        u, v, w, p, q, r = velocities
        px, py, pz, hx, hy, hz = _times(momentum, velocities)
        X, Y, Z, K, M, N = forces
        left = (
            X + r * py - q * pz,
            Y + p * pz - r * px,
            Z + q * px - p * py,
            K + r * hy - q * hz + w * py - v * pz,
            M + p * hz - r * hx + u * pz - w * px,
            N + q * hx - p * hy + v * px - u * py,
        )
        return _times(inverse, left)

    return accelerations


def _times(matrix: Rows, vector: Vec6) -> Vec6:
    a, b, c, d, e, f = vector
    return vec6(row[0] * a + row[1] * b + row[2] * c + row[3] * d + row[4] * e + row[5] * f for row in matrix)
