"""Units of angles and rates of a CSV file whose header line names none: by their size, and by each other.

A ground station writes headings of 0 to 360 and rates in degrees per second, without a word. Rates that are taken for
rad/s are 57 times too large, which is still a possible rate of a small vehicle. But the integral of a rate is an angle:
the slope of one over the other is 1 where both units are alike, and tells which is not. A compass counts clockwise
whatever the axes of the rates are, so only the size of the slope says something of units.
"""

from collections.abc import Collection, Mapping

import numpy as np

from hindrax_analysis.records.csv_agreement import slope_of
from hindrax_analysis.records.csv_columns import DEGREE
from hindrax_ident.arrays import Array, array

ANGLES = {"roll": "p", "pitch": "q", "yaw": "r"}
"""Angles, and the rate about each axis: alike as long as the vehicle is nearly level."""
TURN = 6.5
"""An angle beyond this is none in radians [rad]: a turn, and a little."""


def in_radians(columns: Mapping[str, Array], unnamed: Collection[str]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns with all angles and rates in radians.

    Parameters
    ----------
    columns
        By name, (n,) each, with the times "t" [s]; those with a named unit in SI.
    unnamed
        Names of the columns without a named unit.

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
    turned = large and 0.5 < slope < 2.0 and not rates
    if angles and (slope > 0.5 / DEGREE or (large and not turned)):
        out |= {one: array(out[one] * DEGREE) for one in angles}
        notes.append(f"angles ({', '.join(angles)}) are in degrees, by their {'size' if large else 'rates'}")
        slope *= DEGREE
    if rates and 0.0 < slope < 2.0 * DEGREE:
        out |= {one: array(out[one] * DEGREE) for one in rates}
        notes.append(f"rates ({', '.join(rates)}) are in deg/s, by the angles")
    return out, tuple(notes)


def _unwrapped(angle: Array) -> Array:
    """The same angle, (n,), without its leaps by a turn; the unit follows from its size."""
    known = np.isfinite(angle)
    period = 360.0 if np.abs(angle[known]).max(initial=0.0) > TURN else 2.0 * np.pi
    out = angle.copy()
    out[known] = np.unwrap(angle[known], period=period)
    return out
