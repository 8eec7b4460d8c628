"""Drag coefficients from towing points: force against speed. Eidsvik 2015 (towing tank), Badawy 2012 (CFD table 5)."""

import math
from dataclasses import dataclass

import numpy as np

from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.experiment_record import Column
from hindrax_laboratory.least_squares import least_squares

COLUMNS = (
    Column("speed_mps", "towing speed, signed [m/s] (or rad/s for a turn)"),
    Column("drag_N", "force that holds that speed, same sign [N] (or N m)"),
)


@dataclass(frozen=True, slots=True)
class Towing:
    """F = k_q |v| v + k_l v + b. COB-2023-1394 eq. 2, with b only where an offset was asked for."""

    k_q: Value
    k_l: Value
    b: Value | None
    residual_std_N: float
    samples: int
    drag_coefficient: Value | None
    """C_D of the quadratic part on the given area."""


def fit(
    speed_mps: Array, drag_N: Array, offset: bool = False, area_m2: float | None = None, density_kgpm3: float = 1000.0
) -> Towing:
    """Least squares on [|v| v, v] or [|v| v, v, 1]. The sign-preserving square serves both directions.

    Parameters
    ----------
    speed_mps : (n,) [m/s, rad/s]
        Signed.
    drag_N : (n,) [N, N m]
        Force that holds that speed, with its sign.
    offset
        Whether a constant is estimated too.
    area_m2 : [m^2]
        Reference area of C_D; None: no C_D.
    density_kgpm3 : [kg/m^3]
        Of the water, for C_D.

    Returns
    -------
    Towing
        Coefficients of COB-2023-1394 eq. 2 with standard deviations.

    Raises
    ------
    HindraxError
        When every point has the same speed, which cannot separate linear from quadratic drag, or the drag is negative.
    """
    if np.unique(np.abs(np.round(speed_mps, 9))).size < 2:
        raise HindraxError(
            "towing: all points have the same speed, wanted at least two; one speed cannot separate k_l from k_q"
        )
    columns = {"k_q": np.abs(speed_mps) * speed_mps, "k_l": speed_mps}
    columns |= {"b": np.ones(speed_mps.size)} if offset else {}
    found = least_squares(np.column_stack(list(columns.values())), drag_N, list(columns))
    pressure = 0.5 * density_kgpm3 * area_m2 if area_m2 else math.nan
    k_q, fastest = found["k_q"], float(np.max(np.abs(speed_mps)))
    force = k_q.value * fastest**2 + found["k_l"].value * fastest
    if not force > 0.0:
        raise HindraxError(
            f"towing: the drag at {fastest:g} m/s is {force:.3g} N, wanted more than 0: the force that holds "
            "a speed has its sign; change the sign of drag_N"
        )
    return Towing(
        k_q=k_q,
        k_l=found["k_l"],
        b=found["b"] if offset else None,
        residual_std_N=found.residual_std,
        samples=found.samples,
        drag_coefficient=Value(k_q.value / pressure, k_q.std / pressure) if area_m2 else None,
    )


def drag_N(speed_mps: Array, k_q: float, k_l: float, b: float = 0.0) -> Array:
    """Drag at each speed. COB-2023-1394 eq. 2.

    Parameters
    ----------
    speed_mps : (n,) [m/s]
        Signed.
    k_q : [N s^2/m^2]
        Quadratic drag.
    k_l : [N s/m]
        Linear drag.
    b : [N]
        Offset.

    Returns
    -------
    Array
        (n,) [N].
    """
    return np.asarray(k_q * np.abs(speed_mps) * speed_mps + k_l * speed_mps + b)
