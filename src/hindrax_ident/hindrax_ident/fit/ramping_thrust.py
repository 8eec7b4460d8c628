"""Thrust that ramps: many drives limit how fast a command may change.

A fit that knows one lag alone takes the difference for mass. A ramp is a change of the command before its lag, so a fit
computes it exactly. (Lags that differ as thrust comes and goes are delays of the fit: `delay`.)
"""

from dataclasses import replace

import numpy as np

from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.records.axis_record import Record, Series

STEPS, LEAST_STEP_S = 8.0, 0.01
"""Steps in which a change is computed within its time, none shorter than this."""


def ramping(record: Record, time_s: float) -> Record:
    """Limit the rate of the thrust.

    Parameters
    ----------
    record
        Of one axis.
    time_s : [s]
        From zero to the largest thrust.

    Returns
    -------
    Record
        With the mean of such a thrust in each of fine steps.
    """
    y = record.thrust.y
    begins, steps_s, at = _grid(record.thrust.t, time_s)
    rate = max(1e-9, float(np.abs(y).max(initial=0.0))) / time_s
    reached, out = float(y[0]), []
    for command, most in zip(y[at].tolist(), (rate * steps_s).tolist(), strict=True):
        after = reached + max(-most, min(most, command - reached))
        out.append(0.5 * (reached + after))
        reached = after
    return replace(record, thrust=Series(begins, array(out)), ramps_s=time_s)


def _grid(t: Array, time_s: float) -> tuple[Array, Array, Index]:
    """Begins and lengths (n,) [s] of steps: at the commands (m,), and between them as fine as the time needs.

    Third, the index (n,) of the command in force.
    """
    step_s = max(LEAST_STEP_S, time_s / STEPS)
    # In a long pause, only as long as something changes.
    most = int(5.0 * STEPS)
    counts = np.clip(np.ceil(np.diff(t) / step_s), 1, most).astype(int)
    starts, sizes = np.repeat(t[:-1], counts), np.repeat(np.minimum(np.diff(t) / counts, step_s), counts)
    within = np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)
    begins = np.append(starts + within * sizes, t[-1] + step_s * np.arange(most))
    steps_s = np.append(np.diff(begins), step_s)
    return array(begins), array(steps_s), np.searchsorted(t, begins, side="right") - 1
