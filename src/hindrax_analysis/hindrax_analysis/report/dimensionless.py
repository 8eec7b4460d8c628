"""Table 4 of COB-2023-1394 for any vehicle: drag coefficient and Reynolds number of a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS


@dataclass(frozen=True, slots=True)
class Dimensionless:
    """C_D at each speed of the drag band, its standard deviations (noise; with calibration), and Re: (n,) each."""

    reynolds: Array
    drag_coefficient: Array
    std: Array
    std_calibrated: Array

    @property
    def mean(self) -> tuple[float, float, float]:
        """Mean over the speeds and the means of both standard deviations."""
        return tuple(float(np.mean(part)) for part in (self.drag_coefficient, self.std, self.std_calibrated))  # type: ignore[return-value]  # three parts, three numbers


def dimensionless(vehicle: Vehicle, result: MotionResult) -> Dimensionless | None:
    """Drag force in the paper's terms; None where the motion has no band of speeds.

    C_D = F / (1/2 rho V^(2/3) U^2) and Re = U V^(1/3) / nu, for turns C_D = M / (1/2 rho L^5 w^2) and
    Re = w L^2 / nu with the length of the vehicle.
    """
    if result.drag is None:
        return None
    rho, nu = vehicle.water.density_kgpm3, vehicle.water.kinematic_viscosity_m2ps
    turns = MOTIONS[result.motion].axis >= 3
    length = vehicle.envelope_m[0] if turns else vehicle.characteristic_length_m
    per_force = 2.0 / (rho * length ** (5 if turns else 2) * result.drag.speed**2)
    reynolds = result.drag.speed * length ** (2 if turns else 1) / nu
    band = result.drag
    parts = (reynolds, band.force * per_force, band.std * per_force, band.std_calibrated * per_force)
    known = [array(part) for part in parts]
    return Dimensionless(*known)


def format_reynolds(reynolds: float) -> str:
    """A Reynolds number as the paper prints it: 1.1 times ten to the fifth."""
    if not reynolds > 0.0:
        return "0"
    power = math.floor(math.log10(reynolds))
    raised = str(power).translate(
        str.maketrans("0123456789-", "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079\u207b")
    )
    return f"{reynolds / 10.0**power:.1f} \u00d7 10{raised}"
