"""Results that no vehicle has: wrong units and axes give numbers too, often with narrow bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.lag import LaggedThrust
from hindrax_ident.models import MOTIONS, rigid_mass
from hindrax_ident.readers import Recording
from hindrax_ident.results import MotionResult

DRAG_COEFFICIENTS = (0.03, 100.0)
"""Of bodies of every shape, by the area of the volume; slow ones, whose drag is linear, have the large ones [-]."""
MOST_ADDED = 8.0
"""Added mass of anything that is no flat plate, in its own mass [-]."""
FASTEST = (10.0, 12.0)
"""Speeds [m/s] and rates [rad/s] that no small vehicle reaches under water."""
REMEDY = "check the units of force and velocity, and the vehicle file"


USUAL_S = 0.7
"""Time after which a small vehicle has followed its thrust."""
AGAINST = -0.6
"""Correlation of velocity and thrust that no vehicle has which is pushed by it."""


def moves_against(recordings: Sequence[Recording], axis: int) -> str:
    """What to say of a vehicle that moves the way its thrust does not push; empty where it does not."""
    pairs = [pair for one in recordings if len(pair := _follows(one, axis))]
    if not pairs:
        return ""
    v, force = np.concatenate(pairs).T
    spread = float(np.std(v) * np.std(force))
    if spread == 0.0 or float(np.mean((v - v.mean()) * (force - force.mean()))) > AGAINST * spread:
        return ""
    return "it moves against its thrust: check the sign of the wrench, and the axes of both"


def _follows(recording: Recording, axis: int) -> Array:
    """Velocities, and thrust as a vehicle would follow it, at the times of the velocities: (n, 2)."""
    told, moved = np.isfinite(recording.wrench[:, axis]), np.isfinite(recording.velocity[:, axis])
    if not told.any() or not moved.any():
        return np.zeros((0, 2))
    thrust = LaggedThrust(recording.wrench_t[told], recording.wrench[told, axis], USUAL_S)
    return np.column_stack([recording.velocity[moved, axis], thrust.force(recording.velocity_t[moved])])


def blamed(result: MotionResult, reason: str) -> MotionResult:
    """The same result with one more reason against it, if there is one."""
    return replace(result, identifiable=False, reasons=(*result.reasons, reason)) if reason else result


def suspected(result: MotionResult, vehicle: Vehicle) -> MotionResult:
    """The same result, with every suspicion as a reason against it."""
    for found in _suspicions(result, vehicle) if result.coefficients else ():
        result = blamed(result, found)
    return result


def _suspicions(result: MotionResult, vehicle: Vehicle) -> list[str]:
    axis, speed = MOTIONS[result.motion].axis, result.speeds[1]
    out = []
    if speed > FASTEST[axis >= 3]:
        out.append(f"speeds of up to {speed:.3g} {'rad/s' if axis >= 3 else 'm/s'}: {REMEDY}")
    added = result.coefficients.get("added_mass")
    own = rigid_mass(vehicle, axis)
    if added is not None and axis < 3 and added.value > MOST_ADDED * own:
        out.append(f"the added mass comes out as {added.value / own:.0f} times the body's own: {REMEDY}")
    if axis < 3 and result.drag is not None:
        coefficient = _drag_coefficient(result, vehicle)
        if coefficient > 0.0 and not DRAG_COEFFICIENTS[0] < coefficient < DRAG_COEFFICIENTS[1]:
            low, high = DRAG_COEFFICIENTS
            out.append(f"the drag coefficient comes out as {coefficient:.2g}, beyond {low:g} to {high:g}: {REMEDY}")
    return out


def _drag_coefficient(result: MotionResult, vehicle: Vehicle) -> float:
    """C_D of the highest speed, on the area of COB-2023-1394: volume to the power of two thirds."""
    assert result.drag is not None
    speed, force = float(result.drag.speed[-1]), float(result.drag.force[-1])
    pressure = 0.5 * vehicle.water.density_kgpm3 * speed * speed
    return force / float(np.maximum(1e-12, pressure * vehicle.characteristic_length_m**2))
