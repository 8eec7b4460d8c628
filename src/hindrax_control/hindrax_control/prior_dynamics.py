"""Prior of each degree of freedom before anything is identified: inertia, drag, restoring.

Plans and gains follow from it, so that a second vehicle needs no tuning. Where the vehicle file gives no
hydrodynamics, displaced volume and envelope stand in for them: crude, and good enough to plan with.
"""

import math
from dataclasses import dataclass

from hindrax_core.vehicle import AXES, Drag, Hydrodynamics, Vehicle

BLUFF_DRAG = 1.2
"""Drag coefficient of a box with its face to the flow, for vehicles without hydrodynamics in their file."""


@dataclass(frozen=True, slots=True)
class PriorDynamics:
    """One degree of freedom: M x'' + drag(x') + restoring sin(x) + bias = force."""

    inertia: float
    """Rigid body and added mass [kg, kg m^2]."""
    drag: Drag
    restoring: float = 0.0
    """Moment per sine of the angle [N m]; zero for all but roll and pitch."""
    bias: float = 0.0
    """Force that keeps it at rest [N]: the net buoyancy in heave."""

    @property
    def slope(self) -> float:
        """Slope of the drag at rest [N s/m, N m s]: the smaller of both directions."""
        return min(self.drag.of(backward=back)[1] for back in (False, True))

    def drag_force(self, rate: float) -> float:
        """Force against drag at a steady rate [m/s, rad/s]."""
        return self.drag.resistance(rate)

    def rate_at(self, force: float) -> float:
        """Steady rate at which drag balances a force: the inverse of `drag_force`."""
        k_q, k_l = self.drag.of(backward=force < 0.0)
        if k_q == 0.0:
            return force / k_l if k_l else math.copysign(math.inf, force)
        root = math.sqrt(k_l * k_l + 4.0 * k_q * abs(force))
        return math.copysign(2.0 * abs(force) / (k_l + root), force) if force else 0.0


def prior_dynamics(vehicle: Vehicle) -> dict[str, PriorDynamics]:
    """Return the prior of each SNAME axis, by name."""
    hydrodynamics = vehicle.hydrodynamics or guessed(vehicle)
    rigid = (vehicle.mass_kg,) * 3 + vehicle.inertia
    arm_m = vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2]
    righting = vehicle.buoyancy_N * arm_m
    restoring = {"roll": righting, "pitch": righting}
    return {
        axis: PriorDynamics(
            inertia=mass + added,
            drag=hydrodynamics.drag(axis),
            restoring=restoring.get(axis, 0.0),
            bias=vehicle.net_buoyancy_N if axis == "heave" else 0.0,
        )
        for axis, mass, added in zip(AXES, rigid, hydrodynamics.added_mass, strict=True)
    }


def guessed(vehicle: Vehicle) -> Hydrodynamics:
    """Hydrodynamics from volume and envelope alone: displaced water as added mass, a bluff box's drag."""
    length, width, height = vehicle.envelope_m
    half_density = 0.5 * vehicle.water.density_kgpm3 * BLUFF_DRAG
    entrained = vehicle.volume_m3 * vehicle.water.density_kgpm3
    ix, iy, iz = vehicle.inertia
    faces = {"surge": width * height, "sway": length * height, "heave": length * width}
    # A plate turning about its middle: the integral of |x|^3 over its length, (half)^4 / 2 per unit width.
    turning = {
        "roll": length * (width / 2.0) ** 4 / 2.0,
        "pitch": width * (length / 2.0) ** 4 / 2.0,
        "yaw": height * (length / 2.0) ** 4 / 2.0,
    }
    surge, sway, heave, roll, pitch, yaw = (Drag(k_q=half_density * (faces | turning)[axis]) for axis in AXES)
    added_mass = (entrained, entrained, entrained, 0.5 * ix, 0.5 * iy, 0.5 * iz)
    return Hydrodynamics(added_mass, surge, sway, heave, roll, pitch, yaw)
