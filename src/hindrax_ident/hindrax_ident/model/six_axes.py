"""The model of all six axes together: what resists the thrust, linear in its parameters.

    M v' + C(M) v + drag(v) + cross terms + restoring = tau,    M symmetric: body and entrained water

The Coriolis and Munk forces C(M) v are those of the same M (Kirchhoff; Fossen 2011 eq. 3.46), with all its off-diagonal
terms. SNAME axes about the center of mass. A `Term` is one parameter: its force on every axis per unit, and its prior.
Terms of the kind `CROSS` are admitted by the record; those of the kind `DOUBT` are not the vehicle's: thrust that was
not measured, and what the law of the drag lacks, with the priors of `assess.influences`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import LEAST_MASS, offset, restoring, rigid_mass
from hindrax_ident.remedies import COAST, DESCRIBE_THRUSTERS, USE_ITS_SPEEDS

OWN, CROSS, DOUBT = "own", "cross", "doubt"
QUADRATIC_SIGMA, LINEAR_SIGMA = 10.0, 0.2
"""Deviations of quadratic and linear drag, in the drag of a plate as large as the vehicle at 1 m/s [-]."""
OFF_DIAGONAL, LIFT, CROSS_FLOW = 0.15, 0.3, 2.0
"""Prior deviations of cross terms: of the root of both masses, and of the drag of a plate [-]."""
ADDED, ADDED_SIGMA = 1.8, 3.0
"""Total mass before a fit and its deviation, in those of the body [-]; `model_parameters.wide_prior` has the same."""
OFFSET_SIGMA = 0.005
"""Deviation of an offset, of the weight (in moments: at the length of the vehicle) [-]."""
INFLOW_LOSS, INFLOW_LOSS_SIGMA, EXPONENT, THRUST_EXPONENT = 0.06, 0.07, 0.1, 0.05
"""Inflow loss as `assess.influences` has it, in a usual pool or in none; deviations of exponents [-]."""
LETTERS, FORCES = "uvwpqr", "XYZKMN"
INFLOW_mps = 0.5


Forces: TypeAlias = dict[int, Array]
"""Forces or moments by axis, (n,) each [N, N m]."""


@dataclass(frozen=True, slots=True)
class State:
    """Where the forces are wanted, (n, 6) each: velocities, accelerations, thrust; roll and pitch (n, 2)."""

    nu: Array
    acceleration: Array
    thrust: Array
    angles_rad: Array


@dataclass(frozen=True, slots=True)
class Term:
    """One parameter. `force` per unit: (n,) on each axis that it acts on. `mass`: its place in M, of a mass."""

    name: str
    kind: str
    mean: float
    sigma: float
    unit: str
    force: Callable[[State], Forces]
    least: float = -math.inf
    mass: tuple[int, int] | None = None
    drag_axis: int = -1
    drag_power: int = 0
    """Of the own drag: its axis, and the power of the speed."""
    remedy: str = ""
    """Of a doubt: what would measure it."""


def symmetric(at: tuple[int, int]) -> Array:
    """Mass matrix with one at a place and its mirror: (6, 6)."""
    out = np.zeros((6, 6))
    out[at] = out[at[::-1]] = 1.0
    return out


def inertial_force(M: Array, nu: Array, acceleration: Array) -> Array:
    """M v' + C(M) v: the inertial force of a body with the momentum M v, in body axes (Kirchhoff).

    Parameters
    ----------
    M : (6, 6) [kg, kg m, kg m^2]
        Total mass, symmetric.
    nu, acceleration : (n, 6) [m/s, rad/s], [m/s^2, rad/s^2]
        Velocities of the body and their derivatives.

    Returns
    -------
    Array
        (n, 6) [N, N m].
    """
    momentum = nu @ M
    turning, linear = nu[:, 3:], momentum[:, :3]
    out = acceleration @ M
    out[:, :3] += np.cross(turning, linear)
    out[:, 3:] += np.cross(turning, momentum[:, 3:]) + np.cross(nu[:, :3], linear)
    return out


def _mass_term(vehicle: Vehicle, i: int, j: int) -> Term:
    own = math.sqrt(rigid_mass(vehicle, i) * rigid_mass(vehicle, j))
    M = symmetric((i, j))

    def force(state: State) -> Forces:
        """Of one kilogram, or what it is where a turn is."""
        return dict(enumerate(inertial_force(M, state.nu, state.acceleration).T))

    name = f"M_{FORCES[i]}{LETTERS[j]}"
    unit = ("kg", "kg m", "kg m^2")[(i >= 3) + (j >= 3)]
    if i == j:
        return Term(name, OWN, ADDED * own, ADDED_SIGMA * own, unit, force, 1.01 * LEAST_MASS * own, (i, j))
    return Term(name, CROSS, 0.0, OFF_DIAGONAL * ADDED * own, unit, force, mass=(i, j))


def _plate(vehicle: Vehicle, *axes: int) -> float:
    """Force or moment of a plate as large as the vehicle, per unit of both velocities: axis, then two velocities."""
    lever = 0.5 * max(vehicle.envelope_m)
    area = vehicle.characteristic_length_m**2
    return 0.5 * vehicle.water.density_kgpm3 * area * lever ** sum(axis >= 3 for axis in axes)


def _unit(axis: int, *of: int) -> str:
    """Unit of a force or moment per product of velocities."""
    meters, turns = sum(one < 3 for one in of), sum(one >= 3 for one in of)
    seconds = f" s^{meters + turns}"
    return ("N m" if axis >= 3 else "N") + seconds + ("" if not meters else f"/m^{meters}" if meters > 1 else "/m")


def _own_terms(vehicle: Vehicle, axis: int) -> list[Term]:
    """Drag of an axis alone; of heave, up and down apart (COB-2023-1394 Table 3)."""
    plate = _plate(vehicle, axis, axis, axis)
    unit_q, unit_l = ("N m s^2", "N m s") if axis >= 3 else ("N s^2/m^2", "N s/m")

    def term(suffix: str, power: int, side: int) -> Term:
        """Drag with a power of the speed, in one direction or in both."""

        def force(s: State) -> Forces:
            """Against the motion."""
            v = s.nu[:, axis]
            return {axis: np.abs(v) ** (power - 1) * v * (v * side >= 0.0)}

        quadratic, linear = (plate, QUADRATIC_SIGMA * plate, unit_q), (0.0, LINEAR_SIGMA * plate, unit_l)
        mean, sigma, unit = quadratic if power == 2 else linear
        name = f"{AXES[axis]}{suffix} {'k_q' if power == 2 else 'k_l'}"
        return Term(name, OWN, mean, sigma, unit, force, 0.0, None, axis, power)

    ways = (("_down", 1), ("_up", -1)) if axis == 2 else (("", 0),)
    return [term(suffix, power, side) for suffix, side in ways for power in (2, 1)]


def _standing_terms(vehicle: Vehicle, axis: int) -> list[Term]:
    """Forces at rest: net buoyancy, which tilts into surge and sway, offsets, and the restoring moments."""
    unit = "N m" if axis >= 3 else "N"
    at_rest, weight = offset(vehicle, axis), vehicle.buoyancy_N

    def buoyancy(s: State) -> Forces:
        """Upward in level axes; Fossen 2011 eq. 4.6."""
        roll, pitch = s.angles_rad.T
        return {0: -np.sin(pitch), 1: np.cos(pitch) * np.sin(roll), 2: np.cos(pitch) * np.cos(roll)}

    if axis == 2:
        return [Term("net buoyancy", OWN, at_rest, 0.05 * weight, unit, buoyancy)]
    sigma = OFFSET_SIGMA * (1.0 if axis < 3 else vehicle.characteristic_length_m) * weight
    out = [Term(f"{AXES[axis]} b", OWN, at_rest, sigma, unit, lambda s: {axis: np.ones(len(s.nu))})]
    if axis in (3, 4):
        own = restoring(vehicle)

        def righting(s: State) -> Forces:
            """Fossen 2011 eq. 4.6, of one newton meter."""
            roll, pitch = s.angles_rad.T
            return {3: np.cos(pitch) * np.sin(roll)} if axis == 3 else {4: np.sin(pitch)}

        sigma = abs(own) + 0.02 * weight * vehicle.characteristic_length_m
        out.append(Term(f"{AXES[axis]} k_r", OWN, own, sigma, "N m", righting))
    return out


def _product(vehicle: Vehicle, axis: int, a: int, b: int) -> Term:
    """A force by two velocities: lift, and moments of a hull that is not alike above and below."""

    def force(s: State) -> Forces:
        """Velocity times velocity; of one alone, with its sign where the axis is turned with it."""
        other = np.abs(s.nu[:, b]) if a == b and (axis, a) not in _EVEN else s.nu[:, b]
        return {axis: s.nu[:, a] * other}

    shown = LETTERS[a] + (LETTERS[b] if a != b or (axis, a) in _EVEN else f"|{LETTERS[a]}|")
    return Term(f"{FORCES[axis]}_{shown}", CROSS, 0.0, LIFT * _plate(vehicle, axis, a, b), _unit(axis, a, b), force)


_EVEN = ((0, 1), (0, 2), (2, 0), (2, 1))
"""Forces that do not turn with the velocity across: those of a hull with port alike starboard."""
_PRODUCTS = (
    (1, 0, 1), (3, 0, 1), (5, 0, 1), (2, 0, 2), (4, 0, 2), (3, 1, 2), (1, 1, 2), (0, 0, 2), (5, 1, 2),
    (1, 0, 5), (5, 0, 5), (2, 0, 4), (4, 0, 4), (3, 0, 3), (3, 2, 3), (4, 2, 4), (5, 2, 5), (0, 0, 4), (1, 0, 3),
    (3, 1, 1), (5, 1, 1), (4, 0, 0), (4, 2, 2), (0, 4, 4), (1, 3, 3), (1, 5, 5), (5, 3, 3), (3, 5, 5),
    (0, 1, 1), (0, 2, 2), (2, 0, 0), (2, 1, 1), (0, 2, 4), (0, 1, 5), (1, 2, 3), (2, 1, 3),
)  # fmt: skip
"""Axis and two velocities: those that a hull with port alike starboard may have (Fossen 2011 section 6.4)."""


def _cross_flow(vehicle: Vehicle, axis: int, across: int) -> Term:
    """Drag along one axis of a body that moves across: the flow is as fast as both make it."""

    def force(s: State) -> Forces:
        """Against the motion along the axis."""
        return {axis: np.abs(s.nu[:, across]) * s.nu[:, axis]}

    sigma, unit = CROSS_FLOW * _plate(vehicle, axis, axis, across), "N s^2/m^2"
    return Term(f"{FORCES[axis]}_{LETTERS[axis]}|{LETTERS[across]}|", CROSS, 0.0, sigma, unit, force, least=0.0)


def whole_speed(vehicle: Vehicle, axis: int) -> Term:
    """Drag that grows with the whole speed (or turn), beyond that of the own axis: cross flow.

    Parameters
    ----------
    vehicle
        Of which its prior is made.
    axis
        Index, 0 to 5.

    Returns
    -------
    Term
        Along the axis.
    """
    kind = slice(0, 3) if axis < 3 else slice(3, 6)

    def force(s: State) -> Forces:
        """Zero where only this axis moves."""
        v = s.nu[:, axis]
        return {axis: (np.sqrt(np.sum(s.nu[:, kind] ** 2, axis=1)) - np.abs(v)) * v}

    sigma = CROSS_FLOW * _plate(vehicle, axis, axis, axis)
    unit = "N m s^2" if axis >= 3 else "N s^2/m^2"
    return Term(f"{AXES[axis]} drag with the whole speed", CROSS, 0.0, sigma, unit, force)


def _turn_by_speed(vehicle: Vehicle, axis: int) -> Term:
    """Drag of a turn that grows with the speed of the vehicle."""

    def force(s: State) -> Forces:
        """Speed of the center times turn."""
        return {axis: np.sqrt(np.sum(s.nu[:, :3] ** 2, axis=1)) * s.nu[:, axis]}

    return Term(
        f"{AXES[axis]} drag with speed", CROSS, 0.0, LIFT * _plate(vehicle, axis, axis, 0), "N s^2", force, least=0.0
    )


@dataclass(frozen=True, slots=True)
class Scales:
    """Largest thrust and speed of each axis in the record, (6,) each: what doubts are shares of."""

    pull: Array
    speed: Array


def _doubts(vehicle: Vehicle, axis: int, scales: Scales, gain_sigma: float, drag: float) -> list[Term]:
    """Gain of the thrust, its loss to inflow, its exponent, and the exponent of the drag; `drag`: at the top speed."""
    pull, top = max(1e-9, scales.pull[axis]), max(1e-9, scales.speed[axis])
    lever = 1.0 if axis < 3 else 0.5 * vehicle.characteristic_length_m

    def of_gain(s: State) -> Forces:
        """Less resistance is more thrust."""
        return {axis: -s.thrust[:, axis]}

    def inflow(s: State) -> Forces:
        """T = T_0 - T_nu |n| u, Fossen 2011 eq. 9.8: a unit loses the largest thrust at 0.5 m/s."""
        return {axis: np.sqrt(pull * np.abs(s.thrust[:, axis])) * s.nu[:, axis] * lever / INFLOW_mps}

    def exponent(s: State) -> Forces:
        """Change of the drag per unit of its exponent."""
        x = np.abs(s.nu[:, axis]) / top
        return {axis: drag * np.sign(s.nu[:, axis]) * x * x * np.log(np.maximum(x, 1e-9))}

    def load(s: State) -> Forces:
        """Change of the thrust per unit of its exponent."""
        x = np.abs(s.thrust[:, axis]) / pull
        return {axis: -pull * np.sign(s.thrust[:, axis]) * x * np.log(np.maximum(x, 1e-9))}

    name = AXES[axis]
    return [
        Term(f"{name}: gain of the wrench", DOUBT, 0.0, max(1e-6, gain_sigma), "-", of_gain, remedy=DESCRIBE_THRUSTERS),
        Term(f"{name}: inflow loss", DOUBT, INFLOW_LOSS, INFLOW_LOSS_SIGMA, "-", inflow, 0.0, remedy=COAST),
        Term(f"{name}: exponent of the drag", DOUBT, 0.0, EXPONENT, "-", exponent, remedy=USE_ITS_SPEEDS),
        Term(f"{name}: exponent of the thrust", DOUBT, 0.0, THRUST_EXPONENT, "-", load, remedy=DESCRIBE_THRUSTERS),
    ]


def cross_terms(vehicle: Vehicle, axis: int) -> list[Term]:
    """Terms by which motion along other axes acts on one, that of its whole speed left out: an axis has its own for it.

    Products of inertia of two other axes act only as the body turns, and of those a hull with port alike starboard has
    but some.

    Parameters
    ----------
    vehicle
        Of which priors are made.
    axis
        Index, 0 to 5.

    Returns
    -------
    list[Term]
        Off-diagonal masses, lift and the like.
    """
    pairs = [(i, j) for j in range(6) for i in range(j) if axis in (i, j) or (j - i) % 2 == 0]
    turning = [_turn_by_speed(vehicle, axis)] if axis >= 3 else []
    products = [_product(vehicle, *one) for one in _PRODUCTS if one[0] == axis]
    return [*(_mass_term(vehicle, *one) for one in pairs), *turning, *products]


def terms_of(vehicle: Vehicle, axes: tuple[int, ...], scales: Scales, gain_sigma: float, drags: Array) -> list[Term]:
    """Terms of the axes that were measured: their own, doubts, and those that the record may admit.

    Parameters
    ----------
    vehicle
        Of which priors are made.
    axes
        Measured and moved.
    scales
        Largest speeds and thrusts of the record.
    gain_sigma : [-]
        Standard deviation of the gain of the wrench.
    drags : (6,) [N, N m]
        Drag at the largest speeds, of a first fit: for the size of doubts.

    Returns
    -------
    list[Term]
        Own terms first; names are unique.
    """
    out = [term for axis in axes for term in (_mass_term(vehicle, axis, axis), *_own_terms(vehicle, axis))]
    out += [term for axis in axes for term in _standing_terms(vehicle, axis)]
    out += [term for axis in axes for term in _doubts(vehicle, axis, scales, gain_sigma, float(drags[axis]))]
    out += [_mass_term(vehicle, i, j) for i in axes for j in axes if i < j]
    out += [whole_speed(vehicle, axis) for axis in axes]
    out += [_turn_by_speed(vehicle, axis) for axis in axes if axis >= 3]
    out += [_cross_flow(vehicle, i, j) for i in axes for j in axes if i != j and max(i, j) < 3]
    return out + [_product(vehicle, *one) for one in _PRODUCTS if set(one) <= set(axes)]
