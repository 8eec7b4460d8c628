"""What else the residuals ask for: another lag of the thrusters, another form of the drag, water that moves.

Each would make a confident wrong number. So all are tested, and where one is found it is allowed for or said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hindrax_ident.arrays import Array, array
from hindrax_ident.delay import by_lag, by_latency
from hindrax_ident.models import HORIZONTAL
from hindrax_ident.record import Record
from hindrax_ident.refine import Fit
from hindrax_ident.score import score

LAG_SIGMAS = 4.0
LAG_LEAST_S = 0.005
CURRENT_SIGMAS = 3.0
SLOW_S = 3.0
"""Shortest period of forces that are slow against the motion of a small vehicle."""
SLOW_RATES = 16
CHANCE = 1e-6
"""Probability with which a drag of the right form may be called wrong."""


@dataclass(frozen=True, slots=True)
class LagCheck:
    """Lag that the residuals ask for beyond the record's, its standard deviation [s], its effect (p,) per s.

    Or latency of the measurements' stamps. `distance`: chi-squared of its absence.
    """

    missing_s: float
    sigma_s: float
    per_s: Array
    distance: float

    @property
    def significant(self) -> bool:
        """Whether the lag of the record is contradicted."""
        return abs(self.missing_s) > max(LAG_LEAST_S, LAG_SIGMAS * self.sigma_s)

    def covariance(self, believed_s: float) -> Array:
        """What stamps add that are within `believed_s` of each other, as far as residuals cannot tell: (p, p)."""
        return _unknown(self.per_s, believed_s, self.sigma_s)


def check_lag(record: Record, fit: Fit) -> LagCheck:
    """Test the thruster lag: a wrong one makes a wrong mass, and shows in the residuals after each change of thrust."""
    return _lag_check(fit, by_lag(record, fit.problem.grid))


def check_latency(record: Record, fit: Fit) -> LagCheck:
    """Test the stamps of the measurements: late ones look like thrust that comes late, all of it by the same time."""
    return _lag_check(fit, by_latency(record, fit.problem.grid))


def _lag_check(fit: Fit, impulse: Array) -> LagCheck:
    found = score(fit, impulse)
    sigma_s = math.sqrt(float(found.covariance[0, 0]))
    return LagCheck(float(found.values[0]), sigma_s, array(found.shifts[:, 0]), found.distance)


@dataclass(frozen=True, slots=True)
class FormCheck:
    """Force beyond the model's drag that the residuals ask for: its share of the drag at the highest speed.

    `bias` (p,) is what it has done to the parameters; `words` say what kind of force it is.
    """

    significant: bool
    share: float
    bias: Array
    words: str


def check_form(fit: Fit) -> FormCheck:
    """Test the form of the drag: even in the velocity (a current, an asymmetric hull) or of a higher power."""
    model, path = fit.model, fit.linear.path
    high = max(1e-9, float(np.percentile(np.abs(path.v), 98.0)))
    x = path.v / high
    forms = np.stack([x**3] if model.split else [np.abs(x), x * x, x**3], axis=1)
    found = score(fit, -forms * fit.problem.grid.steps_s[:, None])
    significant = found.distance > float(chi2.isf(CHANCE, forms.shape[1]))
    force = np.abs(model.columns(np.array([high]), np.zeros(1))[0, : model.drags] @ fit.theta[: model.drags])
    beyond = _beyond(found.values, found.shifts, fit, high)
    words = "its form is not k_q |v| v + k_l v" if model.split else "a current, an asymmetric hull or another law"
    return FormCheck(significant, beyond / max(1e-12, float(force)), array(found.shifts @ found.values), words)


@dataclass(frozen=True, slots=True)
class CurrentCheck:
    """Steady current along the axis that the residuals ask for, its deviation [m/s], its effect (p,) per m/s."""

    current: float
    sigma: float
    per_unit: Array

    @property
    def significant(self) -> bool:
        """Whether still water is contradicted."""
        return abs(self.current) > CURRENT_SIGMAS * self.sigma

    def covariance(self, believed: float) -> Array:
        """What a current that nobody can tell adds, when it is believed to be within `believed` [m/s]: (p, p)."""
        return _unknown(self.per_unit, believed, self.sigma)


def _unknown(effect: Array, believed: float, seen: float) -> Array:
    """Covariance by an unknown of which a prior and the residuals say how large it may be."""
    if believed <= 0.0:
        return array(np.zeros((len(effect),) * 2))
    return array(np.outer(effect, effect) / (1.0 / believed**2 + 1.0 / seen**2))


def check_current(fit: Fit) -> CurrentCheck:
    """Test for water that moves: drag is that of v - c, so to first order the slope of the drag times c is missing."""
    model, path = fit.model, fit.linear.path
    if model.axis not in HORIZONTAL:
        return CurrentCheck(0.0, 1.0, array(np.zeros(len(fit.theta))))
    found = score(fit, (model.slope(fit.theta, path.v) * fit.problem.grid.steps_s)[:, None])
    variance = float(found.covariance[0, 0])
    sigma = math.sqrt(variance) if variance > 0.0 else math.inf
    return CurrentCheck(float(found.values[0]), sigma, array(found.shifts[:, 0]))


def check_slow(fit: Fit) -> float:
    """Power of slow unknown forces, as the residuals have it, over what the noise that was found explains; 1 or more.

    A filter that whitens over the memory of the thrusters does not know of a tether, a helmsman or a swell.
    """
    grid = fit.problem.grid
    longest_s = max(float(np.ptp(fit.problem.t[span])) for span in fit.problem.spans)
    rates = np.geomspace(math.tau / max(longest_s, 2.0 * SLOW_S), math.tau / SLOW_S, SLOW_RATES)
    angles = np.outer(grid.times_s - grid.times_s[0], rates)
    found = score(fit, np.hstack([np.cos(angles), np.sin(angles)]) * grid.steps_s[:, None])
    inverse = np.linalg.pinv(found.information, rcond=1e-9, hermitian=True)
    known = float(np.trace(inverse @ found.information))
    return max(1.0, float(found.values @ found.information @ found.values) / max(1.0, known))


def _beyond(values: Array, shifts: Array, fit: Fit, high: float) -> float:
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
