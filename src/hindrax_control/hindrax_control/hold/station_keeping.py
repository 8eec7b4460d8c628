"""Keeping station in the pool: surge and sway force that bring the vehicle to a point and hold it there.

A two-dimensional PI-D law in pool axes, turned into the body by the heading, so that a current, which pushes the same
way whatever the heading, stays in the integral part while the vehicle turns.
"""

import math
from dataclasses import dataclass

from hindrax_control.hold.regulator import LONGEST_STEP_S, Ramp, gains, reference_speed
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.knobs import knob
from hindrax_core.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class StationKeepingKnobs:
    """Bandwidth of station keeping; gains follow from the vehicle file."""

    bandwidth_radps: float = knob(0.6, 0.05, 3.0, "bandwidth of station keeping [rad/s]")
    damping: float = knob(1.0, 0.4, 3.0, "damping ratio of station keeping [-]")
    integral_s: float = knob(6.0, 0.5, 60.0, "time in which the integral part repeats the proportional one [s]")
    speed_mps: float = knob(0.3, 0.02, 2.0, "speed of a transit [m/s]")
    integral_N: float = knob(8.0, 0.0, 500.0, "largest integral part [N]")
    unsure_mps: float = knob(
        0.25, 0.01, 10.0, "standard deviation of a velocity that is not measured, beyond which it gives no force [m/s]"
    )


class StationKeeping:
    """Goes to a goal in the pool and stays there; one axis may be left to someone else."""

    def __init__(self, vehicle: Vehicle, knobs: StationKeepingKnobs | None = None) -> None:
        self._knobs = knobs = knobs or StationKeepingKnobs()
        found = prior_dynamics(vehicle)
        self._surge, self._sway = found["surge"], found["sway"]
        self._gains = tuple(gains(one, knobs.bandwidth_radps, knobs.damping) for one in (self._surge, self._sway))
        self.speed_mps = reference_speed(knobs.speed_mps, vehicle)
        """Speed of a transit."""
        self._x, self._y = (Ramp(knobs.bandwidth_radps, self.speed_mps) for _ in range(2))
        self._push = [0.0, 0.0]
        self.goal_m: tuple[float, float] | None = None

    def start(self, place: PoolPosition) -> None:
        """Take the present place as goal, moving as the vehicle moves; what holds against a current is kept."""
        self._x.start(place.x_m, place.vx_mps)
        self._y.start(place.y_m, place.vy_mps)
        self.goal_m = (place.x_m, place.y_m)

    def step(
        self, place: PoolPosition, dt: float, *, length_free: bool = False, held_back: bool = False
    ) -> tuple[float, float]:
        """Surge and sway force that keeps a place of the pool.

        Parameters
        ----------
        place
            In pool axes [m], with heading and velocity.
        dt : [s]
            Since the last step.
        length_free
            Whether someone else drives along the pool's length: the goal follows the vehicle there.
        held_back
            Whether the allocator cannot give what was asked: the integral part stands still.

        Returns
        -------
        tuple[float, float]
            [N] in body axes; zero while the place or the velocity is unknown.
        """
        # A velocity by the accelerometer alone drifts. Beyond `unsure_mps` it is taken for unknown: damping would push
        # against a motion that is not there, into a wall.
        unsure = place.speed_sigma_mps > self._knobs.unsure_mps
        if unsure or not all(map(math.isfinite, (place.x_m, place.y_m, place.vx_mps, place.vy_mps))):
            self.goal_m = None
            return (0.0, 0.0)
        if self.goal_m is None:
            self.start(place)
        goal_x, goal_y = self.goal_m or (place.x_m, place.y_m)
        if length_free:
            goal_x = place.x_m
            self._x.start(place.x_m, place.vx_mps)
        self.goal_m = (goal_x, goal_y)
        dt = min(max(dt, 0.0), LONGEST_STEP_S)
        faster_x, faster_y = self._x.step(goal_x - self._x.value, dt), self._y.step(goal_y - self._y.value, dt)
        return self._force(place, (0.0 if length_free else faster_x, faster_y), dt, held_back=held_back)

    def _force(
        self, place: PoolPosition, faster_mps2: tuple[float, float], dt: float, *, held_back: bool
    ) -> tuple[float, float]:
        """Surge and sway force [N]: spring, damping and integral of the error, and what the reference itself needs.

        The integral lives in pool axes, because a current pushes the same way whatever the heading; all else is turned
        into body axes, where gains, drag and inertia differ between surge and sway. Damping acts on the rate by which
        the vehicle lags behind the reference, so a transit is not braked; drag and inertia of the reference are given
        ahead.
        """
        cos, sin = math.cos(place.heading_rad), math.sin(place.heading_rad)
        error_x, error_y = self._x.value - place.x_m, self._y.value - place.y_m
        (stiff_u, damp_u), (stiff_v, damp_v) = self._gains

        turned = place.body
        error_u, error_v = turned(error_x, error_y)
        spring_u, spring_v = stiff_u * error_u, stiff_v * error_v
        if not held_back:
            self._integrate(0, cos * spring_u - sin * spring_v, dt)
            self._integrate(1, sin * spring_u + cos * spring_v, dt)
        faster_u, faster_v = turned(*faster_mps2)
        wanted_u, wanted_v = turned(self._x.rate, self._y.rate)
        lag_u, lag_v = turned(self._x.rate - place.vx_mps, self._y.rate - place.vy_mps)
        push_u, push_v = turned(self._push[0], self._push[1])
        return (
            spring_u + damp_u * lag_u + push_u + self._surge.drag_force(wanted_u) + self._surge.inertia * faster_u,
            spring_v + damp_v * lag_v + push_v + self._sway.drag_force(wanted_v) + self._sway.inertia * faster_v,
        )

    def _integrate(self, axis: int, spring_N: float, dt: float) -> None:
        most = self._knobs.integral_N
        pushed = self._push[axis] + spring_N / self._knobs.integral_s * dt
        self._push[axis] = max(-most, min(most, pushed))
