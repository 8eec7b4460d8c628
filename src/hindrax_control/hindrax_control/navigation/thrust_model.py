"""Surge and sway by the thrusters and the vehicle file: what the momentum balance expects of the motion."""

import math
from collections.abc import Sequence

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.readings import Vec3
from hindrax_core.vehicle import Vehicle


class ThrustModel:
    """Force of the thrusters behind their lag, less the drag of the prior."""

    def __init__(self, vehicle: Vehicle) -> None:
        found = prior_dynamics(vehicle)
        self._freedoms = found["surge"], found["sway"], found["heave"]
        along, aside = effectiveness(vehicle)[:2].tolist()
        self._shares: tuple[complex, ...] = tuple(map(complex, along, aside))
        lags_s = [thruster.lag_s for thruster in vehicle.thrusters]
        self._lag_s = max(sum(lags_s) / max(1, len(lags_s)), 1e-3)
        self._force_N = 0j

    def step(self, forces_N: Sequence[float], velocity_mps: Vec3, rate_radps: Vec3, dt_s: float) -> complex | None:
        """Expect an acceleration over ground.

        The added mass makes the momentum of a turning vehicle another one than its velocity (Fossen 2011 eq. 6.43).

        Parameters
        ----------
        forces_N : (thrusters,) [N]
            What each should give now.
        velocity_mps, rate_radps : (3,) [m/s], [rad/s]
            Of the body; its drag is that of this speed.
        dt_s : [s]
            Since the last step.

        Returns
        -------
        complex | None
            Ahead + i to starboard [m/s^2]; None where the forces are not known.
        """
        if len(forces_N) != len(self._shares):
            self._force_N = 0j
            return None
        force_N = sum((share * force for share, force in zip(self._shares, forces_N, strict=True)), 0j)
        self._force_N += (force_N - self._force_N) * -math.expm1(-dt_s / self._lag_s)
        surge, sway, heave = self._freedoms
        (u, v, w), (p, q, r) = velocity_mps, rate_radps
        X, Y, Z = surge.inertia * u, sway.inertia * v, heave.inertia * w
        ahead_N = self._force_N.real - surge.drag_force(u) + r * Y - q * Z
        aside_N = self._force_N.imag - sway.drag_force(v) + p * Z - r * X
        # Of the momentum in axes that turn; the velocity over ground changes by less what the turn of the axes adds.
        return complex(ahead_N / surge.inertia - r * v + q * w, aside_N / sway.inertia + r * u - p * w)
