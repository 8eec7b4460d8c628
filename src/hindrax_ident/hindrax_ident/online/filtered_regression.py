"""Regression without differentiation: every signal of the model passes the same low-pass filter.

With the filter F: f' = -rate f + x, applied to both sides of M v' = tau - columns(v) . theta, the filtered acceleration
needs no derivative: (v')_F = v + z with z' = -rate (v + z). It is exact for a rate that changes with time. So

    v + z = (1/M) tau_F - (theta_i / M) column_i,F + noise

is linear in 1/M and theta/M, holds at every velocity sample at any time, and its noise is that of the velocity
itself, white when the rate is the slope of the drag over the mass (Young 2011, Recursive Estimation and Time-Series
Analysis, chapter 8, calls that the optimal prefilter). Thrust is piecewise constant behind a first-order lag and
filtered in closed form; velocity is linear between samples.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import LEAST_SPEED, Model
from hindrax_ident.model.thrust_lag import LEAST_MEMORY_S, LaggedInput
from hindrax_ident.online.cross_forces import CrossForces
from hindrax_ident.online.lag_and_delay import GOES
from hindrax_ident.online.thrust_cascade import ThrustCascade

SETTLED = 0.05
"""Largest share of the filters' initial transient when samples are used: three time constants."""
CLEAR_SIGN = 8.0
"""Square of a velocity, in variances of its noise, above which its own sign is used."""
DIRECTION_S = 0.3
"""Time over which the velocities before have a sign: a vehicle at rest moves slower than the noise of one velocity, and
one that turns back has both signs within a second."""
THRUST_NOISE_S = 1e-4
"""Density of the thrust noise per squared thrust: 3 % for a tenth of a second."""
LEAST_NOISE = 0.0025
"""Least noise of a velocity against which thrust noise is weighed [m/s, rad/s]: that of a gyroscope's mean over 15 ms.
A Doppler log has four times that."""
MOST_EFFORT = 1e12
"""Effort [N^2, N^2 m^2] beyond that of any vehicle: a message may contain anything, also NaN."""
REMEMBERED, PACE = 0.99, 0.02
"""Part of the correlation of innovations that is kept from one to the next, and how fast the noise follows it."""
UNKNOWN = 1e6
"""Variance of a disturbance about which nothing is known."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One row of the regression: y = x . (theta / M, 1 / M) + noise of the velocity [m/s, rad/s].

    `slope` is the derivative of x by this velocity; `speed` is the filtered velocity; `settled`: the initial
    transient of the filters has decayed; `shapes`: columns of what the thrust's delay differs from that of the filter,
    and those of thrust that goes by another lag than it comes (`lag_and_delay`) [N/s, N/s^2, ...; N m/s, ...];
    `incidence`: where the model `turns` the column of the drag by incidence, which is no unknown [m^2/s]; `cross`: what
    motion along the other axes does, where that is estimated (`cross_forces`) [N s, N m s].
    """

    x: tuple[float, ...]
    y: float
    slope: tuple[float, ...]
    speed: float
    settled: bool
    shapes: tuple[float, ...] = ()
    incidence: tuple[float, ...] = ()
    cross: tuple[float, ...] = ()


