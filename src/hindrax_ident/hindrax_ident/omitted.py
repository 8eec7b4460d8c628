"""Forces that nobody told a record of others about: a dead band in the thrust, a tether that pulls.

Each looks like drag to some degree. How large it may be is a belief, in shares of the largest thrust; what residuals
say of it counts too, and the rest widens the bands.
"""

from __future__ import annotations

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.delay import per_step
from hindrax_ident.lag import LaggedThrust
from hindrax_ident.record import Record
from hindrax_ident.refine import Fit
from hindrax_ident.score import score

LOST = 0.5
"""How much of a thrust inside the dead band may be missing, standard deviation [-]."""


def by_omission(record: Record, fit: Fit, share: float) -> Array:
    """Second moment of what forces of `share` of the largest thrust may have done to the parameters: (p, p)."""
    high = float(np.percentile(np.abs(record.thrust.y), 98.0)) if len(record.thrust) else 0.0
    if not share * high > 0.0:
        return np.zeros_like(fit.covariance)
    found = score(fit, _impulses(record, fit, share * high))
    sigmas = np.array([share * high, LOST, share * high])
    known = found.information
    left = np.linalg.inv(known + np.diag(1.0 / sigmas**2))
    likely = left @ known @ found.values
    return array(found.shifts @ (left + np.outer(likely, likely)) @ found.shifts.T)


def _impulses(record: Record, fit: Fit, band: float) -> Array:
    """Impulses over each step of the fit's grid, (n, 3): thrust short by a newton, none inside the band, a spring."""
    grid, command = fit.problem.grid, record.thrust.y
    times = grid.times_s - record.late_s
    missing = (-np.clip(command / band, -1.0, 1.0), -command * (np.abs(command) < band))
    totals = [LaggedThrust(record.thrust.t, one, record.lag_s).impulse(times) for one in missing]
    place = _place(fit)
    return array(np.column_stack([per_step(np.column_stack(totals), grid), -place * grid.steps_s]))


def _place(fit: Fit) -> Array:
    """Where the vehicle is on its way, within -1 and 1: (n,)."""
    s = fit.linear.path.s - float(np.median(fit.linear.path.s))
    return array(s / max(1e-9, float(np.percentile(np.abs(s), 98.0))))
