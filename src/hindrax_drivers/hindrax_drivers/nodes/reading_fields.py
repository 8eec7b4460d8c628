"""Messages of readings at 20 Hz and more, which `in_place` writes: an example each, and what differs from it."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import FluidPressure, Imu, MagneticField, NavSatFix, NavSatStatus, Range

from hindrax_core.events import Stamped
from hindrax_core.readings import (
    Air,
    Beam,
    BottomTrack,
    BottomVelocity,
    Echo,
    Inertial,
    Magnetic,
    Position,
    Pressure,
)
from hindrax_msgs.msg import Dvl
from hindrax_ros.messages.convert import UNKNOWN_COVARIANCE, half_turn, header, xyzw_from_sname
from hindrax_ros.messages.fast_serialization import in_place

# ICM-20948 datasheet table 1 and 2: 0.015 dps/sqrt(Hz) and 230 ug/sqrt(Hz), over the noise bandwidth of a 50 Hz filter.
SIGMA_RATE_radps = math.radians(0.015) * math.sqrt(1.57 * 50.0)
SIGMA_FORCE_mps2 = 230e-6 * 9.80665 * math.sqrt(1.57 * 50.0)
SIGMA_FIELD_T = 0.3e-6
SIGMA_PRESSURE_Pa = 20.0
SIGMA_ATTITUDE_rad = math.radians(1.0)
PING_LIMITS_m = (0.3, 100.0)
PING_VIEW_rad = math.radians(25.0)
DVL_LIMITS_m = (0.15, 75.0)
DVL_VIEW_rad = math.radians(22.5)

BEAMS = 4
_NO_BEAM = (*(0.0,) * 5, False)
_NOT_MOVING = (*(math.nan,) * 3, *(UNKNOWN_COVARIANCE,) * 9)
_UNKNOWN = [UNKNOWN_COVARIANCE, *[0.0] * 8]
"""Covariance of what a message of its type could hold, and this one does not (sensor_msgs/Imu)."""


Fields: TypeAlias = tuple[tuple[type, ...], Callable[[str], Any], Sequence[str], Callable[..., Sequence[Any] | None]]
"""Kinds of readings; message in a frame with all that stays; paths of the other fields in the order of the definition;
their values from a reading, arrays flattened, None if it has no message."""


def _of(path: str, names: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{path}.{name}" for name in names)


def _diagonal(sigma: float) -> list[float]:
    variance = sigma * sigma
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def _inertial(frame: str) -> Imu:
    """REP-145 `data_raw`: no orientation; vectors in the axes of the chip [rad/s, m/s^2]."""
    return Imu(
        header=header(0, frame),
        orientation_covariance=_UNKNOWN,
        angular_velocity_covariance=_diagonal(SIGMA_RATE_radps),
        linear_acceleration_covariance=_diagonal(SIGMA_FORCE_mps2),
    )


def _attitude(frame: str) -> Imu:
    """Attitude of the DVL's own IMU; rates and accelerations are unknown."""
    return Imu(
        header=header(0, frame),
        orientation_covariance=_diagonal(SIGMA_ATTITUDE_rad),
        angular_velocity_covariance=_UNKNOWN,
        linear_acceleration_covariance=_UNKNOWN,
    )


def _range(frame: str, limits_m: tuple[float, float], view_rad: float) -> Range:
    """Distance along the beam; the frame's x axis is the beam (sensor_msgs/Range)."""
    ends = dict(zip(("min_range", "max_range"), limits_m, strict=True))
    return Range(header=header(0, frame), radiation_type=Range.ULTRASOUND, field_of_view=view_rad, **ends)


def _altitude(found: BottomTrack | Echo) -> Sequence[float] | None:
    """A DVL-75 reports the altitude with its attitude, a Tracker 650 as an echo of its own."""
    altitude_m = found.range_m if isinstance(found, Echo) else found.altitude_m
    return None if altitude_m is None else (altitude_m,)


