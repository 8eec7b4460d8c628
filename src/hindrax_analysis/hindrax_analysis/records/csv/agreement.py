"""How two columns of a file agree of which one is the rate of the other: what its header leaves open, they tell."""

import numpy as np

from hindrax_ident.arrays import Array

WINDOW_S = 1.0
"""Time over which a column changes by the integral of its rate."""
FEWEST, LEAST_CORRELATION = 8, 0.7
"""Windows that decide, and how alike both changes within them must be: their correlation about zero."""


def slope_of(t: Array, values: Array, rate: Array) -> float:
    """What a column changes per integral of another.

    Parameters
    ----------
    t : (n,) [s]
        In the order of the file.
    values, rate : (n,)
        As they are in the file; NaN where a row says nothing.

    Returns
    -------
    float
        1 where `rate` is the rate of `values`, -1 where they are counted in opposite directions, another size where
        their units differ; 0 where they do not tell.
    """
    # Trials that stand below each other are one time here: each begins where the one before it ends.
    t = t[0] + np.append(0.0, np.cumsum(np.maximum(np.diff(t), 0.0)))
    there, moved = np.isfinite(values), np.isfinite(rate)
    if there.sum() < FEWEST or moved.sum() < FEWEST:
        return 0.0
    begin, end = max(t[there][0], t[moved][0]), min(t[there][-1], t[moved][-1])
    at = np.arange(begin, end, max(WINDOW_S, 2.0 * float(np.median(np.diff(t[there])))))
    steps = np.diff(t[moved])
    integral = np.append(0.0, np.cumsum(0.5 * steps * (rate[moved][1:] + rate[moved][:-1])))
    changes, integrals = np.diff(np.interp(at, t[there], values[there])), np.diff(np.interp(at, t[moved], integral))
    along, most = float(changes @ integrals), float(np.linalg.norm(changes) * np.linalg.norm(integrals))
    if len(changes) < FEWEST or abs(along) <= LEAST_CORRELATION * most:
        return 0.0
    return along / float(integrals @ integrals)
