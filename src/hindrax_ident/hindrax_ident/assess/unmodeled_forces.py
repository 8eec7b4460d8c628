"""Unmodeled forces in third-party records: a dead band of the thrust, the pull of a tether.

Each resembles drag to some degree. Its prior standard deviation is a share of the largest thrust; the residuals reduce
it, and the remainder widens the bands.
"""

from __future__ import annotations

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import per_step
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.score_test import score
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import Record

LOST = 0.5
"""Standard deviation of the share of thrust missing inside the dead band [-]."""


def unmodeled_force_covariance(record: Record, fit: OutputErrorFit, share: float) -> Array:
    """Second moment, (p, p), of parameter errors due to unmodeled forces of `share` of the largest thrust."""
    high = float(np.percentile(np.abs(record.thrust.y), 98.0)) if len(record.thrust) else 0.0
    if not share * high > 0.0:
        return np.zeros_like(fit.covariance)
    found = score(fit, _impulses(record, fit, share * high))
    sigmas = np.array([share * high, LOST, share * high])
    known = found.information
    left = np.linalg.inv(known + np.diag(1.0 / sigmas**2))
    likely = left @ known @ found.values
    return array(found.shifts @ (left + np.outer(likely, likely)) @ found.shifts.T)


def _impulses(record: Record, fit: OutputErrorFit, band: float) -> Array:
    """Impulses over each step of the fit's grid, (n, 3) [N s, N m s per unit]: reduced thrust, dead band, spring."""
    grid, command = fit.problem.grid, record.thrust.y
    times = grid.times_s - record.latency_s
    missing = (-np.clip(command / band, -1.0, 1.0), -command * (np.abs(command) < band))
    totals = [LaggedThrust(record.thrust.t, one, record.lag_s).impulse(times) for one in missing]
    position = _normalized_position(fit)
    return array(np.column_stack([per_step(np.column_stack(totals), grid), -position * grid.steps_s]))


def _normalized_position(fit: OutputErrorFit) -> Array:
    """Position relative to the median, scaled to -1 to 1: (n,) [-]."""
    s = fit.linear.path.s - float(np.median(fit.linear.path.s))
    return array(s / max(1e-9, float(np.percentile(np.abs(s), 98.0))))