def _velocity(found: BottomVelocity) -> Sequence[float] | None:
    """Velocity over ground in the DVL frame, REP-103; None while there is none. Angular rates are unknown."""
    if found.velocity_mps is None:
        return None
    covariance = [0.0] * 36
    covariance[:21:7] = [found.sigma_mps**2] * 3
    covariance[21::7] = [UNKNOWN_COVARIANCE] * 3
    return (*half_turn(found.velocity_mps), *covariance)


def _place(frame: str) -> NavSatFix:
    """Place that the DVL reckons; its status says whether a GPS gives it at the moment. Its height is unknown (NaN)."""
    status = NavSatStatus(service=NavSatStatus.SERVICE_GPS)
    return NavSatFix(header=header(0, frame), status=status, altitude=math.nan)


def _detail(found: BottomVelocity, track: BottomTrack | None) -> Sequence[Any]:
    """One message per velocity, also while there is none (NaN, covariance -1), with the beams of the track before."""
    moving: Sequence[float] = _NOT_MOVING
    course_rad = speed_mps = 0.0
    if found.velocity_mps is not None:
        u, v, w = found.velocity_mps
        moving = (u, v, w, *_diagonal(found.sigma_mps))
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
        (Inertial,),
        _inertial,
        (*_of("angular_velocity"), *_of("linear_acceleration")),
        lambda found: (*found.rate_radps, *found.specific_force_mps2),
    ),
    "mag": (
        (Magnetic,),
        lambda frame: MagneticField(header=header(0, frame), magnetic_field_covariance=_diagonal(SIGMA_FIELD_T)),
        _of("magnetic_field"),
        lambda found: found.field_T,
    ),
    "pressure": (
        (Pressure, Air),
        lambda frame: FluidPressure(header=header(0, frame), variance=SIGMA_PRESSURE_Pa**2),
        ("fluid_pressure",),
        lambda found: (found.pressure_Pa,),
    ),
    "range": (
        (Echo,),
        lambda frame: _range(frame, PING_LIMITS_m, PING_VIEW_rad),
        ("range",),
        lambda found: (found.range_m,),
    ),
    "altitude": ((BottomTrack, Echo), lambda frame: _range(frame, DVL_LIMITS_m, DVL_VIEW_rad), ("range",), _altitude),
    "attitude": (
        (BottomTrack,),
        _attitude,
        _of("orientation", "xyzw"),
        lambda found: xyzw_from_sname(found.roll_rad, found.pitch_rad, found.heading_rad),
    ),
    "velocity": (
        (BottomVelocity,),
        lambda frame: TwistWithCovarianceStamped(header=header(0, frame)),
        (*_of("twist.twist.linear"), "twist.covariance"),
        _velocity,
    ),
    "position": (
        (Position,),
        _place,
        ("status.status", "latitude", "longitude"),
        lambda found: (
            NavSatStatus.STATUS_FIX if found.fixed else NavSatStatus.STATUS_NO_FIX,
            found.latitude_deg,
            found.longitude_deg,
        ),
    ),
}
"""By quantity; the DVL's detail is made by itself."""


def detail_writer(frame: str, sound_mps: float) -> Callable[[Stamped[BottomVelocity], BottomTrack | None], Any]:
    """Make the writer of the full DVL reading, as bytes, of a velocity and the track before it.

    Laid out like marine_acoustic_msgs/Dvl: x forward, y starboard, z along the beam axis.
    """
    example = Dvl(velocity_mode=Dvl.DVL_MODE_BOTTOM, dvl_type=Dvl.DVL_TYPE_PISTON, sound_speed=sound_mps)
    example.header = header(0, frame)
    paths = (
        *(*_of("velocity"), "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
        *("num_good_beams", "beam_ranges_valid", "beam_velocities_valid"),
        *(f"beams.{index}.{name}" for index in range(BEAMS) for name in _BEAM),
        *("confidence", "device_time", "interval"),
    )
    return in_place(example, paths, _detail)