class FilteredRegression:
    """Filters of one axis; inputs in time order (seconds from any origin)."""

    def __init__(
        self, model: Model, lag_s: float, rate: float, shapes: int = 0, cross: CrossForces | None = None
    ) -> None:
        """`rate`: pole of the filters [1/s]; it and `noise_variance` may be changed at any time.

        `shapes`: number of columns for what the delay of the thrust differs from the lag, which needs one above 0;
        `cross`: what the other axes do, None where they are held.

        `velocity_time_s`, `thrust_time_s`: times of the last velocity and thrust command; NaN before the first.
        `speed_across` [m/s, rad/s]: the present one; `area_speed` [m/s]: that by the areas of a turned hull.
        """
        self.model, self.rate, self.noise_variance = model, rate, 0.0
        self.lag_s, self._split, self._shapes, self._cross = lag_s, model.split, shapes, cross
        self._thrust = ThrustCascade(1 + shapes)
        # Part of the thrust that goes: all changes toward zero. With it, lags that differ are found.
        self._goes = ThrustCascade(1 + GOES if shapes else 1)
        self._known = self._known_f = self._z = 0.0
        self._terms: tuple[float, ...] = ()
        self._position: tuple[float, float] | None = None
        self.speed_across = self.area_speed = 0.0
        self._t_thrust = self.thrust_time_s = math.nan
        self.restart()

    def restart(self) -> None:
        """Reset the velocity filters: after a gap, or before the first sample."""
        self.velocity_time_s, self._start = math.nan, 1.0
        self._sums = [0.0] * (len(self.model.names) - 1 + self.model.turns)
        self._recent = self._before = self._direction = 0.0

    def undo_last(self) -> None:
        """Undo the last velocity: an outlier would stay in the filters for seconds."""
        self.velocity_time_s, self._z, self._terms, self._sums, self._start, *sign = self._undo
        self._recent, self._before, self._direction = sign
        if self._cross:
            self._cross.undo_last()

    def thrust(self, t_s: float, force: float) -> None:
        """Force commanded from this time on, before the thrusters' lag [N, N m]."""
        before = self._thrust.command
        if math.isnan(self._t_thrust):
            self._t_thrust = t_s
            self._thrust.command = before = force
            self._thrust.rest()
        self._advance_thrust(t_s)
        self._thrust.command, self.thrust_time_s = force, t_s
        if abs(force) < abs(before) or force * before < 0.0:
            self._goes.command += (force if force * before > 0.0 else 0.0) - before

    def known(self, t_s: float, force: float) -> None:
        """Known force from this time on, in addition to the thrust, without lag [N, N m]."""
        self._advance_thrust(t_s)
        self._known = force

    def position(self, t_s: float, angle_rad: float) -> None:
        """Angle measured at this time, for the restoring moment."""
        self._position = (t_s, angle_rad)

    def across(self, _t_s: float, speed: float) -> None:
        """Speed across the axis from this time on, for the drag by it [m/s, rad/s]."""
        self.speed_across = speed

    def others(self, _t_s: float, nu: Sequence[float]) -> None:
        """Velocities of all axes from this time on, for what the others do (6,) [m/s, rad/s]."""
        if self._cross:
            self._cross.nu = nu

    def areas(self, _t_s: float, speed: float) -> None:
        """Speed across by the areas of a turned hull from this time on, for the drag by incidence [m/s]."""
        self.area_speed = speed

    def velocity(self, t_s: float, v: float, spread_s2: float = 0.0) -> Sample | None:
        """Add a velocity measured at this time.

        Parameters
        ----------
        t_s : [s]
            Later than the one before.
        v : [m/s, rad/s]
            Along the axis.
        spread_s2 : [s^2]
            Variance of the span of time over which it is a mean.

        Returns
        -------
        Sample | None
            Row of the regression; None for the first after a restart, which only initializes the filters.
        """
        terms = self._terms_at(t_s, v)
        sign = self._recent, self._before, self._direction
        self._undo = self.velocity_time_s, self._z, self._terms, self._sums, self._start, *sign
        if math.isnan(self.velocity_time_s):
            self.velocity_time_s, self._z, self._terms = t_s, -v, terms
            self._advance_thrust(t_s)
            self._known_f = 0.0
            self._thrust.restart_filter()
            self._goes.restart_filter()
            self._goes.lower(self._goes.command)
            if self._cross:
                self._cross.restart(v)
            return None
        self._advance_thrust(t_s)
        before, self.velocity_time_s = self.velocity_time_s, t_s
        ramp = self._advance_velocity(t_s - before, v, terms)
        sums, terms_of_model = [-total for total in self._sums], len(self.model.names) - 1
        force = self._thrust.filtered + self._known_f + 0.5 * spread_s2 * self._force_curvature
        return Sample(
            (*sums[:terms_of_model], force),
            v + self._z,
            self._slope(ramp, v, terms),
            self._linear(self._sums) * self.rate,
            self._start < SETTLED,
            (*self._thrust.shapes(self.lag_s), *self._goes.shapes(self.lag_s)),
            tuple(sums[terms_of_model:]),
            tuple(-force for force in self._cross.filtered) if self._cross else (),
        )

    def _terms_at(self, t_s: float, v: float) -> tuple[float, ...]:
        # Squaring adds the variance of the noise: subtract it.
        square = v * v - self.noise_variance
        # Near rest the sign is that of the noise; used as it is, each direction would take half of the noise for speed.
        ahead = v > 0.0 if square > CLEAR_SIGN * self.noise_variance else self._direction > 0.0
        square = square if ahead else -square
        crossed = ((math.hypot(v, self.speed_across) - abs(v)) * v,) if self.model.crossed else ()
        turned = ((math.hypot(v, self.area_speed) - abs(v)) * v,) if self.model.turns else ()
        return (*self._drag_terms(square, v, ahead=ahead), 1.0, *crossed, *self._restoring_at(t_s, v), *turned)

    def _drag_terms(self, square: float, linear: float, *, ahead: bool) -> tuple[float, ...]:
        """Columns of the drag; in the place of its direction where both have their own."""
        if not self._split:
            return (square, linear)
        return (square, linear, 0.0, 0.0) if ahead else (0.0, 0.0, square, linear)

    def _restoring_at(self, t_s: float, v: float) -> tuple[float, ...]:
        if not self.model.restores:
            return ()
        if self._position is None:
            return (0.0,)
        since, angle = self._position
        return (math.sin(angle + v * (t_s - since)),)

    def _slope(self, ramp: float, v: float, terms: tuple[float, ...]) -> tuple[float, ...]:
        rest = [0.0] * (len(self.model.names) - self.model.drags)
        if self.model.crossed:
            rest[1] = -ramp * slope_by_speed_across(v, self.speed_across)
        return (*self._drag_terms(-2.0 * ramp * abs(v), -ramp, ahead=bool(terms[1])), *rest)

    def _advance_velocity(self, step: float, v: float, terms: tuple[float, ...]) -> float:
        """Advance the filters over one interval, exactly for inputs linear in it; return the weight of its end."""
        rate = self.rate
        lost = -math.expm1(-rate * step)
        keep, constant = 1.0 - lost, lost / rate
        ramp = (step - constant) / (rate * step)
        first = constant - ramp
        old = self._linear(self._terms)
        self._z = keep * self._z - rate * (first * old + ramp * v)
        self._sums = [
            keep * total + first * was + ramp * now
            for total, was, now in zip(self._sums, self._terms, terms, strict=True)
        ]
        if self._cross:
            self._cross.advance(step, (keep, first, ramp), v)
        # A velocity derived from positions has the noise of one of them in common with the velocity before: the sign of
        # the next is that of a mean without this one. A mean of the past comes through zero too late, which would give
        # a part of each direction to the other (heave: 3 % of the buoyancy): so it is extrapolated by its own trend.
        self._direction = self._recent + (self._recent - self._before) * (1.0 + step / DIRECTION_S)
        part = -math.expm1(-step / DIRECTION_S)
        self._recent += part * (v - self._recent)
        self._before += part * (self._recent - self._before)
        self._start *= keep
        self._terms = terms
        return ramp

    def _linear(self, terms: Sequence[float]) -> float:
        """Part of the velocity in the terms, in either direction."""
        return terms[1] + (terms[3] if self._split else 0.0)

    @property
    def _force_curvature(self) -> float:
        """Second derivative of the filtered thrust: corrects its mean over a span, like that of the velocity."""
        thrust, rate = self._thrust, self.rate
        rise = (thrust.command - thrust.lagged) / self.lag_s if self.lag_s > 0.0 else 0.0
        return rise - rate * (thrust.lagged + self._known - rate * (thrust.filtered + self._known_f))

    def _advance_thrust(self, t_s: float) -> None:
        """Advance lags and filters, for a command constant since the last call."""
        step = t_s - self._t_thrust
        if not step > 0.0:
            return
        kept = math.exp(-self.rate * step)
        self._known_f = kept * self._known_f + self._known * (1.0 - kept) / self.rate
        self._thrust.advance(step, self.lag_s, self.rate)
        if self._shapes:
            self._goes.advance(step, self.lag_s, self.rate)
        self._t_thrust = t_s


