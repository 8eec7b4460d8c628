"""Implausible results: wrong units and axes give numbers too, often with narrow intervals.

Asked of the records of other stacks, after the run and while they fly.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hindrax_core.text.digits import measured
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import NO_OBJECTION, Code, Objection, objection
from hindrax_ident.assess.results import Contribution, MotionResult, Number
from hindrax_ident.model.motion_model import HORIZONTAL, MOTIONS, axis_units, rigid_mass
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.driven import USUAL_S

DRAG_COEFFICIENTS = (0.03, 100.0)
"""Range for bodies of any shape, on the area of the volume; at low speeds, with linear drag, they are large [-]."""
MOST_ADDED = 8.0
"""Largest ratio of added to body mass of anything but a flat plate [-]."""
SURELY = 2.0
"""Deviations by which a number is beyond its range: of a motion that hardly was, it may be any."""
FASTEST = (10.0, 12.0)
"""Speeds [m/s] and rates [rad/s] that no small vehicle reaches under water."""
CONTRADICTED, LEAST_OFF = 3.0, 0.005
"""Least difference of the net buoyancy that is reported: in its deviations, and as a share of the weight."""
INERTIA_SHARE = 0.3
"""Standard deviation of a body's moment of inertia about that of a homogeneous box [-]. Published ones of one BlueROV2
differ by as much."""
INERTIA_REMEDY = "name inertia_kgm2 in the vehicle file; a pendulum measures it"
FEWEST_PLANAR, LEAST_PUSH, COHERENT = 50, 0.2, 0.7
"""Fewest velocities of surge and sway, least thrust along one in that along the other, and least share of the velocity
that follows the thrust: 0.92 to 0.97 of nine records of three vehicles in MuJoCo's fluid, turned by 3 deg at most."""
TURNED_deg, HALF_deg = (8.0, 20.0), 150.0
"""Angles from which it is a warning, and from which nothing is identified; and beyond which it is a wrong sign."""
STRAIGHT_radps = 0.15
"""Yaw rate from which the vehicle turns."""


class Planar(NamedTuple):
    """Thrust behind the usual lag, and velocity less its mean, in the plane of surge and sway: (n,) complex each."""

    F: NDArray[np.complex128]
    V: NDArray[np.complex128]


NOT_PLANAR = Planar(np.zeros(0, dtype=complex), np.zeros(0, dtype=complex))


def planar(thrust: tuple[Array, Array], moved: tuple[Array, Array], turning: tuple[Array, Array]) -> Planar:
    """Samples of a record, for `turned_by`.

    Parameters
    ----------
    thrust : (m,) [s], (m, 2) [N]
        Times and thrusts along surge and sway.
    moved : (n,) [s], (n, 2) [m/s]
        Times and velocities.
    turning : (k,) [s], (k,) [rad/s]
        Yaw rates, none where they are not known: in a turn the velocity drags behind the bow.

    Returns
    -------
    Planar
        While it does not turn.
    """
    (times, wrench), (t, velocity), (turned_s, rates) = thrust, moved, turning
    if not len(times) or not len(t):
        return NOT_PLANAR
    X, Y = (LaggedThrust(times, array(one), USUAL_S).force(t) for one in wrench.T)
    u, v = velocity.T
    straight = np.abs(np.interp(t, turned_s, rates) if len(rates) else np.zeros(len(t))) < STRAIGHT_radps
    return Planar((X + 1j * Y)[straight], (u - u.mean() + 1j * (v - v.mean()))[straight])


def turned_by(parts: Sequence[Planar]) -> Objection:
    """What speaks against surge and sway because their velocities and forces have other axes.

    With F = X + iY behind the lag of a vehicle and V = u + iv, the sum of F* V has the angle by which the velocity is
    turned from the thrust that makes it, and is small where surge and sway change places: then the sum of F V is large.

    Parameters
    ----------
    parts
        Of all records that hold surge or sway.

    Returns
    -------
    Objection
        None where both axes were not pushed, or something else moved the vehicle.
    """
    F, V = (np.concatenate([NOT_PLANAR[row], *(part[row] for part in parts)]) for row in (0, 1))
    pushes = sorted((float(np.linalg.norm(F.real)), float(np.linalg.norm(F.imag))))
    if len(V) < FEWEST_PLANAR or pushes[0] < LEAST_PUSH * pushes[1]:
        return NO_OBJECTION
    size = float(np.linalg.norm(F) * np.linalg.norm(V))
    turned, mirrored = complex(np.vdot(F, V)) / max(1e-12, size), complex(F @ V) / max(1e-12, size)
    if abs(mirrored) > max(COHERENT, 2.0 * abs(turned)) and abs(mirrored.imag) > abs(mirrored.real):
        return objection(Code.SWAPPED_VELOCITIES)
    angle_deg = math.degrees(math.atan2(turned.imag, turned.real))
    # Half a turn is a wrong sign, which each axis says by itself.
    if abs(turned) < COHERENT or not TURNED_deg[0] < abs(angle_deg) < HALF_deg:
        return NO_OBJECTION
    return objection(Code.TURNED_VELOCITY, angle_deg=abs(angle_deg), side="starboard" if angle_deg > 0.0 else "port")


