"""Readings and their messages, both ways: a row for every quantity, with an example message and what differs from it.

Nothing here makes a message object: the bytes of the example are written in place (see `serialization`), and read so.
Each row is tested against a message object that is filled field by field.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import (
    BatteryState,
    FluidPressure,
    Imu,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    Range,
    RelativeHumidity,
    Temperature,
)

from hindrax_core.events import NS_PER_S, Stamped
from hindrax_core.messages.contents import BEAMS, SENSORS, STAMP, Read, of_sensor, parts
from hindrax_core.readings import (
    Air,
    Battery,
    Beam,
    BottomTrack,
    BottomVelocity,
    Echo,
    Inertial,
    Magnetic,
    Position,
    Pressure,
    Reading,
    SonarHealth,
    Thermal,
)
from hindrax_core.rotation import xyzw_from_sname
from hindrax_core.topics import Topic
from hindrax_msgs.msg import Dvl
from hindrax_ros.messages.convert import UNKNOWN_COVARIANCE, half_turn, header
from hindrax_ros.messages.serialization import CdrWriter, Message, contents_reader

# ICM-20948 datasheet table 1 and 2: 0.015 dps/sqrt(Hz) and 230 ug/sqrt(Hz), over the noise bandwidth of a 50 Hz filter.
SIGMA_RATE_radps = math.radians(0.015) * math.sqrt(1.57 * 50.0)
SIGMA_FORCE_mps2 = 230e-6 * 9.80665 * math.sqrt(1.57 * 50.0)
SIGMA_FIELD_T = 0.3e-6
SIGMA_PRESSURE_Pa = 20.0
SIGMA_HUMIDITY = 0.03
"""BME280 data sheet, table 2: absolute accuracy."""
SIGMA_ATTITUDE_rad = math.radians(1.0)
PING_LIMITS_m = (0.3, 100.0)
PING_VIEW_rad = math.radians(25.0)
DVL_LIMITS_m = (0.15, 75.0)
DVL_VIEW_rad = math.radians(22.5)

_NO_BEAM = (*(0.0,) * 5, False)
_NOT_MOVING = (*(math.nan,) * 3, *(UNKNOWN_COVARIANCE,) * 9)
_UNKNOWN = [UNKNOWN_COVARIANCE, *[0.0] * 8]
"""Covariance of what a message of its type could hold, and this one does not (sensor_msgs/Imu)."""


class Fields(NamedTuple):
    """Kinds of readings; message in a frame with all that stays; paths of the other fields, as in the definition.

    `values` gives these from a reading, arrays flattened, None if it has no message. The way back is in `contents`.
    """

    kinds: tuple[type, ...]
    example: Callable[[str], Message]
    paths: Sequence[str]
    values: Callable[..., Sequence[object] | None]


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
    """Position by the DVL's dead reckoning; its status shows whether a GPS provides it. Its height is unknown (NaN)."""
    status = NavSatStatus(service=NavSatStatus.SERVICE_GPS)
    return NavSatFix(header=header(0, frame), status=status, altitude=math.nan)


def _detail(found: BottomVelocity, track: BottomTrack | None, sound_mps: float) -> Sequence[object]:
    """One message per velocity, also while there is none (NaN, covariance -1), with the beams of the track before.

    Laid out like marine_acoustic_msgs/Dvl: x forward, y starboard, z along the beam axis.
    """
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
        *(sum(beam.locked for beam in beams), sound_mps),
        *(any(beam.range_m is not None for beam in beams), track is not None and track.locked),
        *seen,
        *(found.confidence, found.device_us, found.interval_s),
    )


def _beam(beam: Beam) -> tuple[object, ...]:
    range_m = math.nan if beam.range_m is None else beam.range_m
    return (range_m, UNKNOWN_COVARIANCE, beam.gain_dB, beam.velocity_mps, UNKNOWN_COVARIANCE, beam.locked)


def _temperature(field: str, *kinds: type) -> Fields:
    """Temperature of the water or inside a device, which a field of the reading holds."""
    return Fields(
        kinds,
        lambda frame: Temperature(header=header(0, frame)),
        ("temperature",),
        lambda found: (getattr(found, field),),
    )


def _battery(_frame: str) -> BatteryState:
    """Supply voltage and current, which is negative while the battery discharges; NaN is what is not measured."""
    message = BatteryState(present=True)
    for name in ("temperature", "current", "charge", "capacity", "design_capacity", "percentage"):
        setattr(message, name, math.nan)
    return message


