"""Score tests: effect of an unmodeled impulse on a result, and its significance.

Computed from the linearization about the fit, without refitting.
"""

import math
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error_problem import linearize

SLOW_S = 3.0
"""Shortest period of forces that are slow compared with the motion of a small vehicle."""
SLOW_RATES = 16


@dataclass(frozen=True, slots=True)
class ScoreTest:
    """Score test of m unknowns that the model does not have.

    `shifts` (p, m): error of the parameters per unit of each; `gradient` (m,) and `information` (m, m) of the residuals
    about the unknowns, once the parameters have taken their share.
    """

    shifts: Array
    gradient: Array
    information: Array

    @property
    def values(self) -> Array:
        """Estimates from the residuals alone: (m,)."""
        return self.covariance @ self.gradient

    @property
    def covariance(self) -> Array:
        """Covariance of the estimates: (m, m); zero where the residuals have no information."""
        return array(np.linalg.pinv(self.information, rcond=1e-12, hermitian=True))


def score(fit: OutputErrorFit, impulses: Array, readings: Array | None = None) -> ScoreTest:
    """Test impulses and errors of measurements that the fit does not model, without fitting them (score test).

    Parameters
    ----------
    fit
        A converged fit.
    impulses : (grid, m) [N s, N m s per unit]
        Unmodeled impulses over each step.
    readings : (n, k) [m/s, rad/s, m, rad per unit]
        Errors of each measurement; None: none.

    Returns
    -------
    ScoreTest
        Gradient and information of the m + k unknowns, and the shift of the parameters per unit of each.
    """
    p, m = len(fit.theta), impulses.shape[1] + (0 if readings is None else readings.shape[1])
    linear = linearize(fit.problem, fit.theta, fit.linear.path, fit.whitener, impulses, readings=readings)
    if linear is None:
        return ScoreTest(np.zeros((p, m)), np.zeros(m), np.zeros((m, m)))
    information, size = linear.information, noise_ratio(fit)
    shifts = array(np.linalg.solve(information[:p, :p] + fit.prior_information, information[:p, p:]))
    rest = information[p:, p:] - information[p:, :p] @ shifts
    return ScoreTest(shifts, array(linear.gradient[p:] / size), array(0.5 * (rest + rest.T) / size))


def noise_ratio(fit: OutputErrorFit) -> float:
    """Ratio of the covariance of the parameters to that for white noise of unit variance.

    Without the scatter between blocks: what is tested here may be its cause.

    Parameters
    ----------
    fit
        A converged fit.

    Returns
    -------
    float
        [-].
    """
    plain = np.diag(np.linalg.inv(fit.linear.information + fit.prior_information)) * fit.inflation**2
    return float(np.median(np.diag(fit.covariance) / plain))


def slow_force_ratio(fit: OutputErrorFit) -> float:
    """Ratio of the power of slow unknown forces in the residuals to that expected from the noise.

    Whitening over the memory of the thrusters does not cover a tether, an operator or a swell (third-party records).

    Parameters
    ----------
    fit
        A converged fit.

    Returns
    -------
    float
        1 or more [-]: the factor of the covariance.
    """
    grid = fit.problem.grid
    longest_s = max(float(np.ptp(fit.problem.t[span])) for span in fit.problem.spans)
    rates = np.geomspace(math.tau / max(longest_s, 2.0 * SLOW_S), math.tau / SLOW_S, SLOW_RATES)
    angles = np.outer(grid.times_s - grid.times_s[0], rates)
    found = score(fit, np.hstack([np.cos(angles), np.sin(angles)]) * grid.steps_s[:, None])
    inverse = np.linalg.pinv(found.information, rcond=1e-9, hermitian=True)
    known = float(np.trace(inverse @ found.information))
    return max(1.0, float(found.values @ found.information @ found.values) / max(1.0, known))
