"""Depth, heave velocity and altitude from pressure, sonar and accelerometer together: nothing is differentiated.

A Kalman filter with the states depth, its rate, the accelerometer's vertical bias and depth of the floor. It is written
out, because filterpy takes 1.4 s to import (scipy.stats), which every restart of the control process would wait for; a
test holds it against filterpy.
COB-2023-1394 took the derivative of the sonar's altitude instead and found that it oscillates.
Pressure becomes depth in `hindrax_core/vehicle.py` (`Water.depth_m`), and is brought here by `aiding.py`.

Symbols, as in every textbook: state x = (z, z', b, h), covariance P (4, 4), transition F, input B of the measured
acceleration, process noise Q, measurement row H (1, 4) with variance R. z and h grow downward: z is the depth of the
center of mass, h that of the floor, b [m/s^2] what the accelerometer reads too little of the downward acceleration.

    z'' = a + b + white noise,    b' = white noise,    h' = white noise
    depth measures z,    altitude measures h - z

The floor is a state because the vehicle moves over it: with the altitude as a measurement of z alone, every step in the
floor would be a step in depth. Pressure and sonar then correct the same rate, and the accelerometer carries it between.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hindrax_core.knobs import knob

Matrix: TypeAlias = NDArray[np.float64]
Model: TypeAlias = tuple[Matrix, Matrix, Matrix]

IDENTITY = np.eye(4)
FLOOR = np.array([[0.0, 0.0, 0.0, 1.0]])
MOST_MODELS = 1000
JUMP_m, JUMP_COUNTS = 0.15, 2
"""A depth that jumps by more counts as so many times the refusals that it took; at the surface a sensor comes out."""
MOST_SURPLUS = 200
"""Refused depths that are remembered: ten seconds of good ones make up for whatever there was."""


@dataclass(frozen=True)
class FilterKnobs:
    """Noise and gates of all filters."""

    accelerometer_noise: float = knob(0.01, 1e-4, 10.0, "noise of the acceleration [m/s^2/sqrt(Hz)]")
    gate: float = knob(5.0, 1.0, 100.0, "innovation, in standard deviations, above which a measurement is refused [-]")
    patience: int = knob(10, 1, 1000, "refusals in a row after which a filter resets its state [-]")


@dataclass(frozen=True)
class VerticalKnobs(FilterKnobs):
    """Noise of the vertical model."""

    heave_bias_mps2: float = knob(0.3, 0.0, 5.0, "uncertainty of the accelerometer bias at the start [m/s^2]")
    heave_bias_walk: float = knob(0.005, 0.0, 1.0, "random walk of that bias [m/s^2/sqrt(s)]")
    floor_walk: float = knob(0.01, 0.0, 10.0, "unevenness of the floor, as a walk in time [m/sqrt(s)]")


class VerticalFilter:
    """States: depth z [m], z' [m/s], bias [m/s^2], depth of the floor [m]. One prediction per tick."""

    def __init__(self, knobs: VerticalKnobs) -> None:
        self._knobs = knobs
        self._x: Matrix = np.zeros((4, 1))
        self._P: Matrix = np.diag([1e4, 0.25, knobs.heave_bias_mps2**2, 1e4])
        self._model_of = lru_cache(MOST_MODELS)(self._model)
        self._acceleration_mps2, self._ticked = 0.0, False
        self._refused = {"depth": 0, "altitude": 0}
        self.refused_depths = 0
        """Recent surplus of refused over accepted depths."""
        self.has_depth = False
        self.has_floor = False

    def predict(self, acceleration_mps2: float, dt_s: float) -> None:
        """Advance by a mean acceleration (down is positive, gravity taken off)."""
        self._acceleration_mps2, self._ticked = acceleration_mps2, True
        F, B, Q = self._model_of(dt_s)
        self._x = F @ self._x + B * acceleration_mps2
        self._P = F @ self._P @ F.T + Q

    def _model(self, dt: float) -> Model:
        """Transition, input and noise of a tick; kept, because ticks come in a few lengths only.

        Q is that of white acceleration over the tick, exactly; the walk of the bias adds far less to z and z'.
        """
        half = 0.5 * dt * dt
        F = np.array([[1.0, dt, half, 0.0], [0.0, 1.0, dt, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        knobs = self._knobs
        a = knobs.accelerometer_noise**2
        Q = np.diag([a * dt**3 / 3.0, a * dt, knobs.heave_bias_walk**2 * dt, knobs.floor_walk**2 * dt])
        Q[0, 1] = Q[1, 0] = a * half
        return F, np.array([[half], [dt], [0.0], [0.0]]), Q

    def depth(self, depth_m: float, sigma_m: float, delay_s: float) -> bool:
        """Fuse a depth.

        Parameters
        ----------
        depth_m, sigma_m : [m]
            Of the body origin, and its standard deviation.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            False when it is refused.
        """
        if not self.has_depth:
            self.has_depth = True
            # An altitude that came before has placed the floor below a depth of nothing: both go down together.
            self._x[3, 0] += depth_m - self._x[0, 0]
            self._x[0, 0] = depth_m
        # It measured the depth of then. The state is not wound back and the ticks since not repeated: delays are tens
        # of milliseconds, in which the covariance hardly moves. At a busy start they are a second, in which the bias
        # makes as much as 0.1 m: so it has its share in the row.
        H = self._row_then(delay_s)
        used = self._fuse("depth", depth_m - self._depth_then_m(delay_s), sigma_m, H)
        surplus = self.refused_depths - 1 if used else self.refused_depths + 1
        self.refused_depths = max(0, min(MOST_SURPLUS, surplus))
        return used

    def altitude(self, altitude_m: float, sigma_m: float, delay_s: float) -> bool:
        """Fuse a height above the floor.

        Parameters
        ----------
        altitude_m, sigma_m : [m]
            Of the body origin, and its standard deviation.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            False when it is refused.
        """
        if not self.has_floor:
            self.has_floor = True
            self._x[3, 0] = altitude_m + self._x[0, 0]
        H = FLOOR - self._row_then(delay_s)
        expected_m = float(self._x[3, 0]) - self._depth_then_m(delay_s)
        return self._fuse("altitude", altitude_m - expected_m, sigma_m, H)

    def _row_then(self, delay_s: float) -> Matrix:
        """Row of the depth some time ago: first row of the transition, back along the path.

        Before the first tick it is not known what the accelerometer reads: the path is then straight.
        """
        half = 0.5 * delay_s * delay_s if self._ticked else 0.0
        return np.array([[1.0, -delay_s, half, 0.0]])

    def _depth_then_m(self, delay_s: float) -> float:
        """Depth some time ago: back along the path, which the acceleration bends, as measured and with its bias."""
        known_m = (self._row_then(delay_s) @ self._x).item()
        return float(known_m + 0.5 * delay_s * delay_s * self._acceleration_mps2)

    def _fuse(self, source: str, off: float, sigma: float, H: Matrix) -> bool:
        # One measurement at a time, so its innovation covariance is a number and nothing is inverted. Joseph's form of
        # P stays symmetric and positive whatever the rounding; the short form (I - K H) P does not, in a run of hours.
        """Correct by a measurement that is off by so much, of this deviation and row H (1, 4); False when refused."""
        cross, R = self._P @ H.T, sigma * sigma
        variance = (H @ cross).item() + R
        if not off * off <= self._knobs.gate**2 * variance:
            return self._refuse(source, off)
        self._refused[source] = 0
        gain = cross / variance
        self._x = self._x + gain * off
        kept = IDENTITY - gain @ H
        self._P = kept @ self._P @ kept.T + R * (gain @ gain.T)
        return True

    def _refuse(self, source: str, off: float) -> bool:
        """Drop a measurement; after many in a row, reset its state instead.

        The gate would refuse for ever what has really moved (a floor that fell away, a tare): then it is the state that
        is wrong. Its variance grows by the square of what is off, and the next measurement takes it there.
        """
        self._refused[source] += 1
        if self._refused[source] >= self._knobs.patience:
            self._refused[source] = 0
            state = 0 if source == "depth" else 3
            self._P[state, state] += off * off
            # A depth that jumps is no depth: it takes long to be accepted again, also when the sensor pauses meanwhile.
            if source == "depth" and abs(off) > JUMP_m:
                self.refused_depths += JUMP_COUNTS * self._knobs.patience
        return False

    @property
    def depth_m(self) -> float:
        """Depth; NaN before the first pressure."""
        return float(self._x[0, 0]) if self.has_depth else math.nan

    @property
    def rate_mps(self) -> float:
        """Downward velocity."""
        return float(self._x[1, 0])

    @property
    def rate_variance(self) -> float:
        """Variance of the downward velocity [m^2/s^2]."""
        return float(self._P[1, 1])

    @property
    def depth_sigma_m(self) -> float:
        """Standard deviation of the depth; NaN before the first pressure."""
        return math.sqrt(self._P[0, 0]) if self.has_depth else math.nan

    @property
    def floor_m(self) -> float:
        """Depth of the floor; NaN before the first echo."""
        return float(self._x[3, 0]) if self.has_floor else math.nan

    @property
    def altitude_m(self) -> float:
        """Height above the floor; NaN before the first echo."""
        return float(self._x[3, 0] - self._x[0, 0]) if self.has_floor else math.nan
