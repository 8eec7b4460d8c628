"""Added mass and drag from a pendulum that comes to rest in water. Badawy, Omer 2012.

theta'' = alpha sin(theta) - beta theta' - gamma theta' |theta'| (16), with alpha = (B - M g) / ((M + m_a) r),
beta = K_L / (M + m_a), gamma = K_Q r / (M + m_a). The paper prints theta |theta'| in (16); its regressor (17) has the
form used here.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import savgol_filter

from hindrax_core.errors import HindraxError
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.experiment_record import Column, evenly
from hindrax_laboratory.least_squares import check_added_mass, fit_curve, least_squares, propagate

COLUMNS = (Column("time_s", "time [s], increasing"), Column("theta_rad", "angle from the vertical [rad]"))

NOT_A_PENDULUM = 0.5
"""Largest residual of the angle after the fit, root mean square, relative."""

RUN_AWAY = 20.0
"""Angle [rad] plus a tenth of the speed [rad/s] at which a simulation is aborted."""

NO_START = 0.9
"""The same for the regression, which only initializes the fit."""

FEWEST_PER_SWING = 10
"""Samples per swing below which a record shows noise, not swings."""

WINDOW_PARTS = (0.01, 0.02, 0.04, 0.08)
"""Candidate lengths of the smoothing polynomial, relative to the record."""


@dataclass(frozen=True, slots=True)
class Pendulum:
    """Known quantities: mass, buoyancy and the arm from the axis to the vehicle."""

    mass_kg: float
    buoyancy_N: float
    arm_m: float

    @property
    def net_weight_N(self) -> float:
        """Weight minus buoyancy, which turns the pendulum back."""
        return self.mass_kg * GRAVITY_mps2 - self.buoyancy_N


@dataclass(frozen=True, slots=True)
class Parameters:
    """alpha [1/s^2], beta [1/s], gamma [-], and what follows from them."""

    alpha: Value
    beta: Value
    gamma: Value
    added_mass_kg: Value
    k_l: Value
    k_q: Value


@dataclass(frozen=True, slots=True)
class PendulumFit:
    """The paper's regression (17-18), and an output-error fit, which does not differentiate the record."""

    regression: Parameters
    output_error: Parameters
    residual_rad: float
    samples: int
    time_s: Array
    theta_rad: Array
    model_rad: Array


def analyze(
    time_s: Array, theta_rad: Array, pendulum: Pendulum, window_s: float | None = None, source: str = "pendulum"
) -> PendulumFit:
    """Both estimates from one record: the paper's regression, and an output-error fit that begins with it.

    Parameters
    ----------
    time_s : (n,) [s]
        Rising.
    theta_rad : (n,) [rad]
        Angle from the vertical.
    pendulum
        Mass, buoyancy and arm.
    window_s : [s]
        Length of the smoothing polynomial that differentiates the angle; None: the best of four.
    source
        Name of the record, for errors.

    Returns
    -------
    PendulumFit
        alpha, beta, gamma and what follows from them, by both.

    Raises
    ------
    HindraxError
        When the weight does not exceed the buoyancy (no restoring moment), when the record is too short, and when no
        pendulum that comes to rest fits it.
    """
    if not pendulum.net_weight_N > 0.0:
        raise HindraxError(
            f"{source}: weight minus buoyancy is {pendulum.net_weight_N:.3g} N, wanted more than 0; "
            "check mass and buoyancy"
        )
    if (largest := float(np.max(np.abs(theta_rad)))) > math.pi:
        raise HindraxError(f"{source}: theta_rad reaches {largest:.3g}, wanted below {math.pi:.3g}; use radians")
    rate, (theta,) = evenly(time_s, [theta_rad], source)
    regression = _best_regression(theta, rate, window_s, source)
    first = _parameters(*regression, pendulum)
    values, covariance, model = _output_error(theta, rate, regression[0])
    if float(np.std(theta - model)) > NOT_A_PENDULUM * float(np.std(theta)):
        raise HindraxError(f"{source}: no pendulum motion fits the record; start it at the release, and check the axis")
    # Equivalent linear damping of the largest swing: a negative one would feed it.
    if values[1] + 8.0 / (3.0 * math.pi) * values[2] * float(np.max(np.abs(np.diff(model)))) * rate < 0.0:
        raise HindraxError(f"{source}: the swing grows, wanted a pendulum that comes to rest; cut the record")
    simulated = _parameters(values, covariance, pendulum)
    check_added_mass(simulated.added_mass_kg, pendulum.mass_kg, source, "mass, arm and buoyancy")
    time = np.arange(theta.size) / rate
    return PendulumFit(first, simulated, float(np.std(theta - model)), theta.size, time, theta, model)