def slope_by_speed_across(v: float, across: float) -> float:
    """Derivative of (sqrt(v^2 + w^2) - |v|) v by the velocity along, w the speed across [m/s, rad/s]."""
    whole = max(math.hypot(v, across), LEAST_SPEED)
    return whole + v * v / whole - 2.0 * abs(v)


def physical(scaled_values: Sequence[float], covariance: Array) -> tuple[Array, Array]:
    """Parameters (theta, M) and their covariance from those of the regression (theta / M, 1 / M): (p,), (p, p)."""
    q = np.asarray(scaled_values, float)
    mass = 1.0 / q[-1]
    theta = np.append(q[:-1] * mass, mass)
    jacobian = np.eye(len(q)) * mass
    jacobian[:, -1] = -theta * mass
    return theta, jacobian @ covariance @ jacobian.T


scaled = physical
"""The inverse of `physical`, which is its own."""


class RowWhitener:
    """Whitening of the rows by a Kalman filter of the disturbance of one axis and of the acceleration that drives it.

    A row has the noise of its velocity and what the thrust noise did to the vehicle within the memory of the
    regression's filter. This disturbance decays with the pole of that filter and grows with the effort of the
    thrusters, so a vehicle with thrusters at rest is hardly disturbed. The filter predicts each column of a row from
    the rows before it; what is left is white, so recursive least squares of it is generalized least squares of the
    record (Harvey 1989, Forecasting, Structural Time Series Models and the Kalman Filter, section 3.4).
    `fit.whitening` does the same to the residuals of a whole record.

    Variances are in units of that of the velocity's noise, so whitened rows have the noise of a velocity [m/s, rad/s].

    How large thrust noise is beside that of a velocity nobody knows before: `adapt` finds it. Taken too large, rows
    after a change of thrust, which tell the mass, weigh too little: with a gyroscope's noise for a Doppler log's, the
    interval of surge's mass was half as wide again.
    """

    def __init__(self, columns: int, lag_s: float, mass: float) -> None:
        """`columns` of a row, its response among them; the prior `mass` [kg, kg m^2] only weights the rows."""
        self._columns, self.noise = columns, LEAST_NOISE
        self._per_effort = THRUST_NOISE_S / mass**2
        self._last = self._alike = self._power = 0.0
        self._rate = 1.0 / max(lag_s, LEAST_MEMORY_S)
        self._effort = LaggedInput(lag_s)
        self._t_row = math.nan
        self.restart()

    def restart(self) -> None:
        """Forget the disturbance: after a gap, or before the first row."""
        self._mean = ((0.0, 0.0),) * self._columns
        self._variance, self._last = (UNKNOWN, 0.0, 0.0), 0.0

    def adapt(self, innovation: float, most: float) -> None:
        """Weigh thrust noise so that innovations in a row are neither alike nor alternate (Mehra 1970).

        Those of a filter that expects more of it than there is follow the noise of each velocity, and alternate; if it
        expects less, or forces act that nobody knows, they stay alike.

        Parameters
        ----------
        innovation
            Of a whitened row [m/s, rad/s].
        most
            Noise of a velocity that is not exceeded: that of the residuals [m/s, rad/s].
        """
        self._alike = REMEMBERED * self._alike + innovation * self._last
        self._power = REMEMBERED * self._power + innovation * innovation
        self._last = innovation
        if self._power > 0.0:
            changed = self.noise * math.exp(-PACE * self._alike / self._power)
            self.noise = max(LEAST_NOISE, min(most, changed))

    def effort(self, t_s: float, effort: float) -> None:
        """Sum of the squared contributions of all thrusters from this time on, before their lag [N^2, N^2 m^2]."""
        self._effort.set(t_s, min(MOST_EFFORT, effort))  # in this order: it is the bound where the other is no number

    def advance(self, t_s: float, pole: float) -> None:
        """Let the disturbance decay with the pole of the regression's filter [1/s], and grow, up to the next row."""
        effort = self._effort.taken(t_s)
        step, self._t_row = t_s - self._t_row, t_s
        if not step > 0.0:
            return
        a, b = pole * (1.0 + 1e-6), self._rate * (1.0 - 1e-6)  # they may coincide
        at_a, at_b, c = math.exp(-a * step), math.exp(-b * step), b / (a - b)
        # An impulse of thrust noise leaves an acceleration b e^-bt, which has moved the vehicle by c (e^-bt - e^-at).
        aa, ab, bb = (1.0 - at_a * at_a) / (2.0 * a), (1.0 - at_a * at_b) / (a + b), (1.0 - at_b * at_b) / (2.0 * b)
        density = self._per_effort * effort / (step * self.noise**2)
        share = c / b * (at_b - at_a)
        moved, both, pushed = self._variance
        self._variance = (
            at_a**2 * moved + 2.0 * at_a * share * both + share**2 * pushed + density * c * c * (aa - 2.0 * ab + bb),
            at_b * (at_a * both + share * pushed) + density * b * c * (bb - ab),
            at_b**2 * pushed + density * b * b * bb,
        )
        self._mean = tuple((at_a * move + share * push, at_b * push) for move, push in self._mean)

    @property
    def scale(self) -> float:
        """Weight of the present row: standard deviation of the velocity's noise over that of the row [-]."""
        return 1.0 / math.sqrt(1.0 + self._variance[0])

    def unpredicted(self, row: Sequence[float]) -> list[float]:
        """Part of a row that the rows before do not predict."""
        return [value - move for value, (move, _) in zip(row, self._mean, strict=True)]

    def update(self, unpredicted: Sequence[float]) -> None:
        """Correct the disturbance by what was not predicted of the present row."""
        moved, both, pushed = self._variance
        gain, push_gain = moved / (1.0 + moved), both / (1.0 + moved)
        self._mean = tuple(
            (move + gain * value, push + push_gain * value)
            for value, (move, push) in zip(unpredicted, self._mean, strict=True)
        )
        self._variance = gain, push_gain, pushed - push_gain * both
