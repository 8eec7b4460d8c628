"""Score tests: effect of an unmodeled impulse on a result, and its significance.

Computed from the linearization about the fit, without refitting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error_problem import linearize


@dataclass(frozen=True, slots=True)
class ScoreTest:
    """Score test of m unknown impulses.

    `shifts` (p, m): error of the parameters per unit of each; `values` (m,): estimates from the residuals, with their
    covariance (m, m) and its inverse, `information`, which is singular where they are not observable.
    """

    shifts: Array
    values: Array
    covariance: Array
    information: Array

    @property
    def distance(self) -> float:
        """Squared distance of the values from zero in units of their covariance: chi-squared with m degrees."""
        return float(self.values @ np.linalg.solve(self.covariance, self.values))


def score(fit: OutputErrorFit, impulses: Array) -> ScoreTest:
    """Test impulses over each step of the fit's grid: (n, m) [N s, N m s per unit]."""
    p, m = len(fit.theta), impulses.shape[1]
    linear = linearize(fit.problem, fit.theta, fit.linear.path, fit.whitener, impulses)
    if linear is None:
        return ScoreTest(np.zeros((p, m)), np.zeros(m), np.eye(m), np.zeros((m, m)))
    information = linear.information
    shifts = array(np.linalg.lstsq(information[:p, :p], information[:p, p:], rcond=None)[0])
    rest = information[p:, p:] - information[p:, :p] @ shifts
    inverse = np.linalg.pinv(rest, rcond=1e-12, hermitian=True)
    values, size = array(inverse @ linear.gradient[p:]), _noise(fit)
    return ScoreTest(shifts, values, array(inverse * size + 1e-30 * np.eye(m)), array(rest / size))


def _noise(fit: OutputErrorFit) -> float:
    """Ratio of the covariance of the parameters to that for white noise of unit variance."""
    plain = np.linalg.inv(fit.linear.information)
    return float(np.median(np.diag(fit.covariance) / np.diag(plain)))
