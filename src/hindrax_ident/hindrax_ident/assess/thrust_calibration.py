"""Errors of the thruster curves: what they do to the thrust on an axis, and their covariance from the vehicle file.

A gain per kind of thruster; the coefficients of each cubic, or the zero of each direction of a table, where the vehicle
file gives their standard deviations.

Symbols. tau thrust on the axis, (n,) over time; thruster j has b_j, wrench on the axis per newton, and w_j, newtons per
unit of tau by least squares (`thrust_shares`). A record holds tau, not the single forces: they are taken as w_j tau, as
the allocation would share it, so sum b_j w_j = 1 where the thrusters serve the axis. A force error e(f) of one curve is
then the error sum b_j e(w_j tau) of the thrust, over the thrusters that have the curve.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hindrax_core.thrust.curves import Branch, Curve, running
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import unit_wrench

TABLE = 401
DEAD_BAND_us = 5.0
"""Standard deviation of the pulse at which a thruster starts: a fifth of the dead band of its speed controller, our
estimate (`docs/reference/worlds.md`)."""
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(31)
WIDER_us, PROBABLE = DEAD_BAND_us * _NODES, _WEIGHTS / _WEIGHTS.sum()
"""Dead bands that may be, (d,), and their probabilities: what is lost is no linear function of them."""
FORCES = 100
UNKNOWN_POWER, POWER_WITHIN = 1.7, 0.05
"""Power of the voltage with which thrust grows where no curve tells it, as of a T200 at low thrust (Blue Robotics,
performance charts, 2019); and within which share of the voltage it is taken from curves [-]."""
ROUNDING = 1e-9
"""Of the largest force: where thrusters cancel on an axis, a sum is left whose sign depends on the computer."""


@dataclass(frozen=True, slots=True)
class ThrustErrorMode:
    """One kind of thrust error, with k unknowns of the given covariance (k, k).

    `error` maps thrust on the axis to its error per unit of each unknown: (n,) to (n, k).
    """

    error: Callable[[Array], Array]
    covariance: Array


def modes(vehicle: Vehicle, axis: int) -> list[ThrustErrorMode]:
    """Thrust error modes of an axis, from the vehicle file."""
    out: list[ThrustErrorMode] = []
    allocation = thrust_shares(vehicle, axis) if vehicle.thrusters else {}
    for name, curve in vehicle.curves.items():
        own = [pair for index, pair in allocation.items() if vehicle.thrusters[index].curve == name]
        part = sum(per_newton * share for per_newton, share in own)
        if part != 0.0:
            out += [_gain_mode(curve, part), *_branch_modes(curve, own)]
    return out


def _gain_mode(curve: Curve, part: float) -> ThrustErrorMode:
    """All forces of a kind wrong by one factor: e(f) = f, and `part` is the sum of b_j w_j over this kind."""
    return ThrustErrorMode(lambda force: (part * force)[:, None], np.array([[curve.gain_sigma**2]]))


def thrust_shares(vehicle: Vehicle, axis: int) -> dict[int, tuple[float, float]]:
    """Per thruster: wrench on the axis per newton, and newtons per unit of wrench on the axis.

    Parameters
    ----------
    vehicle
        One without thrusters counts as one that pushes at the center, or turns at half its length.
    axis
        0 to 5.

    Returns
    -------
    dict[int, tuple[float, float]]
        By the index of the thruster: its element of B [-, m], and of the pseudo-inverse of B [-, 1/m], which is the
        allocation of least squares.
    """
    if not vehicle.thrusters:
        lever = 1.0 if axis < 3 else 0.5 * vehicle.characteristic_length_m
        return {0: (lever, 1.0 / lever)}
    B = np.array([unit_wrench(vehicle, thruster) for thruster in vehicle.thrusters]).T
    share = np.linalg.pinv(B)[:, axis]
    return {i: (float(B[axis, i]), float(share[i])) for i in range(B.shape[1])}


def supply_power(vehicle: Vehicle) -> float:
    """Power of the supply voltage with which the thrust of a vehicle grows, about the nominal one [-].

    Parameters
    ----------
    vehicle
        By the curves of its thrusters at half of the pulse ahead; one without any counts as `UNKNOWN_POWER`.

    Returns
    -------
    float
        Mean of the thrusters; 0 where the curves do not depend on a voltage.
    """
    powers = {name: _power(curve, vehicle.supply_V) for name, curve in vehicle.curves.items()}
    return float(np.mean([powers[one.curve] for one in vehicle.thrusters])) if vehicle.thrusters else UNKNOWN_POWER


def _power(curve: Curve, supply_V: float) -> float:
    ahead = running(curve, supply_V).positive
    half_us = 0.5 * (ahead.from_us + ahead.to_us)
    low, high = (running(curve, supply_V * (1.0 + side * POWER_WITHIN)).force_N(half_us) for side in (-1.0, 1.0))
    return math.log(high / low) / math.log((1.0 + POWER_WITHIN) / (1.0 - POWER_WITHIN))


def lost_to_dead_bands(vehicle: Vehicle, forces_N: Array) -> Array:
    """What each thruster gives less at the pulse for a force, if its dead band is wider and its curve begins later.

    Near the dead band that is much of the force, and all of it where the curve begins with a leap.

    Parameters
    ----------
    vehicle
        Thrusters and curves.
    forces_N : (k,) [N]
        One of each thruster, along its direction.

    Returns
    -------
    Array
        (d, k) [N], with the sign of the force, for each of `WIDER_us`.
    """
    pairs = zip(vehicle.thrusters, forces_N.tolist(), strict=True)
    return np.stack([_lost(vehicle.curves[one.curve], force_N) for one, force_N in pairs], axis=1)


def usual_losses(vehicle: Vehicle) -> list[Callable[[Array], Array]]:
    """Loss to a dead band of one deviation: the root of the mean square over all draws.

    The loss is no linear function of the draw.

    Parameters
    ----------
    vehicle
        Thrusters and curves.

    Returns
    -------
    list
        For each thruster a function of its forces (n,) [N] to what they lose, (n,) [N], against the force.
    """
    return [_usual_loss(vehicle.curves[one.curve]) for one in vehicle.thrusters]


@functools.lru_cache(maxsize=16)
def _usual_loss(curve: Curve) -> Callable[[Array], Array]:
    most_N = max(abs(one) for one in running(curve).range_N)
    # Closest where a thruster starts.
    sizes_N = most_N * np.linspace(0.0, 1.0, FORCES) ** 2
    lost = {sign: np.array([_lost(curve, force) for force in (sign * sizes_N).tolist()]) for sign in (-1.0, 1.0)}
    table = {sign: np.sqrt(one**2 @ PROBABLE) for sign, one in lost.items()}

    def loss(force: Array) -> Array:
        """Of forces (n,): (n,) [N]."""
        size = np.abs(force)
        back, ahead = (np.interp(size, sizes_N, table[sign]) for sign in (-1.0, 1.0))
        return array(-np.sign(force) * np.where(force < 0.0, back, ahead))

    return loss


def _lost(curve: Curve, force_N: float) -> Array:
    """Of one thruster: (d,) [N]. One that turns the other way round has the pulses reflected, and loses the same."""
    runs = running(curve)
    branch, sign = (runs.positive, 1.0) if force_N > 0.0 else (runs.negative, -1.0)
    pulse_us = branch.inverse()(force_N)
    now_N = branch.force_N(pulse_us)
    if force_N == 0.0 or now_N == 0.0:
        return np.zeros(len(WIDER_us))
    # A mean below the least force of one that runs is of one that runs for a part of the time.
    left = [runs.force_N(pulse_us - sign * wider_us) / now_N for wider_us in WIDER_us.tolist()]
    return force_N * (1.0 - array(np.array(left)))


def _branch_modes(curve: Curve, allocation: list[tuple[float, float]]) -> list[ThrustErrorMode]:
    """One mode per direction: of four unknowns where the coefficients have standard deviations, of one in a table."""
    if curve.table is not None:
        variance = np.array([[curve.table.sigma_N**2]])
        return [ThrustErrorMode(_offset_error(sign, allocation), variance) for sign in (-1.0, 1.0) if variance > 0.0]
    mirrored = curve.positive is None
    return [
        ThrustErrorMode(_branch_error(branch, sign, allocation, mirrored=mirrored), branch_covariance(branch))
        for branch, sign in ((curve.negative, -1.0), (curve.positive, 1.0))
        if branch is not None and branch.sigma is not None
    ]


def _offset_error(sign: float, allocation: list[tuple[float, float]]) -> Callable[[Array], Array]:
    """All forces of one direction of a table are wrong by the same: a load cell that was tared wrongly."""

    def error(force: Array) -> Array:
        """Thrust error per newton of the table: (n, 1)."""
        return np.asarray(sum(per_newton * _acts(share * force * sign) for per_newton, share in allocation))[:, None]

    return error


def _acts(force: Array) -> Array:
    """Where a force acts in the positive direction: (n,)."""
    return np.asarray(force > ROUNDING * np.abs(force).max(initial=0.0))


def branch_covariance(branch: Branch) -> Array:
    """Covariance of the coefficients c1 to c4 of a thrust curve from their standard deviations.

    Publications print no correlations, and without them the cubic would be useless (COB-2023-1394: 137.8 N on c1
    alone). Assumed are those of a least-squares fit to a sweep of evenly spaced pulses: (X'X)^-1 with the powers of the
    pulse in X, computed about the middle of the sweep, where it is well conditioned, and carried over by T.

    Parameters
    ----------
    branch
        With `sigma` of its four coefficients, and the range of its pulses [us].

    Returns
    -------
    Array
        (4, 4) [N^2, N^2/us, ...].
    """
    pulses = np.linspace(branch.from_us, branch.to_us, TABLE)
    center, half = pulses.mean(), 0.5 * (branch.to_us - branch.from_us)
    local = np.linalg.inv(_powers((pulses - center) / half).T @ _powers((pulses - center) / half))
    T = powers_from_scaled(float(center), half)
    C = T @ local @ T.T
    sigma = np.asarray(branch.sigma, float)
    spread = np.sqrt(np.diag(C))
    return np.asarray(C / np.outer(spread, spread) * np.outer(sigma, sigma))


def _powers(x: Array) -> Array:
    """Powers 0 to 3: (n, 4)."""
    return np.stack([np.ones_like(x), x, x**2, x**3], axis=1)


def powers_from_scaled(center: float, half: float) -> Array:
    """Coefficients of powers of P from those of powers of (P - center) / half: (4, 4)."""
    T = np.zeros((4, 4))
    for power in range(4):
        polynomial = np.polynomial.Polynomial([-center / half, 1.0 / half]) ** power
        T[: power + 1, power] = polynomial.coef
    return T


def _branch_error(
    branch: Branch, sign: float, allocation: list[tuple[float, float]], *, mirrored: bool
) -> Callable[[Array], Array]:
    """Error of the thrust by those of c1 to c4: e(f) = (1, P, P^2, P^3) at the pulse P that gives f.

    The pulse is read from a table of the curve, backward. Where a curve is given for one direction and mirrored for
    the other, the same four errors act in both, with opposite sign.
    """
    pulses = np.linspace(branch.from_us, branch.to_us, TABLE)
    forces = np.array([branch.force_N(float(pulse)) for pulse in pulses])
    order = np.argsort(forces)

    def error(force: Array) -> Array:
        """Thrust error per unit of each coefficient: (n, 4)."""
        total = np.zeros((len(force), 4))
        for per_newton, share in allocation:
            own = share * force
            for side in (sign, -sign) if mirrored else (sign,):
                active = _acts(own * side)
                pulse = np.interp(sign * np.abs(own), forces[order], pulses[order])
                total += (per_newton * side * sign * active)[:, None] * _powers(pulse)
        return total

    return error
