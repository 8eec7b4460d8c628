"""What the motions along other axes do to one: Coriolis and centripetal forces of body and entrained water.

A vehicle that drifts while it pitches feels the moment of Munk, (m_w - m_u) w u: small, but it comes with the motion,
so it does not average out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hindrax_core.readings import Vec6
from hindrax_core.state import ZERO6
from hindrax_ident.arrays import Array

Values = TypeVar("Values", float, Array)

USUAL, SPREAD = 1.8, 0.6
"""Body and added mass over that of the body, and its standard deviation, of vehicles of which nothing is known."""
KNOWN = 0.02
"""Relative standard deviation below which a mass adds no doubt."""


@dataclass(frozen=True, slots=True)
class Masses:
    """Body and added mass of each axis as they are believed, and their standard deviations [kg, kg m^2]."""

    values: Vec6
    sigmas: Vec6


def coriolis(axis: int, masses: Sequence[float], nu: Sequence[Values]) -> Values:
    """Force or moment on an axis by what moves on the others [N, N m]. Fossen 2011 eq. 6.43, diagonal masses.

    `masses`: six sums of body and added mass [kg, kg m^2]; `nu`: six velocities [m/s, rad/s], numbers or arrays.
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    if axis < 3:
        return masses[b] * nu[b] * nu[3 + c] - masses[c] * nu[c] * nu[3 + b]
    by_turning = (masses[3 + b] - masses[3 + c]) * nu[3 + b] * nu[3 + c]
    return by_turning + (masses[b] - masses[c]) * nu[b] * nu[c]


def doubts(axis: int, masses: Masses, nu: Sequence[Array]) -> list[Array]:
    """Error of `coriolis` by each mass that is not known, per standard deviation of it: (n,) each."""
    out = []
    for index, (value, sigma) in enumerate(zip(masses.values, masses.sigmas, strict=True)):
        if sigma > KNOWN * value:
            error = coriolis(axis, [sigma if one == index else 0.0 for one in range(6)], nu)
            out += [error] if np.any(error) else []
    return out


class Motions:
    """The last velocity that was heard of each axis."""

    __slots__ = ("_heard_s", "_nu", "_oldest_s")

    def __init__(self, oldest_s: float) -> None:
        """Velocities older than this are not believed [s]."""
        self._oldest_s = oldest_s
        self._nu, self._heard_s = list(ZERO6), [-math.inf] * 6

    def hear(self, t_s: float, nu: Vec6) -> bool:
        """Six velocities [m/s, rad/s], NaN where nothing was measured; returns whether anything was."""
        measured = [axis for axis, value in enumerate(nu) if math.isfinite(value)]
        for axis in measured:
            self._nu[axis], self._heard_s[axis] = nu[axis], t_s
        return bool(measured)

    def at(self, t_s: float) -> Vec6:
        """Velocities of all axes; zero where none was heard of late: what is not known is not corrected."""
        since = t_s - self._oldest_s
        u, v, w, p, q, r = (x if s >= since else 0.0 for x, s in zip(self._nu, self._heard_s, strict=True))
        return (u, v, w, p, q, r)
