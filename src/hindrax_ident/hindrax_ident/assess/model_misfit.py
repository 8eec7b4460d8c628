"""Tests of the residuals for model misfit: thruster lag, form of the drag, water current.

Each would give a wrong result with a narrow band. All are tested; significant ones are corrected or reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import lag_impulse, latency_impulse
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.score_test import score
from hindrax_ident.model.motion_model import HORIZONTAL
from hindrax_ident.records.axis_record import Record

LAG_SIGMAS = 4.0
LAG_LEAST_S = 0.005
CURRENT_SIGMAS = 3.0
SLOW_S = 3.0
"""Shortest period of forces that are slow compared with the motion of a small vehicle."""
SLOW_RATES = 16
CHANCE = 1e-6
"""Probability of rejecting a correct form of the drag."""


@dataclass(frozen=True, slots=True)
class LagCheck:
    """Estimated error of the record's lag, its standard deviation [s], and its effect on the parameters, (p,) per s.

    Or of the latency of the measurements' stamps. `distance`: chi-squared of a zero error.
    """

    missing_s: float
    sigma_s: float
    per_s: Array
    distance: float

    @property
    def significant(self) -> bool:
        """Whether the residuals contradict the record's value."""
        return abs(self.missing_s) > max(LAG_LEAST_S, LAG_SIGMAS * self.sigma_s)

    def covariance(self, believed_s: float) -> Array:
        """Covariance, (p, p), due to an error with prior standard deviation `believed_s` and these residuals."""
        return _nuisance_covariance(self.per_s, believed_s, self.sigma_s)


def check_lag(record: Record, fit: OutputErrorFit) -> LagCheck:
    """Test the thruster lag: an error biases the mass, and appears in the residuals after each change of thrust."""
    return _lag_check(fit, lag_impulse(record, fit.problem.grid))


def check_latency(record: Record, fit: OutputErrorFit) -> LagCheck:
    """Test the stamps of the measurements: latency is equivalent to a pure delay of the thrust."""
    return _lag_check(fit, latency_impulse(record, fit.problem.grid))


def _lag_check(fit: OutputErrorFit, impulse: Array) -> LagCheck:
    found = score(fit, impulse)
    sigma_s = math.sqrt(float(found.covariance[0, 0]))
    return LagCheck(float(found.values[0]), sigma_s, array(found.shifts[:, 0]), found.distance)


@dataclass(frozen=True, slots=True)
class FormCheck:
    """Force missing from the drag model: its share of the drag at the highest speed.

    `bias` (p,): its effect on the parameters; `description`: the kind of force.
    """

    significant: bool
    share: float
    bias: Array
    description: str


def check_form(fit: OutputErrorFit) -> FormCheck:
    """Test the form of the drag: even in the velocity (a current, an asymmetric hull) or of a higher power."""
    model, path = fit.model, fit.linear.path
    high = max(1e-9, float(np.percentile(np.abs(path.v), 98.0)))
    x = path.v / high
    forms = np.stack([x**3] if model.split else [np.abs(x), x * x, x**3], axis=1)
    found = score(fit, -forms * fit.problem.grid.steps_s[:, None])
    significant = found.distance > float(chdtri(forms.shape[1], CHANCE))
    force = np.abs(model.columns(np.array([high]), np.zeros(1))[0, : model.drags] @ fit.theta[: model.drags])
    beyond = _beyond(found.values, found.shifts, fit, high)
    description = "its form is not k_q |v| v + k_l v" if model.split else "a current, an asymmetric hull or another law"
    return FormCheck(significant, beyond / max(1e-12, float(force)), array(found.shifts @ found.values), description)


@dataclass(frozen=True, slots=True)
class CurrentCheck:
    """Estimated steady current along the axis, its standard deviation [m/s], and its effect, (p,) per m/s."""

    current: float
    sigma: float
    per_unit: Array

    @property
    def significant(self) -> bool:
        """Whether the residuals contradict still water."""
        return abs(self.current) > CURRENT_SIGMAS * self.sigma

    def covariance(self, believed: float) -> Array:
        """Covariance, (p, p), due to a current with prior standard deviation `believed` [m/s] and these residuals."""
        return _nuisance_covariance(self.per_unit, believed, self.sigma)


def _nuisance_covariance(effect: Array, believed: float, seen: float) -> Array:
    """Covariance, (p, p), due to an unknown with a prior and an observed standard deviation."""
    if believed <= 0.0:
        return array(np.zeros((len(effect),) * 2))
    return array(np.outer(effect, effect) / (1.0 / believed**2 + 1.0 / seen**2))


def check_current(fit: OutputErrorFit) -> CurrentCheck:
    """Test for a current c: drag acts on v - c, so to first order the slope of the drag times c is missing."""
    model, path = fit.model, fit.linear.path
    if model.axis not in HORIZONTAL:
        return CurrentCheck(0.0, 1.0, array(np.zeros(len(fit.theta))))
    found = score(fit, (model.slope(fit.theta, path.v) * fit.problem.grid.steps_s)[:, None])
    variance = float(found.covariance[0, 0])
    sigma = math.sqrt(variance) if variance > 0.0 else math.inf
    return CurrentCheck(float(found.values[0]), sigma, array(found.shifts[:, 0]))


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


def _beyond(values: Array, shifts: Array, fit: OutputErrorFit, high: float) -> float:
    """Largest difference between the force with the tested forms and that of the fit, over the speeds flown."""
    model = fit.model
    v = np.concatenate([-np.linspace(0.2, 1.0, 9), np.linspace(0.2, 1.0, 9)]) * high
    flown = (v >= fit.linear.path.v.min()) & (v <= fit.linear.path.v.max())
    if not flown.any():
        return 0.0
    x = v[flown] / high
    forms = np.stack([x**3] if model.split else [np.abs(x), x * x, x**3], axis=1)
    columns = model.columns(v[flown], np.zeros(int(flown.sum())))[:, : model.drags + 1]
    change = forms @ values - columns @ (shifts @ values)[: model.drags + 1]
    return float(np.abs(change).max())