def _best_regression(theta: Array, rate_Hz: float, window_s: float | None, source: str) -> tuple[Array, Array]:
    """Coefficients, (3,), and covariance, (3, 3), with the given window or the best of four."""
    length = theta.size / rate_Hz
    windows = [window_s] if window_s is not None else [part * length for part in WINDOW_PARTS]
    odd = sorted({max(9, round(window * rate_Hz)) | 1 for window in windows})
    usable = [window for window in odd if window <= theta.size // 4]
    if not usable:
        raise HindraxError(f"{source}: {theta.size} samples are too few for a window of {odd[0]}; record longer")
    found = [_regression(theta, rate_Hz, window) for window in usable]
    misfit, best = min((_misfit(fit[0], theta, rate_Hz), index) for index, fit in enumerate(found))
    if misfit > NO_START * float(np.std(theta)):
        raise HindraxError(f"{source}: no pendulum motion fits the record; start it at the release, and check the axis")
    return found[best]


def _misfit(values: Array, theta: Array, rate_Hz: float) -> float:
    """Root-mean-square difference [rad] of the simulated and the recorded angle; infinite where it diverges."""
    if not 0.0 < -values[0] < (2.0 * math.pi * rate_Hz / FEWEST_PER_SWING) ** 2 or abs(values[1]) > rate_Hz:
        return math.inf
    time = np.arange(theta.size) / rate_Hz
    return float(np.sqrt(np.mean((simulate(time, values, float(theta[0])) - theta) ** 2)))


def _regression(theta: Array, rate_Hz: float, window: int) -> tuple[Array, Array]:
    """Coefficients, (3,), and covariance, (3, 3), by (17-18), with derivatives from fourth-order polynomials."""
    smooth, speed, acceleration = (
        savgol_filter(theta, window, 4, deriv=order, delta=1.0 / rate_Hz)[window:-window] for order in (0, 1, 2)
    )
    regressor = np.column_stack((np.sin(smooth), -speed, -speed * np.abs(speed)))
    fit = least_squares(regressor, acceleration, ("alpha", "beta", "gamma"))
    return fit.values, fit.covariance


def _parameters(values: Array, covariance: Array, pendulum: Pendulum) -> Parameters:
    alpha, beta, gamma = (Value(float(v), math.sqrt(max(0.0, covariance[i, i]))) for i, v in enumerate(values))
    if not alpha.value < 0.0:
        raise HindraxError(f"pendulum: alpha is {alpha.value:.3g}, wanted below 0; the record does not swing back")

    def total(v: Array) -> float:
        return -pendulum.net_weight_N / (float(v[0]) * pendulum.arm_m)

    added = propagate(lambda v: total(v) - pendulum.mass_kg, values, covariance)
    k_l = propagate(lambda v: float(v[1]) * total(v), values, covariance)
    k_q = propagate(lambda v: float(v[2]) * total(v) / pendulum.arm_m, values, covariance)
    return Parameters(alpha, beta, gamma, added, k_l, k_q)


def simulate(time_s: Array, coefficients: Array, theta_rad: float, speed_radps: float = 0.0) -> Array:
    """Angle after the release, by the equation of the head of this module.

    Parameters
    ----------
    time_s : (n,) [s]
        Rising; the first is the release.
    coefficients : (3,)
        alpha [1/s^2], beta [1/s], gamma [-].
    theta_rad : [rad]
        Angle at the release.
    speed_radps : [rad/s]
        Speed at the release.

    Returns
    -------
    Array
        (n,) [rad]; `RUN_AWAY` from where the motion diverges.
    """
    alpha, beta, gamma = map(float, coefficients)

    def motion(_: float, state: Array) -> tuple[float, float]:
        theta, speed = float(state[0]), float(state[1])
        return speed, alpha * math.sin(theta) - beta * speed - gamma * speed * abs(speed)

    def runs_away(_: float, state: Array) -> float:
        return RUN_AWAY - abs(float(state[0])) - 0.1 * abs(float(state[1]))

    runs_away.terminal = True  # type: ignore[attr-defined]  # solve_ivp reads it from the function
    start, span = (theta_rad, speed_radps), (float(time_s[0]), float(time_s[-1]))
    solved = solve_ivp(motion, span, start, "LSODA", t_eval=time_s, events=runs_away, rtol=1e-8, atol=1e-10)
    angle = np.asarray(solved.y[0])
    # A diverged simulation stays at its limit, so a search gets back by the misfit.
    return np.concatenate((angle, np.full(time_s.size - angle.size, RUN_AWAY)))


def _output_error(theta: Array, rate_Hz: float, start: Array) -> tuple[Array, Array, Array]:
    """Coefficients, (3,), covariance, (3, 3), and angle [rad], (n,); fits release angle and speed as well."""
    time = np.arange(theta.size) / rate_Hz

    def model(v: Array) -> Array:
        """Angle [rad], (n,)."""
        return simulate(time, v[:3], float(v[3]), float(v[4]))

    first = np.array([*start, theta[0], 0.0])
    names = ("alpha", "beta", "gamma", "release angle", "release speed")
    found = fit_curve(lambda v: model(v) - theta, first, np.maximum(np.abs(first), 1e-2), names)
    return found.values[:3], found.covariance[:3, :3], model(found.values)
