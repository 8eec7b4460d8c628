"""Whitening of regression rows by a noise model: white noise of the velocity, and thrust noise that moves the vehicle.

A row of the filtered regression has the noise of its velocity and what the thrust noise did to the vehicle within the
memory of the regression's filter. This disturbance decays with the pole of that filter and grows with the effort of the
thrusters, so a vehicle with thrusters at rest is hardly disturbed. A Kalman filter of the disturbance predicts each
column of a row from the rows before it; what is left is white, so recursive least squares of it is generalized least
squares of the record (Harvey 1989, Forecasting, Structural Time Series Models and the Kalman Filter, section 3.4).
`fit.whitening` does the same to the residuals of a whole record.
"""

import math
from collections.abc import Sequence

from hindrax_ident.model.thrust_lag import LaggedInput

THRUST_NOISE_s = 1e-4
"""Density of the thrust noise per squared thrust: 3 % for a tenth of a second."""
RATE_NOISE_radps = 0.0025
"""Noise of a gyroscope's mean over 15 ms, which weighs least against the thrust noise; a Doppler log [m/s] has more."""
LEAST_MEMORY_s = 0.02
"""Shortest time constant of the thrust noise behind the lag of the thrusters."""
MOST_EFFORT = 1e12
"""Effort [N^2, N^2 m^2] beyond that of any vehicle: a message may say anything, and what is not a number."""
UNKNOWN = 1e6
"""Variance of a disturbance about which nothing is known."""


class RowWhitener:
    """Kalman filter of the disturbance of one axis and of the acceleration that drives it.

    Variances are in units of that of the velocity's noise, so whitened rows have the noise of a velocity [m/s, rad/s].
    """

    def __init__(self, columns: int, lag_s: float, mass: float) -> None:
        """`columns` of a row, its response among them; the prior `mass` [kg, kg m^2] only weights the rows."""
        self._columns = columns
        self._density = THRUST_NOISE_s / (mass * RATE_NOISE_radps) ** 2
        self._rate = 1.0 / max(lag_s, LEAST_MEMORY_s)
        self._effort = LaggedInput(lag_s)
        self._t_row = math.nan
        self.restart()

    def restart(self) -> None:
        """Forget the disturbance: after a gap, or before the first row."""
        self._mean = ((0.0, 0.0),) * self._columns
        self._variance = UNKNOWN, 0.0, 0.0

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
        density, share = self._density * effort / step, c / b * (at_b - at_a)
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
