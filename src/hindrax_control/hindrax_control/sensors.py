"""The sensors of a vehicle: where they sit, and which readings cannot be measurements."""

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from hindrax_core.events import Stamped
from hindrax_core.input_checks import impossible
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading, Vec3
from hindrax_core.rotation import matrix, rotate
from hindrax_core.text.refusals import Reason, Refusal, refused
from hindrax_core.vehicle import Mount, Vehicle


def altimeters(vehicle: Vehicle) -> tuple[str, ...]:
    """Sensors that the height above the bottom is taken from.

    The axis of a DVL is no beam: its altitude is a fit through four others, and comes late and rounded.

    Parameters
    ----------
    vehicle
        With its sensors.

    Returns
    -------
    tuple[str, ...]
        Names of sonars; a DVL's own altitude where there is none.
    """
    measured, with_velocity = vehicle.measuring("altitude"), vehicle.measuring("velocity")
    return tuple(name for name in measured if name not in with_velocity) or measured


def velocity_is_estimated(vehicle: Vehicle) -> bool:
    """Whether nothing on board measures a velocity, and an autopilot's estimator gives the only one."""
    measured = vehicle.measuring("velocity")
    return bool(measured) and set(measured) <= set(vehicle.on_output_line)


def without_velocity(vehicle: Vehicle) -> str:
    """Words for the absence of a velocity, by what should have one."""
    return "the autopilot's estimator claims no velocity" if velocity_is_estimated(vehicle) else "no bottom lock"


class SensorMount:
    """A mount of the vehicle file, made ready: `axis` is the sensor's z axis in body axes."""

    def __init__(self, mount: Mount) -> None:
        roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
        self._turn = matrix((roll, pitch, yaw)) if any(mount.rotation_deg) else None
        self.lever_m, self.axis = mount.position_m, self.body((0.0, 0.0, 1.0))
        self.away = any(mount.position_m)
        """Whether it sits elsewhere than at the origin of the body."""

    def body(self, vector: Vec3) -> Vec3:
        """Turn a vector of the sensor into body axes."""
        return vector if self._turn is None else rotate(self._turn, vector)


NOWHERE = SensorMount(Mount(""))
"""For a sensor that the vehicle file does not place: at the origin, not turned."""

MOST_FORCE_mps2, MOST_RATE_radps = 1e3, 1e2
"""Beyond the range of every inertial sensor that a vehicle carries (ICM-20948: 157 m/s^2 and 35 rad/s)."""
MOST_FIELD = 1e6
"""The direction alone counts: drivers of others give gauss, microtesla, or shares of the earth's field."""
LEAST_PRESSURE_Pa, MOST_PRESSURE_Pa = 5e4, 2e8
"""Air has half of its pressure at 5500 m, and the deepest sea 1.1e8 Pa; below are gauge pressures, hPa and kPa."""
FARTHEST_m, FASTEST_mps, LONGEST_S = 1e4, 1e3, 60.0


Bound: TypeAlias = tuple[str, Callable[[Any], float], float, float]
"""Checked part of a reading, its size, and the least and the largest possible one."""
BOUNDS: Mapping[type, tuple[Bound, ...]] = {
    Inertial: (
        ("force [m/s^2]", lambda one: math.hypot(*one.specific_force_mps2), 0.0, MOST_FORCE_mps2),
        ("rate [rad/s]", lambda one: math.hypot(*one.rate_radps), 0.0, MOST_RATE_radps),
    ),
    Magnetic: (("field", lambda one: math.hypot(*one.field_T), 0.0, MOST_FIELD),),
    Pressure: (("pressure [Pa]", lambda one: one.pressure_Pa, LEAST_PRESSURE_Pa, MOST_PRESSURE_Pa),),
    Echo: (("range [m]", lambda one: one.range_m, 0.0, FARTHEST_m),),
    BottomVelocity: (
        ("speed [m/s]", lambda one: math.hypot(*(one.velocity_mps or ())), 0.0, FASTEST_mps),
        ("deviation [m/s]", lambda one: one.sigma_mps, 0.0, FASTEST_mps),
        ("interval [s]", lambda one: one.interval_s, 0.0, LONGEST_S),
    ),
    BottomTrack: (("altitude [m]", lambda one: one.altitude_m or 0.0, 0.0, FARTHEST_m),),
}


def why_impossible(stamped: Stamped[Reading]) -> Refusal:
    """Return why a reading is impossible (`IMPOSSIBLE`, `NO_TIME`), or nothing. The filters judge implausible ones."""
    reading = stamped.reading
    for what, size_of, least, most in BOUNDS.get(type(reading), ()):
        size = size_of(reading)
        if not least <= size <= most:  # nor is NaN
            return refused(Reason.IMPOSSIBLE, what=what, found=size, low=least, high=most, unit="")
    return impossible(stamped.stamp)
