"""Slow unknown forces in the residuals of third-party records: a tether, an operator, a swell."""

from __future__ import annotations

import math

import numpy as np

from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.score_test import score

SLOW_S = 3.0
"""Shortest period of forces that are slow compared with the motion of a small vehicle."""
SLOW_RATES = 16


def slow_force_ratio(fit: OutputErrorFit) -> float:
    """Ratio of the power of slow unknown forces in the residuals to that expected from the noise; 1 or more.

    Whitening over the memory of the thrusters does not cover a tether, an operator or a swell.
    """
    grid = fit.problem.grid
    longest_s = max(float(np.ptp(fit.problem.t[span])) for span in fit.problem.spans)
    rates = np.geomspace(math.tau / max(longest_s, 2.0 * SLOW_S), math.tau / SLOW_S, SLOW_RATES)
    angles = np.outer(grid.times_s - grid.times_s[0], rates)
    found = score(fit, np.hstack([np.cos(angles), np.sin(angles)]) * grid.steps_s[:, None])
    inverse = np.linalg.pinv(found.information, rcond=1e-9, hermitian=True)
    known = float(np.trace(inverse @ found.information))
    return max(1.0, float(found.values @ found.information @ found.values) / max(1.0, known))
