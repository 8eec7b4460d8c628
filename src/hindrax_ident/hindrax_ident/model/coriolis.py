"""Coriolis and centripetal forces of body and entrained water: the coupling of one axis to the motions of the others.

A vehicle that drifts while it pitches is subject to the Munk moment, (m_w - m_u) w u: small, but correlated with the
motion, so it does not average out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6
from hindrax_ident.arrays import Array

Values = TypeVar("Values", float, Array)

USUAL_MASS_RATIO, USUAL_MASS_RATIO_SIGMA = 1.8, 0.6
"""Ratio of total to body mass of an unknown vehicle, and its standard deviation [-]."""
JUMP_mps, FASTEST_mps2 = 0.15, 2.0
"""A velocity that differs from the last one by more than noise and the strongest thrusters explain has jumped."""
KNOWN_MASS_SIGMA = 0.02
"""Relative standard deviation below which a mass counts as exact."""


@dataclass(frozen=True, slots=True)
class Masses:
    """Estimates of the sum of body and added mass of each axis, and their standard deviations [kg, kg m^2]."""

    values: Vec6
    sigmas: Vec6


def coriolis(axis: int, masses: Sequence[float], nu: Sequence[Values]) -> Values:
    """Force or moment on an axis due to motion along the others. Fossen 2011 eq. 6.43, diagonal masses.

    Parameters
    ----------
    axis
        Index, 0 to 5.
    masses : (6,) [kg, kg m^2]
        Sums of body and added mass.
    nu : (6,) [m/s, rad/s]
        Velocities in body axes (SNAME), numbers or arrays (n,).

    Returns
    -------
    Values
        [N, N m], number or array (n,), on the side of the acting forces.
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    if axis < 3:
        return masses[b] * nu[b] * nu[3 + c] - masses[c] * nu[c] * nu[3 + b]
    by_turning = (masses[3 + b] - masses[3 + c]) * nu[3 + b] * nu[3 + c]
    return by_turning + (masses[b] - masses[c]) * nu[b] * nu[c]


def coriolis_errors(axis: int, masses: Masses, nu: Sequence[Array]) -> list[Array]:
    """Errors of `coriolis` for one standard deviation of each uncertain mass: it is linear in the masses.

    Parameters
    ----------
    axis
        Index, 0 to 5.
    masses
        Values and deviations (6,).
    nu : (6,) of (n,) [m/s, rad/s]
        Velocities in body axes.

    Returns
    -------
    list[Array]
        (n,) each [N, N m], of the masses that matter.
    """
    out = []
    for index, (value, sigma) in enumerate(zip(masses.values, masses.sigmas, strict=True)):
        if sigma > KNOWN_MASS_SIGMA * value:
            error = coriolis(axis, [sigma if one == index else 0.0 for one in range(6)], nu)
            out += [error] if np.any(error) else []
    return out


class VelocityHistory:
    """The last accepted velocity of each axis.

    One that jumps is accepted when the next one confirms it: a DVL that takes something else for the bottom once would
    be a moment of newton meters here, and its own axis alone has a test for outliers.
    """

    __slots__ = ("_jumped", "_measured_s", "_nu", "_oldest_s")

    def __init__(self, oldest_s: float) -> None:
        """`oldest_s`: age above which a velocity is no longer used [s]."""
        self._oldest_s = oldest_s
        self._nu, self._measured_s = list(ZERO6), [-math.inf] * 6
        self._jumped = [math.nan] * 3

    def update(self, t_s: float, nu: Sequence[float]) -> bool:
        """Store six velocities [m/s, rad/s], NaN where not measured; return whether any was measured."""
        measured = [axis for axis, value in enumerate(nu) if math.isfinite(value)]
        for axis in measured:
            if axis >= 3 or self._accepts(axis, nu[axis], t_s):
                self._nu[axis], self._measured_s[axis] = nu[axis], t_s
        return bool(measured)

    def _accepts(self, axis: int, value: float, t_s: float) -> bool:
        """Whether a velocity follows the last one, or the one that jumped before it."""
        far = JUMP_mps + FASTEST_mps2 * (t_s - self._measured_s[axis])
        near = abs(value - self._nu[axis]) <= far or abs(value - self._jumped[axis]) <= far
        self._jumped[axis] = math.nan if near else value
        return near

    def measured_at(self, t_s: float) -> Vec6:
        """Velocities that were accepted at this very time [m/s, rad/s]; NaN of the other axes."""
        u, v, w, p, q, r = (x if s == t_s else math.nan for x, s in zip(self._nu, self._measured_s, strict=True))
        return (u, v, w, p, q, r)

    def at(self, t_s: float) -> Vec6:
        """Velocities of all axes [m/s, rad/s]; zero, which corrects nothing, where the last one is too old."""
        since = t_s - self._oldest_s
        u, v, w, p, q, r = (x if s >= since else 0.0 for x, s in zip(self._nu, self._measured_s, strict=True))
        return (u, v, w, p, q, r)
