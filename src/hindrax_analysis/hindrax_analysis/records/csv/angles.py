"""Units of angles and rates of a CSV file whose header line names none: by their size, and by each other.

A ground station writes headings of 0 to 360 and rates in degrees per second, without a word. Rates that are taken for
rad/s are 57 times too large, which is still a possible rate of a small vehicle. But the integral of a rate is an angle:
the slope of one over the other is 1 where both units are alike, and tells which is not. A compass counts clockwise
whatever the axes of the rates are, so only the size of the slope says something of units. Where both are alike, an
angle of 20 may be of a ship that has hardly turned, or of one that has turned three times and counted on: the inertia
that the moments of the file had to turn tells, for in degrees it would be 57 times as large.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from hindrax_analysis.records.csv.agreement import slope_of
from hindrax_analysis.records.csv.columns import DEGREE
from hindrax_ident.arrays import Array, array

ANGLES = {"roll": "p", "pitch": "q", "yaw": "r"}
"""Angles, and the rate about each axis: alike as long as the vehicle is nearly level."""
TURN, FASTEST_radps = 6.5, 4.0 * np.pi
"""An angle beyond the first is none in radians [rad]: a turn, and a little. A rate beyond the second is none in rad/s:
no such vehicle turns twice a second."""
INERTIAS = (0.2, 11.0)
"""Inertia with the water in that of the vehicle alone [-]: a range of less than a radian in degrees."""
IMPULSE_S, FEWEST_KNOWN, LEAST_EXPLAINED = 0.5, 50, 0.5
"""Windows of the impulses, and least number of rows and share of the impulses that tell."""


def in_radians(
    columns: Mapping[str, Array], unnamed: Collection[str], inertia_kgm2: Sequence[float] = ()
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns with all angles and rates in radians.

    Parameters
    ----------
    columns
        By name, (n,) each, with the times "t" [s]; those with a named unit in SI.
    unnamed
        Names of the columns without a named unit.
    inertia_kgm2 : (3,) [kg m^2]
        Moments of inertia of the vehicle alone; empty: not known.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...]]
        The columns, (n,) each, and what was assumed.
    """
    out, notes = dict(columns), []
    angles, rates = ([one for one in names if one in out and one in unnamed] for names in (ANGLES, ANGLES.values()))
    slopes = [
        slope
        for angle, rate in ANGLES.items()
        if angle in out and rate in out and (slope := abs(slope_of(out["t"], _unwrapped(out[angle]), out[rate])))
    ]
    slope = float(np.median(slopes)) if slopes else 0.0
    large = any(np.nanmax(np.abs(out[one]), initial=0.0) > TURN for one in angles)
    # Unwrapped, a yaw in radians is large after some turns; a rate that is known says so.
    turned = large and 0.5 < slope < 2.0 and (not rates or _inertia_in_radians(out, inertia_kgm2))
    if angles and (slope > 0.5 / DEGREE or (large and not turned)):
        out |= {one: array(out[one] * DEGREE) for one in angles}
        notes.append(f"angles ({', '.join(angles)}) are in degrees, by their {'size' if large else 'rates'}")
        slope *= DEGREE
    too_fast = any(np.nanpercentile(np.abs(out[one]), 95.0) > FASTEST_radps for one in rates if np.any(out[one]))
    if rates and (0.0 < slope < 2.0 * DEGREE or (too_fast and not slopes)):
        out |= {one: array(out[one] * DEGREE) for one in rates}
        notes.append(f"rates ({', '.join(rates)}) are in deg/s, by {'the angles' if slopes else 'their size'}")
    return out, tuple(notes)


def _inertia_in_radians(columns: Mapping[str, Array], inertia_kgm2: Sequence[float]) -> bool:
    """Whether the moments turn a vehicle of this inertia with its water, where the rates are in rad/s."""
    found = [
        (*_inertia(columns["t"], columns[rate], columns[moment]), own)
        for own, rate, moment in zip(inertia_kgm2, "pqr", "KMN", strict=bool(inertia_kgm2))
        if {rate, moment} <= set(columns)
    ]
    explained, total, own = max(found, default=(0.0, 0.0, 1.0))
    low, high = INERTIAS
    return explained > LEAST_EXPLAINED and low < total / own < high


def _inertia(t: Array, rate: Array, moment: Array) -> tuple[float, float]:
    """Share of the impulses of a moment that inertia and drag explain, and the inertia, by the unit of the rate."""
    known = np.flatnonzero(np.isfinite(rate + moment))
    if len(known) < FEWEST_KNOWN or np.ptp(moment[known]) == 0.0:
        return 0.0, 0.0
    t, rate, moment = t[known], rate[known], moment[known]
    at = np.arange(t[0], t[-1], IMPULSE_S)
    steps = np.diff(t)

    def over(values: Array) -> Array:
        """Integral over each window, (k,); a moment holds until the next."""
        return np.diff(np.interp(at, t, np.append(0.0, np.cumsum(steps * values[:-1]))))

    columns = np.column_stack([np.diff(np.interp(at, t, rate)), over(rate), over(rate * np.abs(rate)), np.diff(at)])
    impulses = over(moment)
    solved = np.linalg.lstsq(columns, impulses)[0]
    left = impulses - columns @ solved
    return 1.0 - float(np.var(left) / max(1e-300, np.var(impulses))), float(solved[0])


def _unwrapped(angle: Array) -> Array:
    """The same angle, (n,), without its leaps by a turn; the unit follows from its size."""
    known = np.isfinite(angle)
    period = 360.0 if np.abs(angle[known]).max(initial=0.0) > TURN else 2.0 * np.pi
    out = angle.copy()
    out[known] = np.unwrap(angle[known], period=period)
    return out
