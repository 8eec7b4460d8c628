"""Times in which the model of one axis does not hold, because the vehicle is turned over about another.

The fit of one axis takes the angle of roll or pitch for the integral of its own rate. With roll R and pitch P that is
so near level alone (Fossen 2011, eqs. 2.28 and 4.6):

    dR/dt = p + (q sin R + r cos R) tan P    K = -k_r cos P sin R
    dP/dt = q cos R - r sin R                M = -k_r sin P

From 45 deg on the other rates count as much as the own one. The fit of all axes together has the attitude as it was
measured, and nothing is left out of it.
"""

import itertools
import math

import numpy as np

from hindrax_core.text.digits import stretches_told
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, Flags, array

ROLL, PITCH = 3, 4
LEAST_COSINE = math.cos(math.radians(45.0))
AROUND_S = 5.0
"""What belongs to it, before and after: what turns over swings, and shorter parts between are no motion of one axis."""
FEWEST_LEFT = 20
"""Samples of the attitude below which nothing is left out: a record of such a vehicle alone says so by its fit."""


def is_turned_over(axis: int, t: Array, attitude: Array, at_s: Array) -> Flags:
    """Whether the vehicle is turned over about another axis, or was, or will be, within AROUND_S.

    Parameters
    ----------
    axis
        0 to 5.
    t, attitude : (k,) [s], (k, 3) [rad, rad, m]
        Roll, pitch, depth; NaN where unknown.
    at_s : (n,) [s]
        Times that are asked for.

    Returns
    -------
    Flags
        (n,). None for an axis whose model does not depend on it, nor where hardly anything would be left.
    """
    over = _times(axis, t, attitude)
    if not len(over):
        return np.zeros(len(at_s), dtype=bool)
    return _is_near(over, at_s)


def notes_on_turns(t: Array, attitude: Array) -> list[str]:
    """Sentences on what is left out of the fits of single axes.

    Parameters
    ----------
    t, attitude : (k,) [s], (k, 3) [rad, rad, m]
        As of `is_turned_over`.

    Returns
    -------
    list[str]
        One for the axes with the same times; none where nothing is left out.
    """
    found: dict[str, list[str]] = {}
    for axis in (ROLL, PITCH):
        runs = _runs(_times(axis, t, attitude))
        if not runs:
            continue
        begins_s = [max(float(t[0]), first - AROUND_S) for first, _ in runs]
        lasts_s = sum(
            min(float(t[-1]), last + AROUND_S) - begin for begin, (_, last) in zip(begins_s, runs, strict=True)
        )
        where = f"{lasts_s:.3g} s ({stretches_told(begins_s)})"
        found.setdefault(where, []).append(AXES[axis])
    return [
        f"{', '.join(names)}: turned over by more than 45 deg, or soon, for {where}: left out where axes are fitted "
        "one by one"
        for where, names in found.items()
    ]


def _times(axis: int, t: Array, attitude: Array) -> Array:
    """Times (n,) [s] at which the vehicle is turned over; none where hardly anything would be left."""
    if axis not in (ROLL, PITCH) or not len(t):
        return array(np.zeros(0))
    known = np.isfinite(attitude[:, :2]).all(axis=1)
    times, other = t[known], attitude[known, 1 if axis == ROLL else 0]
    over = array(times[np.cos(other) < LEAST_COSINE])
    if not len(over) or int((~_is_near(over, times)).sum()) < FEWEST_LEFT:
        return array(np.zeros(0))
    return over


def _is_near(over: Array, at_s: Array) -> Flags:
    """Whether times (n,) [s] are within AROUND_S of some of these."""
    after = np.searchsorted(over, at_s)
    ahead_s = over[np.minimum(after, len(over) - 1)] - at_s
    past_s = at_s - over[np.maximum(after - 1, 0)]
    near: Flags = (np.abs(ahead_s) <= AROUND_S) | (np.abs(past_s) <= AROUND_S)
    return near


def _runs(over: Array) -> list[tuple[float, float]]:
    """First and last times [s] of stretches between which more is left than what belongs to them."""
    if not len(over):
        return []
    edges = [0, *(np.flatnonzero(np.diff(over) > 2.0 * AROUND_S) + 1).tolist(), len(over)]
    return [(float(over[first]), float(over[end - 1])) for first, end in itertools.pairwise(edges)]
