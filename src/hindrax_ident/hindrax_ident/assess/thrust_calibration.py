"""Uncertainty of results due to thruster calibration.

A constant error of the thrust throughout a run does not appear in the residuals, so the statistical band does not
cover it: a gain error of 2 % is a 2 % error of every coefficient. Here the covariance of the thruster curves (a gain
per kind of thruster; the coefficients of each cubic, where the vehicle file gives their standard deviations) and of
the lag is propagated through the linearization behind the statistical covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hindrax_core.curves.curve_branches import Branch, Curve
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import per_step
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.score_test import score
from hindrax_ident.model.motion_model import HORIZONTAL, unit_wrench
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import Record
from hindrax_ident.tuning import Tuning

TABLE = 401


@dataclass(frozen=True, slots=True)
class ThrustErrorMode:
    """One kind of thrust error, with k unknowns of the given covariance (k, k).

    `error` maps thrust on the axis to its error per unit of each unknown: (n,) to (n, k).
    """

    name: str
    error: Callable[[Array], Array]
    covariance: Array


def modes(vehicle: Vehicle, axis: int) -> list[ThrustErrorMode]:
    """Thrust error modes of an axis, from the vehicle file."""
    out: list[ThrustErrorMode] = []
    allocation = _shares(vehicle, axis)
    for name, curve in vehicle.curves.items():
        own = {index: share for index, share in allocation.items() if vehicle.thrusters[index].curve == name}
        part = sum(per_newton * share for per_newton, share in own.values())
        if part == 0.0:
            continue
        out.append(_gain_mode(name, curve, part))
        out += _branch_modes(name, curve, list(own.values()))
    return out


def _gain_mode(name: str, curve: Curve, part: float) -> ThrustErrorMode:
    return ThrustErrorMode(
        f"gain of curve {name}", lambda force: (part * force)[:, None], np.array([[curve.gain_sigma**2]])
    )


def _shares(vehicle: Vehicle, axis: int) -> dict[int, tuple[float, float]]:
    """Per thruster: wrench on the axis per newton, and newtons per newton on the axis (least squares)."""
    if not vehicle.thrusters:
        return {}
    B = np.array([unit_wrench(vehicle, thruster) for thruster in vehicle.thrusters]).T
    share = np.linalg.pinv(B)[:, axis]
    return {i: (float(B[axis, i]), float(share[i])) for i in range(B.shape[1])}


def _branch_modes(name: str, curve: Curve, allocation: list[tuple[float, float]]) -> list[ThrustErrorMode]:
    """One mode of four unknowns per direction whose coefficients have standard deviations."""
    pairs = [(curve.negative, -1.0, "negative")]
    if curve.positive is not None:
        pairs.append((curve.positive, 1.0, "positive"))
    out = []
    for branch, sign, word in pairs:
        if branch.sigma is not None:
            mirrored = curve.positive is None
            error = _branch_error(branch, sign, allocation, mirrored=mirrored)
            out.append(ThrustErrorMode(f"{word} branch of curve {name}", error, branch_covariance(branch)))
    return out


def branch_covariance(branch: Branch) -> Array:
    """Covariance of c1 to c4: (4, 4) [N, N/us, ...], from their standard deviations.

    Publications print no correlations, and without them the cubic would be useless (COB-2023-1394: 137.8 N on c1
    alone). Assumed are those of a least-squares fit to a sweep of evenly spaced pulses.
    """
    pulses = np.linspace(branch.from_us, branch.to_us, TABLE)
    center, half = pulses.mean(), 0.5 * (branch.to_us - branch.from_us)
    local = np.linalg.inv(_powers((pulses - center) / half).T @ _powers((pulses - center) / half))
    T = _shift(float(center), half)
    C = T @ local @ T.T
    sigma = np.asarray(branch.sigma, float)
    spread = np.sqrt(np.diag(C))
    return np.asarray(C / np.outer(spread, spread) * np.outer(sigma, sigma))


def _powers(x: Array) -> Array:
    """Powers 0 to 3: (n, 4)."""
    return np.stack([np.ones_like(x), x, x**2, x**3], axis=1)


def _shift(center: float, half: float) -> Array:
    """Coefficients of powers of P from those of powers of (P - center) / half: (4, 4)."""
    T = np.zeros((4, 4))
    for power in range(4):
        polynomial = np.polynomial.Polynomial([-center / half, 1.0 / half]) ** power
        T[: power + 1, power] = polynomial.coef
    return T


def _branch_error(
    branch: Branch, sign: float, allocation: list[tuple[float, float]], *, mirrored: bool
) -> Callable[[Array], Array]:
    pulses = np.linspace(branch.from_us, branch.to_us, TABLE)
    forces = np.array([branch.force_N(float(pulse)) for pulse in pulses])
    order = np.argsort(forces)

    def error(force: Array) -> Array:
        """Thrust error per unit of each coefficient: (n, 4)."""
        total = np.zeros((len(force), 4))
        for per_newton, share in allocation:
            own = share * force
            for side in (sign, -sign) if mirrored else (sign,):
                active = own * side > 0.0
                pulse = np.interp(sign * np.abs(own), forces[order], pulses[order])
                total += (per_newton * side * sign * active)[:, None] * _powers(pulse)
        return total

    return error


def with_calibration(vehicle: Vehicle, record: Record, fit: OutputErrorFit) -> Array:
    """Covariance of the parameters including thruster calibration: (p, p)."""
    parts = modes(vehicle, fit.model.axis)
    blocks = [np.asarray(mode.covariance) for mode in parts]
    columns = [_impulses(record, fit, mode.error(record.thrust.y)) for mode in parts]
    if not columns:
        return fit.covariance
    shifts = score(fit, np.concatenate(columns, axis=1)).shifts
    return array(fit.covariance + shifts @ _block_diagonal(blocks) @ shifts.T)


def tilt_sigma_rad(vehicle: Vehicle, tuning: Tuning) -> float:
    """Standard deviation of roll and pitch from the accelerometer; TDK DS-000189 table 2.

    Uncalibrated: its typical offset of 25 mg as two standard deviations. After `hindrax imu calibrate`: 3 mg, the
    drift over a few degrees of warming.
    """
    known = any(key.startswith("accel") for mount in vehicle.sensors.values() for key in mount.calibration)
    return tuning.tilt_sigma_rad if known else tuning.raw_tilt_sigma_rad


def tilt_covariance(vehicle: Vehicle, fit: OutputErrorFit, sigma_rad: float) -> Array:
    """Covariance due to a constant error of the measured roll or pitch: (p, p).

    Each run has its own from the offset of the accelerometer (see `tilt_sigma_rad`); all runs of a vehicle share that
    of the mount.

    In roll and pitch it is a moment k_r cos(angle) per radian. Along surge and sway, a vehicle held level by a tilted
    sensor has its net buoyancy times the tilt as a force, which cannot be separated from b.
    """
    if fit.model.axis in HORIZONTAL:
        added = np.zeros_like(fit.covariance)
        at = fit.model.names.index("b")
        added[at, at] = (vehicle.net_buoyancy_N * sigma_rad) ** 2
        return added
    if not fit.model.restores:
        return np.zeros_like(fit.covariance)
    moment = fit.theta[-2] * np.cos(fit.linear.path.s) * fit.problem.grid.steps_s
    shift = score(fit, moment[:, None]).shifts[:, 0] * sigma_rad
    return array(np.outer(shift, shift))


def coriolis_covariance(record: Record, fit: OutputErrorFit) -> Array:
    """Covariance due to uncertain masses of other axes: (p, p); see `coriolis`."""
    if not record.coriolis_errors:
        return np.zeros_like(fit.covariance)
    grid = fit.problem.grid
    totals = [LaggedThrust(error.t, error.y, 0.0).impulse(grid.times_s) for error in record.coriolis_errors]
    shifts = score(fit, per_step(np.stack(totals, axis=1), grid)).shifts
    return array(shifts @ shifts.T)


def with_velocity_gain(covariance: Array, fit: OutputErrorFit, sigma: float) -> Array:
    """Covariance, (p, p), including an unknown gain of the measured velocity: k_q varies with its inverse square."""
    model = fit.model
    power = np.zeros(len(fit.theta))
    power[: model.drags] = [-2.0, -1.0] * (model.drags // 2)
    power[-1] = -1.0
    shift = power * fit.theta * sigma
    return array(covariance + np.outer(shift, shift))


def _impulses(record: Record, fit: OutputErrorFit, errors: Array) -> Array:
    """Impulse over each step of the fit's grid for each column of thrust errors: (n, k)."""
    times = fit.problem.grid.times_s - record.latency_s
    totals = np.stack([LaggedThrust(record.thrust.t, error, record.lag_s).impulse(times) for error in errors.T], axis=1)
    return per_step(totals, fit.problem.grid)


def _block_diagonal(blocks: list[Array]) -> Array:
    """Block-diagonal matrix of square blocks: (n, n)."""
    size = sum(len(block) for block in blocks)
    out, at = np.zeros((size, size)), 0
    for block in blocks:
        out[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return out


def with_known_buoyancy(
    theta: Array, covariance: Array, index: int, buoyancy_N: float, sigma_N: float
) -> tuple[Array, Array]:
    """Parameters once b is known from weighing: (p,), (p, p).

    Through the correlation due to a common gain error, drag and mass improve too.
    """
    gain = covariance[:, index] / (covariance[index, index] + sigma_N**2)
    return theta + gain * (buoyancy_N - theta[index]), covariance - np.outer(gain, covariance[index])
