"""State of the vehicle from third-party odometry, with the checks of its health that are possible from outside.

Its maker judges the sensors behind it. Here it must be of now, unbroken, and possible for this vehicle: a state that
came from another source, went back in time or jumped began anew, which `EstimatorHealth` does not accept in flight.
"""

from __future__ import annotations

import math
from dataclasses import replace

from hindrax_control.navigation.estimator_health import FASTEST
from hindrax_control.navigation.sensor_mount import sensor_mount
from hindrax_control.sensor_kinds import ALTITUDE, sensors_of
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.input_checks import StampWindow
from hindrax_core.rotation import matrix
from hindrax_core.signals import NAN, NEVER, Navigation
from hindrax_core.vehicle import Vehicle

WINDOW = StampWindow(0.5, 0.1)
"""For the stamps of an odometry; those of a wrench have the same limits."""
SHORTEST_s = 0.015
"""States in between are left out: the pilot counts on 50 Hz."""
JUMP_m = 0.3
"""A position may be corrected by so much at once."""
ALTITUDE_AGE_s = 2.0


class ExternalOdometry:
    """One vehicle's state, made complete: an odometry stands for all sensors but the altimeter."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._fastest_mps = FASTEST * vehicle.limits.speed_mps
        self._altimeters = sensors_of(vehicle, ALTITUDE)
        self._mount = sensor_mount(vehicle.sensors[self._altimeters[0]]) if self._altimeters else None
        self._ages_s = {name: 0.0 for name in vehicle.sensors if name not in self._altimeters}
        self._range: Stamped[float] | None = None
        self._last: Stamped[Navigation] | None = None
        self._source, self._began = "", NEVER
        self.breaks = 0
        """How often a state began anew, so that its position does not go on from the one before."""

    def range(self, stamp: Stamp, range_m: float) -> None:
        """Keep the distance to the bottom along the axis of the altimeter [m]."""
        if 0.0 < range_m < math.inf:
            self._range = Stamped(stamp, range_m)

    def step(self, found: Stamped[Navigation], source: str, now: Stamp) -> tuple[Stamped[Navigation] | None, str]:
        """The state to fly on, or None; and why an odometry of `source` was refused, empty when it was not."""
        untimely = WINDOW.judge(found.stamp, now)
        if untimely is not None:
            return None, untimely.sentence
        last = self._last
        if last is not None and source == self._source and 0.0 <= seconds_between(last.stamp, found.stamp) < SHORTEST_s:
            return None, ""
        if last is None or source != self._source or self._broken(last, found):
            self._began, self.breaks = found.stamp, self.breaks + (last is not None)
        self._source, self._last = source, found
        consistency = replace(found.reading.consistency, began=self._began)
        altitude_m, age_s = self._altitude(found)
        ages_s = self._ages_s | dict.fromkeys(self._altimeters, age_s)
        state = replace(found.reading, consistency=consistency, altitude_m=altitude_m, ages_s=ages_s)
        return Stamped(found.stamp, state), ""

    def _broken(self, last: Stamped[Navigation], found: Stamped[Navigation]) -> bool:
        dt_s = seconds_between(last.stamp, found.stamp)
        moved_m = math.dist(_place(last.reading), _place(found.reading))
        return dt_s < 0.0 or moved_m > JUMP_m + self._fastest_mps * dt_s

    def _altitude(self, found: Stamped[Navigation]) -> tuple[float, float]:
        """Height of the body origin above the bottom [m], NaN where unknown, and the age of the range [s]."""
        if self._range is None or self._mount is None:
            return NAN, math.inf
        age_s = max(0.0, seconds_between(self._range.stamp, found.stamp))
        if age_s > ALTITUDE_AGE_s:
            return NAN, age_s
        down = matrix(found.reading.attitude_rad)[2]
        axis, lever = self._mount.axis, self._mount.lever_m
        along = (self._range.reading * a + b for a, b in zip(axis, lever, strict=True))
        return sum(part * way for part, way in zip(down, along, strict=True)), age_s


def _place(state: Navigation) -> tuple[float, float, float]:
    """North, east, depth; what is unknown is at zero [m]."""
    north, east, down = (value if math.isfinite(value) else 0.0 for value in (*state.position_m, state.depth_m))
    return (north, east, down)
