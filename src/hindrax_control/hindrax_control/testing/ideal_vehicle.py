"""An ideal vehicle: six uncoupled degrees of freedom in still or moving water, perfect senses."""

import math

from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES, Vehicle

AGES_S = {"icm20948": 0.01, "ms5837": 0.02, "ping1d": 0.05, "dvl75": 0.05}


class IdealVehicle:
    """Starts in the middle of the pool, afloat or at a depth, and drifts with the current."""

    def __init__(
        self,
        vehicle: Vehicle,
        depth_m: float = 0.3,
        heading_rad: float = 0.0,
        step_s: float = 0.02,
        lag_s: float = 0.15,
    ) -> None:
        self.vehicle, self.freedoms = vehicle, prior_dynamics(vehicle)
        self.rate = dict.fromkeys(AXES, 0.0)
        self.thrust = dict.fromkeys(AXES, 0.0)
        self.roll = self.pitch = self.north = self.east = 0.0
        self.heading, self.depth, self.step_s, self.lag_s = heading_rad, depth_m, step_s, lag_s
        self.time_s, self.current, self.locked, self.ages_s = 0.0, (0.0, 0.0), True, dict(AGES_S)
        self.altitude_age_s = 0.05
        self.sigma_m = math.nan

    @property
    def stamp(self) -> Stamp:
        """Time since the start of the run."""
        return stamp_from_s(self.time_s)

    def ground_velocity(self) -> tuple[float, float]:
        """Surge and sway over ground."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        north, east = self.current
        return self.rate["surge"] + cos * north + sin * east, self.rate["sway"] - sin * north + cos * east

    def navigation(self) -> Navigation:
        """State as a navigator without errors has it."""
        u, v = self.ground_velocity()
        return Navigation(
            attitude_rad=(self.roll, self.pitch, math.remainder(self.heading, math.tau)),
            rate_radps=(self.rate["roll"], self.rate["pitch"], self.rate["yaw"]),
            velocity_mps=(u, v, self.rate["heave"]),
            depth_m=self.depth,
            altitude_m=self.vehicle.pool.depth_m - self.depth,
            position_m=(self.north, self.east),
            dvl_locked=self.locked,
            ages_s=self.ages_s,
            depth_age_s=0.02,
            altitude_age_s=self.altitude_age_s,
            position_sigma_m=self.sigma_m,
        )

    def step(self, wrench: tuple[float, ...]) -> None:
        """Let a wrench act for one step."""
        angles = {"roll": self.roll, "pitch": self.pitch}
        for axis, force in zip(AXES, wrench, strict=True):
            freedom, rate = self.freedoms[axis], self.rate[axis]
            self.thrust[axis] += (force - self.thrust[axis]) * (1.0 - math.exp(-self.step_s / self.lag_s))
            net = self.thrust[axis] - freedom.drag_force(rate) - freedom.bias
            net -= freedom.restoring * math.sin(angles.get(axis, 0.0))
            self.rate[axis] += net / freedom.inertia * self.step_s
        """State as a navigator without errors has it."""
        u, v = self.ground_velocity()
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        self.north += (cos * u - sin * v) * self.step_s
        self.east += (sin * u + cos * v) * self.step_s
        self.depth = max(0.19, self.depth + self.rate["heave"] * self.step_s)
        self.roll += self.rate["roll"] * self.step_s
        self.pitch += self.rate["pitch"] * self.step_s
        self.heading += self.rate["yaw"] * self.step_s
        self.time_s += self.step_s