def _is_grave(turned: Objection) -> bool:
    """Whether nothing can be identified by velocities that are turned so far."""
    angle_deg = turned.numbers.get("angle_deg", math.inf)
    return bool(turned) and isinstance(angle_deg, float) and angle_deg > TURNED_deg[1]


def with_plausibility_check(result: MotionResult, vehicle: Vehicle, turned: Objection = NO_OBJECTION) -> MotionResult:
    """Add what is implausible of a result to its reasons; velocities that are turned a little are a warning.

    Parameters
    ----------
    result
        Of one motion.
    vehicle
        Mass and hull.
    turned
        What `turned_by` says of surge and sway.

    Returns
    -------
    MotionResult
        Not identifiable where there is any.
    """
    reasons = _implausibilities(result, vehicle) if result.coefficients else []
    turned = turned if MOTIONS[result.motion].axis in HORIZONTAL else NO_OBJECTION
    if _is_grave(turned):
        reasons.append(turned)
    elif turned:
        result = replace(result, warnings=(*result.warnings, turned))
    return result.refused_for(*reasons) if reasons else result


def with_mass_checks(result: MotionResult, vehicle: Vehicle) -> MotionResult:
    """What mass, volume and inertia of the vehicle file say of a result, or what is not known of them."""
    return _with_inertia_uncertainty(_with_weight_check(result, vehicle), vehicle)


def _with_weight_check(result: MotionResult, vehicle: Vehicle) -> MotionResult:
    """The result, with a warning where its net buoyancy contradicts mass and volume of the vehicle file."""
    found = result.coefficients.get("b")
    if MOTIONS[result.motion].axis != 2 or found is None:
        return result
    off_N = found.value - vehicle.net_buoyancy_N
    sigma_N = _sigma(found)
    if abs(off_N) < max(CONTRADICTED * sigma_N, LEAST_OFF * vehicle.weight_N):
        return result
    shown = measured(found.value, sigma_N)
    upward = abs(found.value + vehicle.net_buoyancy_N) < CONTRADICTED * sigma_N
    axes = "the axes, which seem to point up (--frame flu), else " if upward else ""
    warning = objection(Code.OTHER_WEIGHT, shown=shown, known_N=vehicle.net_buoyancy_N, axes=axes)
    return replace(result, warnings=(*result.warnings, warning))


def _with_inertia_uncertainty(result: MotionResult, vehicle: Vehicle) -> MotionResult:
    """The result, whose added mass of a rotation holds no better than an assumed moment of inertia."""
    found, axis = result.coefficients.get("added_mass"), MOTIONS[result.motion].axis
    if axis < 3 or vehicle.inertia_kgm2 is not None or found is None:
        return result
    inertia = Contribution("inertia of the body", INERTIA_SHARE * rigid_mass(vehicle, axis), INERTIA_REMEDY)
    corrected = found.corrected and found.corrected.widened(inertia.std)
    wider = replace(found, std_calibrated=math.hypot(found.std_calibrated, inertia.std), corrected=corrected)
    rows = sorted([inertia, *result.budget.get("added_mass", ())], key=lambda row: -row.std)
    numbers, budget = {**result.coefficients, "added_mass": wider}, {**result.budget, "added_mass": rows}
    return replace(result, coefficients=numbers, budget=budget)


def _sigma(number: Number) -> float:
    """Deviation with all influences, where they are known."""
    return number.std_calibrated if math.isfinite(number.std_calibrated) else number.std


def _implausibilities(result: MotionResult, vehicle: Vehicle) -> list[Objection]:
    axis, speed = MOTIONS[result.motion].axis, result.speeds[1]
    out = []
    if speed > FASTEST[axis >= 3]:
        out.append(objection(Code.IMPLAUSIBLE_SPEED, speed=speed, unit=axis_units(axis)[0]))
    added = result.coefficients.get("added_mass")
    own = rigid_mass(vehicle, axis)
    if added is not None and axis < 3 and added.value - SURELY * _sigma(added) > MOST_ADDED * own:
        out.append(objection(Code.IMPLAUSIBLE_MASS, times=added.value / own))
    if axis < 3 and result.drag is not None:
        # On the area of COB-2023-1394, volume to the power of two thirds, at the highest speed.
        pressure = 0.5 * vehicle.water.density_kgpm3 * float(result.drag.speed[-1]) ** 2
        area_m2 = vehicle.characteristic_length_m**2
        unit_N, (low, high) = max(1e-12, pressure * area_m2), DRAG_COEFFICIENTS
        coefficient, sigma = (float(one[-1]) / unit_N for one in (result.drag.force, result.drag.std_calibrated))
        beyond = max(low - coefficient, coefficient - high)
        if coefficient > 0.0 and beyond > SURELY * (sigma if math.isfinite(sigma) else 0.0):
            out.append(objection(Code.IMPLAUSIBLE_DRAG, found=coefficient, low=low, high=high))
    return out
