"""Array types: double precision; each docstring gives the shape."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]
LARGEST_PERCENTILE = 98.0
"""Percentile of what counts as the largest: spikes are beyond it."""
NOTHING_SHARE = 1e-3
"""Share of the very largest below which there is nothing [-]."""
ROUNDING = 1e-6
"""Change below which it is rounding, of the largest value on any axis of the kind: what thrusters that cancel leave."""


def array(values: object) -> Array:
    """Numbers as a double-precision array of the same shape (...,); an array of that type is not copied."""
    return np.asarray(values, dtype=np.float64)


def largest(values: Array, side: int = 0) -> float:
    """Largest magnitude of values (n,) but for spikes; 0 where there is nothing.

    Parameters
    ----------
    values : (n,)
        Such as the thrust on an axis, or its velocity.
    side
        1 or -1: of those with this sign; 0: of all.

    Returns
    -------
    float
        The percentile LARGEST_PERCENTILE of all. Where that is nothing, because the axis was pushed for a hundredth of
        the record, of those that are something: shares of the largest would be endless otherwise.
    """
    sizes = np.abs(values)
    least = NOTHING_SHARE * sizes.max(initial=0.0)
    if not least:
        return 0.0
    if np.percentile(sizes, LARGEST_PERCENTILE) <= least:
        values = values[sizes > least]
    return float(np.percentile(np.maximum(0.0, side * values) if side else np.abs(values), LARGEST_PERCENTILE))


def rounding(table: Array, axis: int) -> float:
    """Largest change of an axis that may be rounding.

    Parameters
    ----------
    table : (n, 6)
        Velocities or forces; NaN where there is none.
    axis
        By number, 0 surge to 5 yaw.

    Returns
    -------
    float
        In the unit of the axis.
    """
    kind = table[:, :3] if axis < 3 else table[:, 3:]
    return ROUNDING * float(np.abs(kind[np.isfinite(kind)]).max(initial=0.0))


def stretches_of(found: Flags) -> list[slice]:
    """Stretches of what is found.

    Parameters
    ----------
    found : (n,)
        Whether each is.

    Returns
    -------
    list[slice]
        In their order.
    """
    ends = np.flatnonzero(np.diff(np.concatenate(([0], found.astype(int), [0]))))
    return [slice(first, end) for first, end in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)]
