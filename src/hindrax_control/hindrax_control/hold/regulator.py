"""One axis under control: a reference that moves no faster than allowed, and a PI-D law around it.

Gains by pole placement: with inertia M, drag slope d and restoring k, the gains M w^2 - k and 2 z w M - d put both
poles of M x'' + d x' + k x at w, damped by z. The derivative acts on the measured rate, never on an error that jumps.
"""

import math
from dataclasses import dataclass

from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.vehicle import Vehicle

LONGEST_STEP_S = 0.2
LIMIT_SHARE = 0.45
"""Share of the vehicle's speed limit at which a reference may move: surge, sway and heave at once stay below it."""


@dataclass(frozen=True, slots=True)
class LoopTuning:
    """Specification of a loop: bandwidth, damping, how fast the integral acts and the reference moves, authority."""

    bandwidth_radps: float
    damping: float
    integral_s: float
    rate: float
    """Largest rate of the reference [m/s, rad/s]."""
    authority: float
    """Largest size of the integral part [N, N m]."""
    shortfall: float = 0.0
    """Shortfall of the allocator up to which the integral part integrates [N, N m]."""


class Ramp:
    """A reference that follows its goal at a bounded rate and can always stop at it."""

    def __init__(self, bandwidth_radps: float, speed: float) -> None:
        self._bandwidth, self.speed = bandwidth_radps, speed
        self._most = 1.5 * bandwidth_radps * speed
        self.value = self.rate = 0.0

    def start(self, value: float, rate: float) -> None:
        """Begin where the vehicle is, moving as it moves."""
        self.value, self.rate = value, rate

    def step(self, distance: float, dt: float) -> float:
        """Move by `dt` seconds towards a goal that lies at a (signed) distance; returns the acceleration."""
        if dt <= 0.0:
            return 0.0
        # Slower and slower towards the goal: from there the reference can always stop at it.
        speed = min(self._bandwidth * abs(distance), self.speed)
        change = math.copysign(speed, distance) - self.rate
        change = max(-self._most * dt, min(self._most * dt, change))
        self.rate += change
        self.value += self.rate * dt
        return change / dt


class Regulator:
    """Holds one coordinate of one degree of freedom.

    While the allocator falls short in the direction of the error, the integral part stands still (anti-windup) and the
    reference is not left far behind.
    """

    def __init__(self, freedom: PriorDynamics, tuning: LoopTuning) -> None:
        self._freedom = freedom
        self.ramp = Ramp(tuning.bandwidth_radps, tuning.rate)
        self.integral = 0.0
        self.tune(tuning)

    def tune(self, tuning: LoopTuning) -> None:
        """Use other gains from now on; reference and integral part stay."""
        self._tuning, before = tuning, self.ramp
        self.proportional, self.derivative = gains(self._freedom, tuning.bandwidth_radps, tuning.damping)
        self._integral_gain = self.proportional / tuning.integral_s
        self.ramp = Ramp(tuning.bandwidth_radps, tuning.rate)
        self.ramp.start(before.value, before.rate)

    def start(self, value: float, rate: float) -> None:
        """Begin where the vehicle is, moving as it moves, with nothing in the integral part."""
        self.ramp.start(value, rate)
        self.integral = 0.0

    def step(self, to_goal: float, error: float, rate: float, dt: float, shortfall: float = 0.0) -> float:
        """Return the effort beyond bias and restoring.

        Parameters
        ----------
        to_goal : [m, rad]
            Goal - reference, wrapped where it is an angle.
        error : [m, rad]
            Reference - value, wrapped where it is an angle.
        rate : [m/s, rad/s]
            Of the value.
        dt : [s]
            Since the last step.
        shortfall : [N, N m]
            What the allocator could not give of the last effort: the integral part stands still.

        Returns
        -------
        float
            [N, N m].
        """
        dt = min(max(dt, 0.0), LONGEST_STEP_S)
        acceleration = self.ramp.step(to_goal, dt)
        error += self.ramp.rate * dt
        if abs(shortfall) > self._tuning.shortfall and shortfall * error > 0.0:
            error = self._let_go(error)
        else:
            integral = self.integral + self._integral_gain * error * dt
            self.integral = max(-self._tuning.authority, min(self._tuning.authority, integral))
        forward = self._freedom.inertia * acceleration + self._freedom.drag_force(self.ramp.rate)
        return self.proportional * error + self.derivative * (self.ramp.rate - rate) + self.integral + forward

    def _let_go(self, error: float) -> float:
        """Pull the reference along when the vehicle is carried away, so that it comes back at its usual rate."""
        leash = self._tuning.rate / self._tuning.bandwidth_radps
        kept = max(-leash, min(leash, error))
        self.ramp.value += kept - error
        return kept


def gains(freedom: PriorDynamics, bandwidth_radps: float, damping: float) -> tuple[float, float]:
    """Proportional and derivative gain for a closed loop of second order.

    Where the restoring moment has the wanted stiffness M w^2 already, a fifth of that is still the proportional gain:
    the integral part, which holds against constant forces, is proportional to it.

    Parameters
    ----------
    freedom
        Inertia, drag and stiffness of the axis.
    bandwidth_radps, damping : [rad/s], [-]
        Of the closed loop.

    Returns
    -------
    tuple[float, float]
        [N/m, N s/m; N m/rad, N m s/rad].
    """
    stiffness = freedom.inertia * bandwidth_radps * bandwidth_radps
    derivative = 2.0 * damping * bandwidth_radps * freedom.inertia - freedom.drag.k_l
    return max(stiffness - freedom.restoring, 0.2 * stiffness), max(derivative, 0.0)


def reference_speed(wanted_mps: float, vehicle: Vehicle) -> float:
    """Speed of a reference [m/s]: as wanted, but well below the speed at which the vehicle is stopped."""
    return min(wanted_mps, LIMIT_SHARE * vehicle.limits.speed_mps)
