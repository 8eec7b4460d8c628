"""How a vehicle answers a pulse, by the prior of its file: the shape in time; and what of it a recording shows.

For a second or two about rest each degree of freedom answers on its own: M x'' + D x' + G x = F(t), the force being
that after the lag of the thrusters. The response to one newton is the regressor; its coefficient in the rates of the
gyroscope and in the specific force is the wrench that the thruster really gives: six numbers, each with a deviation.

Symbols: M, D, G (6,) inertia with added mass, drag taken as linear, restoring (`Prior`). n times of the model, on a
grid of its own; k of a sensor, onto which the model is interpolated. The scale of the prior's inertia goes
into the answer: a vehicle twice as heavy as its file seems to have thrusters half as strong.
"""

import math
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.commissioning.recording import Recording, Series
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.vehicle import AXES, Vehicle

STEP_S = 0.004
BEFORE_S, AFTER_S = 0.25, 0.6
"""Rest before a pulse, and what is looked at after it."""
LINEARIZED_AT = (0.1, 0.1, 0.1, 0.3, 0.3, 0.3)
"""Rates at which the quadratic drag is taken as linear [m/s, rad/s]."""
LEAST_SAMPLES = 20
CORRELATED = 4.0
"""Samples of a filtered sensor that count as one."""


@dataclass(frozen=True, slots=True)
class Window:
    """An interval [s], begun at rest `BEFORE_S` ahead of the first pulse."""

    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Answer:
    """Wrench (6,) that explains the motion in a window, per newton or as a whole [-, m or N, N m], its deviation (6,).

    `misfit`: sum of squared residuals of the rates over their noise.
    """

    wrench: Matrix
    sigma: Matrix
    misfit: float


class Prior:
    """Inertia, linear drag and restoring of each axis, as arrays (6,)."""

    def __init__(self, vehicle: Vehicle) -> None:
        freedoms = [prior_dynamics(vehicle)[axis] for axis in AXES]
        self.inertia = np.array([one.inertia for one in freedoms])
        self.drag = np.array([one.drag.resistance(v) / v for one, v in zip(freedoms, LINEARIZED_AT, strict=True)])
        self.restoring = np.array([max(0.0, one.restoring) for one in freedoms])

    def respond(self, times_s: Matrix, force: Matrix) -> tuple[Matrix, Matrix]:
        """Simulate the body from rest under a force, each axis for itself: drag and restoring are linear.

        Semi-implicit Euler steps, the force as its mean over the step: the position follows the new rate, so that what
        restores neither feeds nor damps the swing.

        Parameters
        ----------
        times_s : (n,) [s]
            Of the steps.
        force : (n,) or (n, 6) [N, N m]
            On every axis alike, or a wrench.

        Returns
        -------
        tuple[Matrix, Matrix]
            Accelerations and rates, (n, 6) each [m/s^2, rad/s^2], [m/s, rad/s].
        """
        force = force[:, None] * np.ones(6) if force.ndim == 1 else force
        accelerations, rates = np.zeros((len(times_s), 6)), np.zeros((len(times_s), 6))
        x, v = np.zeros(6), np.zeros(6)
        for at in range(1, len(times_s)):
            dt = times_s[at] - times_s[at - 1]
            # The mean of both ends of the step, since a pulse begins and ends between two.
            a = (0.5 * (force[at] + force[at - 1]) - self.drag * v - self.restoring * x) / self.inertia
            v = v + a * dt
            x = x + v * dt
            accelerations[at], rates[at] = a, v
        return accelerations, rates


def lagged(times_s: Matrix, forces: Series, window: Window, lag_s: float) -> Matrix:
    """Forces of all thrusters after a lag of first order.

    A command holds until the next one, so the lag over a step is an exponential, exactly but for where in the step the
    command came. A second before the window is read along, for the command that still holds at its beginning.

    Parameters
    ----------
    times_s : (n,) [s]
        At which they are wanted.
    forces
        Commanded ones, each from its time on [N].
    window
        Of the pulse.
    lag_s : [s]
        Time constant.

    Returns
    -------
    Matrix
        (n, thrusters) [N].
    """
    at_s, rows = forces.between(window.begin_s - 1.0, window.end_s)
    count = rows.shape[1] if len(rows) else 0
    wanted = np.zeros((len(times_s), count))
    before = np.searchsorted(at_s, times_s, side="right") - 1
    wanted[before >= 0] = rows[before[before >= 0]]
    given = np.zeros_like(wanted)
    for at in range(1, len(times_s)):
        dt = times_s[at] - times_s[at - 1]
        # A lag of zero is a thruster that follows at once.
        keep = np.exp(-dt / lag_s) if lag_s > 0.0 else 0.0
        given[at] = wanted[at] + (given[at - 1] - wanted[at]) * keep
    return given


def grid(window: Window) -> Matrix:
    """Times (n,) of the model in a window [s]."""
    return np.asarray(np.arange(window.begin_s, window.end_s, STEP_S))


