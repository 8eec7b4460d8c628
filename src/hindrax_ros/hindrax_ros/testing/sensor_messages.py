"""Messages of readings, field by field, against which the bytes of `reading_fields` and their readers are held."""

import math

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

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import (
    Air,
    Battery,
    BottomTrack,
    BottomVelocity,
    Echo,
    Inertial,
    Magnetic,
    Position,
    Pressure,
)
from hindrax_msgs.msg import Dvl, DvlBeam
from hindrax_ros.messages.convert import (
    UNKNOWN_COVARIANCE,
    half_turn,
    header,
    quaternion_from_sname,
    stamp_from_msg,
    vector_to_msg,
)


def _diagonal(variance: float) -> list[float]:
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def inertial_to_msg(stamped: Stamped[Inertial], frame: str, sigma_force: float, sigma_rate: float) -> Imu:
    """REP-145 `data_raw`: no orientation; sigmas in m/s^2 and rad/s."""
    message = Imu(header=header(stamped.stamp, frame))
    message.orientation_covariance[0] = UNKNOWN_COVARIANCE
    message.linear_acceleration = vector_to_msg(stamped.reading.specific_force_mps2)
    message.angular_velocity = vector_to_msg(stamped.reading.rate_radps)
    message.linear_acceleration_covariance = _diagonal(sigma_force * sigma_force)
    message.angular_velocity_covariance = _diagonal(sigma_rate * sigma_rate)
    return message


def magnetic_to_msg(stamped: Stamped[Magnetic], frame: str, sigma_T: float) -> MagneticField:
    """Magnetic field in the axes of the inertial sensor."""
    message = MagneticField(header=header(stamped.stamp, frame), magnetic_field=vector_to_msg(stamped.reading.field_T))
    message.magnetic_field_covariance = _diagonal(sigma_T * sigma_T)
    return message


def pressure_to_msg(stamped: Stamped[Pressure | Air], frame: str, sigma_Pa: float) -> FluidPressure:
    """Absolute pressure."""
    pressure_Pa, variance = stamped.reading.pressure_Pa, sigma_Pa * sigma_Pa
    return FluidPressure(header=header(stamped.stamp, frame), fluid_pressure=pressure_Pa, variance=variance)


def position_to_msg(stamped: Stamped[Position], frame: str) -> NavSatFix:
    """Place that the DVL reckons; its status says whether a GPS gives it at the moment. Its height is unknown (NaN)."""
    place = stamped.reading
    status = NavSatStatus.STATUS_FIX if place.fixed else NavSatStatus.STATUS_NO_FIX
    return NavSatFix(
        header=header(stamped.stamp, frame),
        status=NavSatStatus(status=status, service=NavSatStatus.SERVICE_GPS),
        latitude=place.latitude_deg,
        longitude=place.longitude_deg,
        altitude=math.nan,
    )


def velocity_to_msg(stamped: Stamped[BottomVelocity], frame: str) -> TwistWithCovarianceStamped | None:
    """Velocity over ground in the DVL frame, REP-103; None while there is none. Angular rates are unknown."""
    velocity = stamped.reading.velocity_mps
    if velocity is None:
        return None
    message = TwistWithCovarianceStamped(header=header(stamped.stamp, frame))
    message.twist.twist.linear = vector_to_msg(half_turn(velocity))
    variance = stamped.reading.sigma_mps**2
    for axis in range(3):
        message.twist.covariance[7 * axis] = variance
        message.twist.covariance[7 * (axis + 3)] = UNKNOWN_COVARIANCE
    return message


def attitude_to_msg(stamped: Stamped[BottomTrack], frame: str, sigma_rad: float) -> Imu:
    """Attitude of the DVL's own IMU; rates and accelerations are unknown."""
    track = stamped.reading
    orientation = quaternion_from_sname(track.roll_rad, track.pitch_rad, track.heading_rad)
    message = Imu(header=header(stamped.stamp, frame), orientation=orientation)
    message.orientation_covariance = _diagonal(sigma_rad * sigma_rad)
    message.angular_velocity_covariance[0] = UNKNOWN_COVARIANCE
    message.linear_acceleration_covariance[0] = UNKNOWN_COVARIANCE
    return message


