"""The joint extended Kalman filter: velocity, position and parameters as one state (Ljung 1979, IEEE TAC 24).

In one pass it is as accurate as output error, but it diverges from a poor initial estimate: recursive least squares
initialize it after enough samples. State: v, s, then theta / M and 1 / M. Between samples the motion
is the implicit midpoint rule over the exact impulse of the lagged thrust.
"""

import math

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.thrust_lag import LaggedInput
from hindrax_ident.online.filtered_regression import physical, scaled


class JointFilter:
    """One axis; inputs in time order. It does nothing before `start`."""

    def __init__(self, model: Model, lag_s: float, position_sigma: float = 0.01) -> None:
        """`position_sigma`: standard deviation of measured positions [m, rad]."""
        self._model = model
        self._thrust, self._known = LaggedInput(lag_s), LaggedInput(0.0)
        self._t_state = math.nan
        self._across = 0.0
        self._noise, self._position_noise = 0.0, position_sigma**2
        self._x: Array = np.zeros(0)
        self._P: Array = np.zeros((0, 0))

    @property
    def started(self) -> bool:
        """Whether `start` was called."""
        return len(self._x) > 0

    def start(self, t_s: float, theta: Array, covariance: Array, noise_variance: float) -> None:
        """Start at this time; the next samples determine the motion.

        Parameters
        ----------
        t_s : [s]
            Time of the state.
        theta, covariance : (p,), (p, p)
            Parameters and their covariance.
        noise_variance : [m^2/s^2, rad^2/s^2]
            Of one velocity.
        """
        q, Q = scaled(theta.tolist(), covariance)
        n = len(q) + 2
        self._x = np.concatenate([[0.0, 0.0], q])
        self._P = np.zeros((n, n))
        self._P[2:, 2:] = Q
        self._P[0, 0], self._P[1, 1] = 1e2, 1e2
        self._noise, self._t_state = noise_variance, t_s
        self._impulse(t_s)

    def estimate(self) -> tuple[Array, Array]:
        """Parameters in the model's order and their covariance: (p,), (p, p)."""
        return physical(self._x[2:].tolist(), self._P[2:, 2:])

    def thrust(self, t_s: float, force: float) -> None:
        """Thrust commanded from this time on [N, N m]."""
        self._thrust.set(t_s, force)

    def known(self, t_s: float, force: float) -> None:
        """Known force from this time on [N, N m]."""
        self._known.set(t_s, force)

    def across(self, _t_s: float, speed: float) -> None:
        """Speed across the axis from this time on, for the drag by it [m/s, rad/s]."""
        self._across = speed

    def _impulse(self, t_s: float) -> float:
        """Impulse up to this time since it was taken last [N s, N m s]."""
        return self._thrust.taken(t_s) + self._known.taken(t_s)

    def velocity(self, t_s: float, v: float) -> None:
        """Velocity measured at this time [m/s, rad/s]."""
        if self.started:
            self._predict(t_s)
            self._correct(0, v, self._noise)

    def position(self, t_s: float, s: float) -> None:
        """Position measured at this time [m, rad]."""
        if self.started:
            self._predict(t_s)
            self._correct(1, s, self._position_noise)

    def _predict(self, t_s: float) -> None:
        """Carry velocity v, position s and covariance to this time: an implicit midpoint step of M v' = thrust - force.

        The parameters q are over the mass, its inverse last: so v changes by q_M times the impulse, less h times the
        columns of the force in the middle of the step. The middle depends on the change; three rounds find it, steps
        being short.
        """
        h = t_s - self._t_state
        if not h > 0.0:
            return
        self._t_state, impulse = t_s, self._impulse(t_s)
        v, s, q = float(self._x[0]), float(self._x[1]), self._x[2:]
        middle = v
        for _ in range(3):
            columns = self._model.columns(np.array([middle]), np.array([s + 0.5 * h * middle]), self._across)[0]
            change = q[-1] * impulse - h * float(columns @ q[:-1])
            middle = v + 0.5 * change
        self._x[0], self._x[1] = v + change, s + h * middle
        F = self._transition(h, middle, s + 0.5 * h * middle, columns, impulse)
        self._P = F @ self._P @ F.T

    def _transition(self, h: float, v: float, s: float, columns: Array, impulse: float) -> Array:
        """Jacobian of the implicit midpoint step: (n, n)."""
        q = self._x[2:]
        slope = float(self._model.slope(q, np.array([v]), self._across)[0])
        turn = float(q[-2]) * math.cos(s) if self._model.restores else 0.0
        share = 1.0 / (1.0 + 0.5 * h * slope + 0.25 * h * h * turn)
        row = np.concatenate([[-h * slope - 0.5 * h * h * turn, -h * turn], -h * columns, [impulse]]) * share
        F = np.eye(len(self._x))
        F[0] += row
        F[1] += 0.5 * h * row
        F[1, 0] += h
        return F

    def _correct(self, index: int, measured: float, noise: float) -> None:
        """Scalar measurement of one state, in Joseph form."""
        P = self._P
        gain = P[:, index] / (P[index, index] + noise)
        self._x = self._x + gain * (measured - self._x[index])
        A = np.eye(len(P))
        A[:, index] -= gain
        self._P = A @ P @ A.T + noise * np.outer(gain, gain)
