"""The world as it really is: the true vehicle, and what acts on it. Every condition adds its part."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from hindrax_core.readings import Vec3
from hindrax_core.vehicle import AXES, Drag, Hydrodynamics, Vehicle
from hindrax_sim.physics.plant import Influence, Plant, ThrustLoss, truth_of

Travel: TypeAlias = tuple[Vec3, Vec3]
"""Angle turned [rad] and ground covered [m] since the start, in body axes."""
TravelError: TypeAlias = Callable[[Plant, Travel], Travel]
"""Travel as a velocity sensor measures it."""
DragChange: TypeAlias = Callable[[int, float], float]
"""Resistance of an axis (0 surge to 5 yaw) at a speed, beyond that of the hull's coefficients [N, N m]."""

TESTED = (0.5, 0.5, 0.5, 1.0, 1.0, 1.0)
"""Speed of each axis at which other laws of drag agree with the coefficients of the vehicle file [m/s, rad/s]."""


@dataclass
class Realization:
    """A world in the making. `vehicle` is what is true of it; the stack knows only the vehicle file."""

    vehicle: Vehicle
    influences: list[Influence] = field(default_factory=list)
    thrust_losses: list[ThrustLoss] = field(default_factory=list)
    travel_errors: list[TravelError] = field(default_factory=list)
    drag_changes: list[DragChange] = field(default_factory=list)
    pulled: bool = False
    """Whether a tether pulls: constant forces are then those of hull and tether together, and vary along the way."""

    def change_vehicle(self, **changes: Any) -> None:
        """Replace fields of the true vehicle."""
        self.vehicle = replace(self.vehicle, **changes)

    @property
    def hydrodynamics(self) -> Hydrodynamics:
        """Those of the true vehicle, which a mock vehicle has."""
        return truth_of(self.vehicle)

    def resistance(self, axis: int, speed: float) -> float:
        """Drag of the hull against a motion, positive with a positive speed [N, N m]."""
        own = self.hydrodynamics.drag(AXES[axis]).resistance(speed)
        return own + sum(change(axis, speed) for change in self.drag_changes)

    def described(self) -> Vehicle:
        """The true vehicle with coefficients that hold where its law of drag is another: at TESTED and half of it."""
        if not self.drag_changes:
            return self.vehicle
        drags: dict[str, Any] = {name: self._coefficients(axis) for axis, name in enumerate(AXES)}
        return replace(self.vehicle, hydrodynamics=replace(self.hydrodynamics, **drags))

    def _coefficients(self, axis: int) -> Drag:
        top = TESTED[axis]
        (k_q, k_l), (back_q, back_l) = (
            _through(top, abs(self.resistance(axis, side * top)), abs(self.resistance(axis, 0.5 * side * top)))
            for side in (1.0, -1.0)
        )
        return Drag(k_q, k_l, back_q, back_l)


def _through(speed: float, whole: float, at_half: float) -> tuple[float, float]:
    """k_q and k_l of a drag that has these two forces at a speed and at half of it."""
    return 2.0 * (whole - 2.0 * at_half) / speed**2, (4.0 * at_half - whole) / speed
