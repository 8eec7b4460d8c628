"""What the calibration of the thrusters adds to the uncertainty of a result.

A thrust that is wrong in the same way throughout a run does not show in any residual, so the statistical band cannot
know of it: a gain error of 2 % is a 2 % error of every coefficient. Here the covariance of the thruster curves (a gain
per kind of thruster; the coefficients of each cubic, where the vehicle file gives their standard deviations) and of
the lag is carried through the same linearization that gave the statistical covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hindrax_core.curves import Branch, Curve
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.delay import per_step
from hindrax_ident.lag import LaggedThrust
from hindrax_ident.models import HORIZONTAL, effect
from hindrax_ident.record import Record
from hindrax_ident.refine import Fit
from hindrax_ident.score import score
from hindrax_ident.tuning import Tuning

TABLE = 401


@dataclass(frozen=True, slots=True)
class Mode:
    """One way in which the thrust may be wrong, with k unknowns of the given covariance (k, k).

    `error` maps thrust on the axis to the error per unit of each unknown: (n,) to (n, k).
    """

    name: str
    error: Callable[[Array], Array]
    covariance: Array


def modes(vehicle: Vehicle, axis: int) -> list[Mode]:
    """Every way in which the vehicle file says that the thrust on an axis may be wrong."""
    out: list[Mode] = []
    allocation = _shares(vehicle, axis)
    for name, curve in vehicle.curves.items():
        own = {index: share for index, share in allocation.items() if vehicle.thrusters[index].curve == name}
        part = sum(per_newton * share for per_newton, share in own.values())
        if part == 0.0:
            continue
        out.append(_gain_mode(name, curve, part))
        out += _branch_modes(name, curve, list(own.values()))
    return out


def _gain_mode(name: str, curve: Curve, part: float) -> Mode:
    return Mode(f"gain of curve {name}", lambda force: (part * force)[:, None], np.array([[curve.gain_sigma**2]]))


def _shares(vehicle: Vehicle, axis: int) -> dict[int, tuple[float, float]]:
    """Per thruster: wrench on the axis per newton, and newtons per newton on the axis (least effort)."""
    if not vehicle.thrusters:
        return {}
    B = np.array([effect(vehicle, thruster) for thruster in vehicle.thrusters]).T
    share = np.linalg.pinv(B)[:, axis]
    return {i: (float(B[axis, i]), float(share[i])) for i in range(B.shape[1])}


def _branch_modes(name: str, curve: Curve, allocation: list[tuple[float, float]]) -> list[Mode]:
    """One mode of four unknowns per direction whose coefficients have standard deviations."""
    pairs = [(curve.negative, -1.0, "negative")]
    if curve.positive is not None:
        pairs.append((curve.positive, 1.0, "positive"))
    out = []
    for branch, sign, word in pairs:
        if branch.sigma is not None:
            mirrored = curve.positive is None
            error = _branch_error(branch, sign, allocation, mirrored=mirrored)
            out.append(Mode(f"{word} branch of curve {name}", error, branch_covariance(branch)))
    return out


def branch_covariance(branch: Branch) -> Array:
    """Covariance of c1 to c4: (4, 4), from their standard deviations.

    Publications print no correlations, and without them the cubic would be worth nothing (COB-2023-1394: 137.8 N on c1
    alone). They are taken to be those of a least-squares fit to a sweep of evenly spaced pulses.
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
        total = np.zeros((len(force), 4))
        for per_newton, share in allocation:
            own = share * force
            for side in (sign, -sign) if mirrored else (sign,):
                active = own * side > 0.0
                pulse = np.interp(sign * np.abs(own), forces[order], pulses[order])
                total += (per_newton * side * sign * active)[:, None] * _powers(pulse)
        return total

    return error


def with_calibration(vehicle: Vehicle, record: Record, fit: Fit) -> Array:
    """Covariance of the parameters with what the calibration adds: (p, p)."""
    parts = modes(vehicle, fit.model.axis)
    blocks = [np.asarray(mode.covariance) for mode in parts]
    columns = [_impulses(record, fit, mode.error(record.thrust.y)) for mode in parts]
    if not columns:
        return fit.covariance
    shifts = score(fit, np.concatenate(columns, axis=1)).shifts
    return array(fit.covariance + shifts @ _block_diagonal(blocks) @ shifts.T)


def tilt_sigma_rad(vehicle: Vehicle, tuning: Tuning) -> float:
    """How well roll and pitch are known from the accelerometer; TDK DS-000189 table 2.

    As it is delivered, its typical offset of 25 mg, taken for two standard deviations. Once `hindrax imu calibrate` has
    written the vehicle file, 3 mg: what a few degrees of warming bring back.
    """
    known = any(key.startswith("accel") for mount in vehicle.sensors.values() for key in mount.calibration)
    return tuning.tilt_sigma_rad if known else tuning.raw_tilt_sigma_rad


def by_tilt(vehicle: Vehicle, fit: Fit, sigma_rad: float) -> Array:
    """Covariance that a constant error of the measured roll or pitch adds: (p, p).

    Each run has its own by the offset of the accelerometer (see `tilt_sigma_rad`), and all runs of a vehicle share that
    of the mount.

    In roll and pitch it is a moment k_r cos(angle) per radian. Along surge and sway a vehicle that is held level by a
    tilted sensor feels its net buoyancy times the tilt, and nobody can tell that from b.
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


def by_masses(record: Record, fit: Fit) -> Array:
    """Covariance that masses of other axes add where nobody knows them: (p, p); see `coriolis`."""
    if not record.doubts:
        return np.zeros_like(fit.covariance)
    grid = fit.problem.grid
    totals = [LaggedThrust(error.t, error.y, 0.0).impulse(grid.times_s) for error in record.doubts]
    shifts = score(fit, per_step(np.stack(totals, axis=1), grid)).shifts
    return array(shifts @ shifts.T)


def with_velocity_gain(covariance: Array, fit: Fit, sigma: float) -> Array:
    """Covariance with what an unknown gain of the measured velocity adds: k_q goes with its inverse square."""
    model = fit.model
    power = np.zeros(len(fit.theta))
    power[: model.drags] = [-2.0, -1.0] * (model.drags // 2)
    power[-1] = -1.0
    shift = power * fit.theta * sigma
    return array(covariance + np.outer(shift, shift))


def _impulses(record: Record, fit: Fit, errors: Array) -> Array:
    """Impulse over each step of the fit's grid for each column of thrust errors: (n, k)."""
    times = fit.problem.grid.times_s - record.late_s
    totals = np.stack([LaggedThrust(record.thrust.t, error, record.lag_s).impulse(times) for error in errors.T], axis=1)
    return per_step(totals, fit.problem.grid)


def _block_diagonal(blocks: list[Array]) -> Array:
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

    The correlation that a common gain error makes carries the knowledge over to the drag and the mass.
    """
    gain = covariance[:, index] / (covariance[index, index] + sigma_N**2)
    return theta + gain * (buoyancy_N - theta[index]), covariance - np.outer(gain, covariance[index])
