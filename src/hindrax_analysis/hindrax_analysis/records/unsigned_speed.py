"""A speed without a sign in the place of a velocity: it gains while the thrust pushes backward.

Logs of a DVL or GNSS often hold the size of the velocity alone. Under thrust both ways such a column bounces at zero:
no drag and no mass explain it.
"""

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.model.thrust_lag import LaggedThrust

LOW_SHARE = 0.4
"""Largest 5th percentile, in the 95th, of a speed that comes to rest; one that never does may be that of a current."""
STEP_S, BEHIND_S = 0.4, 0.1
"""Time over which a change is taken, which averages its noise; and usual delay of a motion behind its command."""
PUSHED, LEAST_TIME = 0.2, 0.05
"""Least thrust in either direction, in the largest, and its least share of the time."""
GAINS = 0.6
"""Least sum of the gains under backward thrust, in that of the losses. Of 40 velocities of three vehicles it was 0 to
0.56, where noise is most of a change; of their sizes 0.63 to 2."""


def is_unsigned(t: Array, v: Array, wrench_t: Array, force: Array) -> bool:
    """Whether a velocity is the size of one.

    Parameters
    ----------
    t, v : (n,) [s], [m/s, rad/s]
        Finite velocities of an axis, in the order of time.
    wrench_t, force : (m,) [s], [N, N m]
        Finite thrust on the same axis, each until the next.

    Returns
    -------
    bool
        False where the thrust pushes one way alone: then a size is a velocity.
    """
    low, high = np.quantile(v, (0.05, 0.95))
    if v.min() < 0.0 or low > LOW_SHARE * high:
        return False
    count = max(1, round(STEP_S / max(1e-9, float(np.median(np.diff(t))))))
    most, lagged = float(np.abs(force).max()), LaggedThrust(wrench_t, force, BEHIND_S).force(t)
    whole = len(v) - len(v) % count
    speed, push = (one[:whole].reshape(-1, count).mean(axis=1) for one in (v, lagged))
    change, pushed = np.diff(speed), 0.5 * (push[1:] + push[:-1])
    back, ahead = pushed < -PUSHED * most, pushed > PUSHED * most
    if not len(change) or min(back.mean(), ahead.mean()) < LEAST_TIME:
        return False
    gains, losses = (float(np.maximum(0.0, sign * change[back]).sum()) for sign in (1.0, -1.0))
    return gains > GAINS * losses