def dvl_to_msg(stamped: Stamped[BottomVelocity], track: BottomTrack | None, frame: str, sound_mps: float) -> Dvl:
    """Full DVL reading, laid out like marine_acoustic_msgs/Dvl (x forward, y starboard, z along the beam axis).

    One message per velocity, also while there is none (NaN, covariance -1), with the latest beams.
    """
    velocity = stamped.reading
    message = Dvl(velocity_mode=Dvl.DVL_MODE_BOTTOM, dvl_type=Dvl.DVL_TYPE_PISTON, sound_speed=sound_mps)
    message.header = header(stamped.stamp, frame)
    message.confidence, message.interval = velocity.confidence, velocity.interval_s
    message.device_time = velocity.device_us
    message.velocity = vector_to_msg(velocity.velocity_mps or (math.nan, math.nan, math.nan))
    message.velocity_covar = [UNKNOWN_COVARIANCE] * 9
    message.altitude = math.nan
    if velocity.velocity_mps is not None:
        u, v, _ = velocity.velocity_mps
        message.velocity_covar = _diagonal(velocity.sigma_mps**2)
        message.course_gnd, message.speed_gnd = math.atan2(v, u), math.hypot(u, v)
    if track is not None:
        _add_track(message, track)
    return message


def _add_track(message: Dvl, track: BottomTrack) -> None:
    message.altitude = math.nan if track.altitude_m is None else track.altitude_m
    message.num_good_beams = sum(beam.locked for beam in track.beams)
    message.beam_ranges_valid = any(beam.range_m is not None for beam in track.beams)
    message.beam_velocities_valid = track.locked
    if len(track.beams) == len(message.beams):
        message.beams = [_beam(beam.range_m, beam.velocity_mps, beam.gain_dB, beam.locked) for beam in track.beams]


def _beam(range_m: float | None, velocity_mps: float, gain_dB: float, locked: bool) -> DvlBeam:
    return DvlBeam(
        range=math.nan if range_m is None else range_m,
        range_covar=UNKNOWN_COVARIANCE,
        velocity=velocity_mps,
        velocity_covar=UNKNOWN_COVARIANCE,
        quality=gain_dB,
        locked=locked,
    )


def echo_to_msg(stamped: Stamped[Echo], frame: str, limits_m: tuple[float, float], view_rad: float) -> Range:
    """Distance along the beam; the frame's x axis is the beam (sensor_msgs/Range)."""
    return Range(
        header=header(stamped.stamp, frame),
        radiation_type=Range.ULTRASOUND,
        field_of_view=view_rad,
        min_range=limits_m[0],
        max_range=limits_m[1],
        range=stamped.reading.range_m,
    )


def pressure_from_msg(message: FluidPressure) -> Stamped[Pressure]:
    """Absolute pressure; the temperature travels on its own topic."""
    return Stamped(stamp_from_msg(message.header.stamp), Pressure(message.fluid_pressure, math.nan))


def dvl_from_msg(message: Dvl) -> Stamped[BottomVelocity]:
    """Velocity over ground in the DVL frame with its interval; None where there was none."""
    variance = message.velocity_covar[0]
    velocity = None if variance < 0.0 else (message.velocity.x, message.velocity.y, message.velocity.z)
    reading = BottomVelocity(
        velocity, math.sqrt(max(0.0, variance)), message.confidence, message.interval, int(message.device_time)
    )
    return Stamped(stamp_from_msg(message.header.stamp), reading)


def temperature_to_msg(stamp: Stamp, temperature_C: float, frame: str) -> Temperature:
    """Temperature of the water or inside a device."""
    return Temperature(header=header(stamp, frame), temperature=temperature_C, variance=0.0)


def humidity_to_msg(stamped: Stamped[Air], frame: str, sigma: float) -> RelativeHumidity | None:
    """Relative humidity, 0 to 1; None where the part measures none."""
    humidity, variance = stamped.reading.humidity, sigma * sigma
    if math.isnan(humidity):
        return None
    return RelativeHumidity(header=header(stamped.stamp, frame), relative_humidity=humidity, variance=variance)


def battery_to_msg(stamped: Stamped[Battery]) -> BatteryState:
    """Supply voltage and current, which is negative while the battery discharges; NaN is what nobody measures."""
    voltage, current = stamped.reading.voltage_V, -stamped.reading.current_A
    message = BatteryState(header=header(stamped.stamp), voltage=voltage, current=current, present=True)
    for unknown in ("temperature", "charge", "capacity", "design_capacity", "percentage"):
        setattr(message, unknown, math.nan)
    return message
