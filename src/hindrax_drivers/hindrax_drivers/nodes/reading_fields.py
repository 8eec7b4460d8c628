"""The fields in which the messages of one topic of a sensor differ, and their values: what `in_place` writes.

The rest is as in the first message that `reading_messages` makes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from hindrax_core.readings import Beam, BottomTrack, BottomVelocity, Echo
from hindrax_ros.messages.convert import UNKNOWN_COVARIANCE, gps_status, half_turn, xyzw_from_sname

Fields: TypeAlias = tuple[Sequence[str], Callable[..., Sequence[Any] | None]]
"""Paths in the order of the definition; their values from a reading, arrays flattened, None if it has no message."""

BEAMS = 4
_NO_BEAM = (*(0.0,) * 5, False)
_NOT_MOVING = (*(math.nan,) * 3, *(UNKNOWN_COVARIANCE,) * 9)


def _of(path: str, names: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{path}.{name}" for name in names)


def _altitude(found: BottomTrack | Echo) -> Sequence[float] | None:
    altitude_m = found.range_m if isinstance(found, Echo) else found.altitude_m
    return None if altitude_m is None else (altitude_m,)


def _velocity(found: BottomVelocity) -> Sequence[float] | None:
    if found.velocity_mps is None:
        return None
    covariance = [0.0] * 36
    covariance[:21:7] = [found.sigma_mps**2] * 3
    covariance[21::7] = [UNKNOWN_COVARIANCE] * 3
    return (*half_turn(found.velocity_mps), *covariance)


def _detail(found: BottomVelocity, track: BottomTrack | None) -> Sequence[Any]:
    moving, course_rad, speed_mps = _NOT_MOVING, 0.0, 0.0
    if found.velocity_mps is not None:
        u, v, w = found.velocity_mps
        variance = found.sigma_mps**2
        moving = (u, v, w, variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)
        course_rad, speed_mps = math.atan2(v, u), math.hypot(u, v)
    altitude_m = None if track is None else track.altitude_m
    beams = () if track is None else track.beams
    seen = [number for beam in beams for number in _beam(beam)] if len(beams) == BEAMS else BEAMS * _NO_BEAM
    return (
        *moving,
        *(math.nan if altitude_m is None else altitude_m, course_rad, speed_mps),
        *(sum(beam.locked for beam in beams), any(beam.range_m is not None for beam in beams)),
        track is not None and track.locked,
        *seen,
        *(found.confidence, found.device_us, found.interval_s),
    )


def _beam(beam: Beam) -> tuple[Any, ...]:
    range_m = math.nan if beam.range_m is None else beam.range_m
    return (range_m, UNKNOWN_COVARIANCE, beam.gain_dB, beam.velocity_mps, UNKNOWN_COVARIANCE, beam.locked)


_BEAM = ("range", "range_covar", "quality", "velocity", "velocity_covar", "locked")
FIELDS: Mapping[str, Fields] = {
    "data_raw": (
        (*_of("angular_velocity"), *_of("linear_acceleration")),
        lambda found: (*found.rate_radps, *found.specific_force_mps2),
    ),
    "mag": (_of("magnetic_field"), lambda found: found.field_T),
    "pressure": (("fluid_pressure",), lambda found: (found.pressure_Pa,)),
    "range": (("range",), lambda found: (found.range_m,)),
    "altitude": (("range",), _altitude),
    "attitude": (
        _of("orientation", "xyzw"),
        lambda found: xyzw_from_sname(found.roll_rad, found.pitch_rad, found.heading_rad),
    ),
    "velocity": ((*_of("twist.twist.linear"), "twist.covariance"), _velocity),
    "position": (
        ("status.status", "latitude", "longitude"),
        lambda found: (gps_status(found), found.latitude_deg, found.longitude_deg),
    ),
}
"""By quantity, those that come at 20 Hz and more."""
DETAIL: Fields = (
    (
        *(*_of("velocity"), "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
        *("num_good_beams", "beam_ranges_valid", "beam_velocities_valid"),
        *(f"beams.{index}.{name}" for index in range(BEAMS) for name in _BEAM),
        *("confidence", "device_time", "interval"),
    ),
    _detail,
)
"""Of a velocity and the track before it."""