class MotionView:
    """The motion in a window as the inertial sensor shows it, in its own axes.

    `offset_radps`: of the gyroscope. `acceleration` (n, 3), `rates` (n, 3).
    """

    def __init__(self, recording: Recording, window: Window, offset_radps: Matrix) -> None:
        self.times_s, rows = recording.inertial.between(window.begin_s, window.end_s)
        self.rates = rows[:, 3:] - offset_radps
        self.known = len(self.times_s) > LEAST_SAMPLES
        self.acceleration = _without_gravity(self.times_s, rows[:, :3], self.rates, window) if self.known else rows

    def answer(self, turn: Matrix, lever_m: Matrix, model_s: Matrix, model: tuple[Matrix, Matrix]) -> Answer:
        """Wrench per unit of a force that explains the motion.

        Moments first, by the rates: a gyroscope reads the same everywhere on the body. With them the angular
        acceleration is known, and what it does at the lever, omega' x r, can be taken off the specific force; what is
        left is of the center of mass and gives the forces. An offset is fitted along with the rates, an offset and a
        slope with the accelerations: carried gravity drifts by the gyroscope's error. omega x (omega x r) is left out:
        it is of second order in rates that stay small. The misfit counts only the rates, which gravity cannot spoil.

        Parameters
        ----------
        turn : (3, 3) [-]
            From the sensor into the body.
        lever_m : (3,) [m]
            Of the sensor from the center of mass.
        model_s : (k,) [s]
            Times of the model.
        model : (k, 6), (k, 6)
            Accelerations and rates under the force.

        Returns
        -------
        Answer
            (6,) per newton [-, m], its deviation and the misfit.
        """
        at_s, rates = self.times_s, self.rates @ turn.T
        shapes = [[np.interp(at_s, model_s, part[:, axis]) for axis in range(6)] for part in model]
        since, even = at_s - at_s[0], np.ones_like(at_s)
        wrench, sigma, misfit = np.zeros(6), np.zeros(6), 0.0
        for axis in range(3, 6):
            wrench[axis], sigma[axis], left = _fit(rates[:, axis - 3], shapes[1][axis], even)
            misfit += left
        # By the model, not by differences of the rates: those are noisier than what they are to explain.
        turning = np.column_stack([wrench[axis] * shapes[0][axis] for axis in range(3, 6)])
        linear = self.acceleration @ turn.T - np.cross(turning, lever_m)
        for axis in range(3):
            wrench[axis], sigma[axis], _ = _fit(linear[:, axis], shapes[0][axis], even, since)
        return Answer(wrench, sigma, misfit)


def _without_gravity(times_s: Matrix, force: Matrix, rates: Matrix, window: Window) -> Matrix:
    """Acceleration (n, 3): gravity, as it was before the pulse, is carried on by the gyroscope and taken off.

    Specific force is acceleration minus gravity; at rest it points up, so `-rest` is down, and its own size is used for
    gravity's: an accelerometer's scale may be off by more than g differs from place to place.
    """
    # Before anything pushes: then all that the accelerometer feels is gravity.
    quiet = times_s < window.begin_s + BEFORE_S
    rest = force[quiet].mean(axis=0) if quiet.any() else force[0]
    size = float(np.linalg.norm(rest)) or GRAVITY_mps2
    return np.asarray(force + size * carried(times_s, rates, -rest / size))


def carried(times_s: Matrix, rates: Matrix, down: Matrix) -> Matrix:
    """Direction of gravity in the axes of a gyroscope.

    d' = -omega x d: what is fixed to the earth turns backwards in the body. An Euler step lengthens d a little; it is
    divided by its length.

    Parameters
    ----------
    times_s : (n,) [s]
        Of the samples.
    rates : (n, 3) [rad/s]
        Of the gyroscope.
    down : (3,) [-]
        Direction at the first sample.

    Returns
    -------
    Matrix
        (n, 3) [-], of length one.
    """
    x, y, z = down.tolist()
    found = np.empty_like(rates)
    before_s = float(times_s[0])
    for at, (now_s, (p, q, r)) in enumerate(zip(times_s.tolist(), rates.tolist(), strict=True)):
        dt, before_s = now_s - before_s, now_s
        x, y, z = x - (q * z - r * y) * dt, y - (r * x - p * z) * dt, z - (p * y - q * x) * dt
        norm = math.sqrt(x * x + y * y + z * z)
        x, y, z = x / norm, y / norm, z / norm
        found[at] = (x, y, z)
    return found


def _fit(signal: Matrix, shape: Matrix, *others: Matrix) -> tuple[float, float, float]:
    """Coefficient of a shape in a signal beside other regressors, its deviation, the sum of squares that is left.

    Least squares; the pseudo-inverse because a window without a pulse has a shape of zeros, whose coefficient is 0.
    """
    columns = np.column_stack((shape, *others))
    found, *_ = np.linalg.lstsq(columns, signal, rcond=None)
    left = float(np.sum((signal - columns @ found) ** 2))
    normal = np.linalg.pinv(columns.T @ columns)
    noise = CORRELATED * left / max(1, len(signal) - columns.shape[1])
    return float(found[0]), float(np.sqrt(max(0.0, noise * normal[0, 0]))), left
