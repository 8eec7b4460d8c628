"""Results that no vehicle has: wrong units and axes give numbers too, often with narrow bands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.models import MOTIONS, rigid_mass
from hindrax_ident.results import MotionResult

DRAG_COEFFICIENTS = (0.03, 100.0)
"""Of bodies of every shape, by the area of the volume; slow ones, whose drag is linear, have the large ones [-]."""
MOST_ADDED = 8.0
"""Added mass of anything that is no flat plate, in its own mass [-]."""
FASTEST = (10.0, 12.0)
"""Speeds [m/s] and rates [rad/s] that no small vehicle reaches under water."""
REMEDY = "check the units of force and velocity, and the vehicle file"


def suspected(result: MotionResult, vehicle: Vehicle) -> MotionResult:
    """The same result, with every suspicion as a reason against it."""
    found = tuple(_suspicions(result, vehicle)) if result.coefficients else ()
    if not found:
        return result
    return replace(result, identifiable=False, reasons=(*result.reasons, *found))


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