FIELDS: Mapping[str, Fields] = {
    "data_raw": Fields(
        (Inertial,),
        _inertial,
        (*parts("angular_velocity"), *parts("linear_acceleration")),
        values=lambda found: (*found.rate_radps, *found.specific_force_mps2),
    ),
    "mag": Fields(
        (Magnetic,),
        lambda frame: MagneticField(header=header(0, frame), magnetic_field_covariance=_diagonal(SIGMA_FIELD_T)),
        SENSORS["mag"].paths,
        values=lambda found: found.field_T,
    ),
    "pressure": Fields(
        (Pressure, Air),
        lambda frame: FluidPressure(header=header(0, frame), variance=SIGMA_PRESSURE_Pa**2),
        SENSORS["pressure"].paths,
        values=lambda found: (found.pressure_Pa,),
    ),
    "range": Fields(  # only confident echoes travel
        (Echo,),
        lambda frame: _range(frame, PING_LIMITS_m, PING_VIEW_rad),
        ("range",),
        values=lambda found: (found.range_m,),
    ),
    "altitude": Fields(
        (BottomTrack, Echo),
        lambda frame: _range(frame, DVL_LIMITS_m, DVL_VIEW_rad),
        ("range",),
        _altitude,
    ),
    "attitude": Fields(
        (BottomTrack,),
        _attitude,
        SENSORS["attitude"].paths,
        values=lambda found: xyzw_from_sname(found.roll_rad, found.pitch_rad, found.heading_rad),
    ),
    "velocity": Fields(
        (BottomVelocity,),
        lambda frame: TwistWithCovarianceStamped(header=header(0, frame)),
        (*parts("twist.twist.linear"), "twist.covariance"),
        _velocity,
    ),
    "detail": Fields(
        (BottomVelocity, BottomTrack),
        lambda frame: Dvl(header=header(0, frame), velocity_mode=Dvl.DVL_MODE_BOTTOM, dvl_type=Dvl.DVL_TYPE_PISTON),
        SENSORS["detail"].paths,
        values=_detail,
    ),
    "position": Fields(
        (Position,),
        _place,
        ("status.status", "latitude", "longitude"),
        values=lambda found: (
            NavSatStatus.STATUS_FIX if found.fixed else NavSatStatus.STATUS_NO_FIX,
            found.latitude_deg,
            found.longitude_deg,
        ),
    ),
    "humidity": Fields(
        (Air,),
        lambda frame: RelativeHumidity(header=header(0, frame), variance=SIGMA_HUMIDITY**2),
        ("relative_humidity",),
        values=lambda found: None if math.isnan(found.humidity) else (found.humidity,),
    ),
    "temperature": _temperature("temperature_C", Pressure, Air, Thermal),
    "die_temperature": _temperature("temperature_C", Inertial),
    "processor_temperature": _temperature("processor_C", SonarHealth),
    "board_temperature": _temperature("board_C", SonarHealth),
    "battery": Fields(
        (Battery,),
        _battery,
        ("voltage", "current"),
        values=lambda found: (found.voltage_V, -found.current_A),
    ),
    "supply": Fields((SonarHealth,), _battery, ("voltage",), lambda found: (found.supply_V,)),
}
"""By quantity of the table of topics."""


def writer(quantity: str, frame: str = "") -> Callable[..., bytes | None]:
    """Make the writer of a quantity of one sensor.

    Parameters
    ----------
    quantity
        Row of the table.
    frame
        Of its messages.

    Returns
    -------
    Callable[..., bytes | None]
        Called with a stamped reading, and with what else `values` takes: CDR bytes; None if the reading has none.
    """
    row = FIELDS[quantity]
    made = CdrWriter(*STAMP, *row.paths)
    made.learn(None, row.example(frame))

    def write(stamped: Stamped[object], *more: object) -> bytes | None:
        numbers = row.values(stamped.reading, *more)
        return None if numbers is None else made.write((*divmod(stamped.stamp, NS_PER_S), *numbers))

    return write


def reader(topic: Topic) -> Read[Reading]:
    """Make the reader of a sensor's topic.

    Parameters
    ----------
    topic
        Row of the topics table.

    Returns
    -------
    Read[Reading]
        From CDR bytes to what they hold of a reading, NaN for the rest; ValueError for bytes of another kind.
    """
    return contents_reader(topic.type, of_sensor(topic))
