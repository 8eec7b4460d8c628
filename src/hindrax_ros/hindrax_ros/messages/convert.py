"""Conversion between our readings and ROS messages, both ways; holds the table of signs.

Inside, everything is SNAME (x forward, y starboard, z down). Outside, bodies and sensors are REP-103 (x forward, y
left, z up), the world is east, north, up (REP-105).

| quantity | inside | message |
|---|---|---|
| vector in a body or DVL frame | (x, y, z) | (x, -y, -z) |
| roll, pitch, yaw | phi, theta, psi (clockwise from north) | phi, -theta, pi/2 - psi |
| position | north, east, depth | east, north, -depth |
| ICM-20948 vectors | axes of the chip | axes of the chip, frame `icm20948_link` (REP-145) |
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion as QuaternionMsg
from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3, WrenchStamped
from nav_msgs.msg import Odometry
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

from hindrax_core.events import NS_PER_S, Stamp, Stamped
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
    Vec3,
    Vec6,
)
from hindrax_core.rotation import FLU, FSD, wrapped
from hindrax_core.signals import Consistency, Estimate, Navigation
from hindrax_msgs.msg import Dvl, DvlBeam, ModelEstimate, NavigationStatus

UNKNOWN_COVARIANCE = -1.0
UNIT = 0.01
"""Largest error of the length of an orientation."""


def stamp_to_msg(stamp: int) -> Time:
    """ROS time message of a stamp."""
    seconds, nanoseconds = divmod(int(stamp), NS_PER_S)
    return Time(sec=seconds, nanosec=nanoseconds)


def stamp_from_msg(time: Time) -> Stamp:
    """Stamp of a ROS time message."""
    return Stamp(time.sec * NS_PER_S + time.nanosec)


def half_turn(vector: Sequence[float]) -> Vec3:
    """Turn a vector half way about x: from forward-starboard-down to forward-left-up, and back."""
    return (vector[0], -vector[1], -vector[2])


def _vector(vector: Sequence[float]) -> Vector3:
    return Vector3(x=float(vector[0]), y=float(vector[1]), z=float(vector[2]))


def _plain(vector: Vector3) -> Vec3:
    return (vector.x, vector.y, vector.z)


def _diagonal(variance: float) -> list[float]:
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def inertial_to_msg(stamped: Stamped[Inertial], frame: str, sigma_force: float, sigma_rate: float) -> Imu:
    """REP-145 `data_raw`: no orientation; sigmas in m/s^2 and rad/s."""
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    message.orientation_covariance[0] = UNKNOWN_COVARIANCE
    message.linear_acceleration = _vector(stamped.reading.specific_force_mps2)
    message.angular_velocity = _vector(stamped.reading.rate_radps)
    message.linear_acceleration_covariance = _diagonal(sigma_force * sigma_force)
    message.angular_velocity_covariance = _diagonal(sigma_rate * sigma_rate)
    return message


def magnetic_to_msg(stamped: Stamped[Magnetic], frame: str, sigma_T: float) -> MagneticField:
    """Magnetic field in the axes of the inertial sensor."""
    message = MagneticField(magnetic_field=_vector(stamped.reading.field_T))
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    message.magnetic_field_covariance = _diagonal(sigma_T * sigma_T)
    return message


def pressure_to_msg(stamped: Stamped[Pressure | Air], frame: str, sigma_Pa: float) -> FluidPressure:
    """Absolute pressure."""
    message = FluidPressure(fluid_pressure=stamped.reading.pressure_Pa, variance=sigma_Pa * sigma_Pa)
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    return message


def pressure_from_msg(message: FluidPressure) -> Stamped[Pressure]:
    """Undo `pressure_to_msg`; the temperature travels on its own topic."""
    return Stamped(stamp_from_msg(message.header.stamp), Pressure(message.fluid_pressure, math.nan))


def temperature_to_msg(stamp: Stamp, temperature_C: float, frame: str) -> Temperature:
    """Temperature of the water or inside a device."""
    message = Temperature(temperature=temperature_C, variance=0.0)
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamp), frame
    return message


def position_to_msg(stamped: Stamped[Position], frame: str) -> NavSatFix:
    """Place that the DVL reckons; its status says whether a GPS gives it at the moment. Its height is unknown (NaN)."""
    place = stamped.reading
    message = NavSatFix(latitude=place.latitude_deg, longitude=place.longitude_deg, altitude=math.nan)
    message.status.status = NavSatStatus.STATUS_FIX if place.fixed else NavSatStatus.STATUS_NO_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    return message


def humidity_to_msg(stamped: Stamped[Air], frame: str, sigma: float) -> RelativeHumidity | None:
    """Relative humidity, 0 to 1; None where the part measures none."""
    if math.isnan(stamped.reading.humidity):
        return None
    message = RelativeHumidity(relative_humidity=stamped.reading.humidity, variance=sigma * sigma)
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    return message


def battery_to_msg(stamped: Stamped[Battery]) -> BatteryState:
    """Supply voltage and current, which is negative while the battery discharges; NaN is what nobody measures."""
    unknown = dict.fromkeys(("temperature", "charge", "capacity", "design_capacity", "percentage"), math.nan)
    found = stamped.reading
    message = BatteryState(voltage=found.voltage_V, current=-found.current_A, present=True, **unknown)
    message.header.stamp = stamp_to_msg(stamped.stamp)
    return message


def echo_to_msg(stamped: Stamped[Echo], frame: str, limits_m: tuple[float, float], view_rad: float) -> Range:
    """Distance along the beam; the frame's x axis is the beam (sensor_msgs/Range)."""
    message = Range(
        radiation_type=Range.ULTRASOUND,
        field_of_view=view_rad,
        min_range=limits_m[0],
        max_range=limits_m[1],
        range=stamped.reading.range_m,
    )
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    return message


def velocity_to_msg(stamped: Stamped[BottomVelocity], frame: str) -> TwistWithCovarianceStamped | None:
    """Velocity over ground in the DVL frame, REP-103; None while there is none. Angular rates are unknown."""
    velocity = stamped.reading.velocity_mps
    if velocity is None:
        return None
    message = TwistWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    message.twist.twist.linear = _vector(half_turn(velocity))
    variance = stamped.reading.sigma_mps**2
    for axis in range(3):
        message.twist.covariance[7 * axis] = variance
        message.twist.covariance[7 * (axis + 3)] = UNKNOWN_COVARIANCE
    return message


def quaternion_from_sname(roll: float, pitch: float, yaw: float) -> QuaternionMsg:
    """Orientation of the REP-103 body in east, north, up, from SNAME angles."""
    x, y, z, w = xyzw_from_sname(roll, pitch, yaw)
    return QuaternionMsg(x=x, y=y, z=z, w=w)


def xyzw_from_sname(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Numbers of `quaternion_from_sname`."""
    return xyzw(roll, -pitch, math.pi / 2.0 - yaw)


def xyzw(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Quaternion of a z-y-x rotation."""
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def sname_from_quaternion(q: QuaternionMsg) -> Vec3:
    """SNAME roll, pitch, yaw of a REP-103 body in east, north, up."""
    return sname_from_xyzw(q.x, q.y, q.z, q.w)


def sname_from_xyzw(x: float, y: float, z: float, w: float) -> Vec3:
    """`sname_from_quaternion` from numbers."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (roll, -pitch, wrapped(math.pi / 2.0 - yaw))


def attitude_to_msg(stamped: Stamped[BottomTrack], frame: str, sigma_rad: float) -> Imu:
    """Attitude of the DVL's own IMU; rates and accelerations are unknown."""
    track = stamped.reading
    message = Imu(orientation=quaternion_from_sname(track.roll_rad, track.pitch_rad, track.heading_rad))
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
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
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), frame
    message.confidence, message.interval = velocity.confidence, velocity.interval_s
    message.device_time = velocity.device_us
    message.velocity = _vector(velocity.velocity_mps or (math.nan, math.nan, math.nan))
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


def dvl_from_msg(message: Dvl) -> Stamped[BottomVelocity]:
    """Velocity of `dvl_to_msg`, with its interval; None where there was none."""
    variance = message.velocity_covar[0]
    velocity = None if variance < 0.0 else _plain(message.velocity)
    reading = BottomVelocity(
        velocity, math.sqrt(max(0.0, variance)), message.confidence, message.interval, int(message.device_time)
    )
    return Stamped(stamp_from_msg(message.header.stamp), reading)


def _beam(range_m: float | None, velocity_mps: float, gain_dB: float, locked: bool) -> DvlBeam:
    return DvlBeam(
        range=math.nan if range_m is None else range_m,
        range_covar=UNKNOWN_COVARIANCE,
        velocity=velocity_mps,
        velocity_covar=UNKNOWN_COVARIANCE,
        quality=gain_dB,
        locked=locked,
    )


def odometry_to_msg(stamped: Stamped[Navigation]) -> Odometry:
    """Pose in `odom` (east, north, up from the start), twist in `base_link` (REP-105).

    Variances: of the velocities, and of east and north since the position was last known; NaN where unknown.
    """
    state = stamped.reading
    message = Odometry(child_frame_id=FLU)
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), "odom"
    north, east = state.position_m
    position = message.pose.pose.position
    position.x, position.y, position.z = east, north, -state.depth_m
    message.pose.pose.orientation = quaternion_from_sname(*state.attitude_rad)
    message.twist.twist.linear = _vector(half_turn(state.velocity_mps))
    message.twist.twist.angular = _vector(half_turn(state.rate_radps))
    for axis, sigma in enumerate(state.velocity_sigma_mps):
        message.twist.covariance[7 * axis] = sigma * sigma
    message.pose.covariance[0] = message.pose.covariance[7] = state.position_sigma_m**2
    return message


def odometry_from_msg(message: Odometry) -> Stamped[Navigation]:
    """State in anybody's odometry of `base_link` in a world with z up, as REP-105 has it; z = 0 is the surface.

    ValueError for other frames and for what is no orientation. A variance of zero or less means that it is not told.
    """
    world, body = message.header.frame_id, message.child_frame_id
    if body.rpartition("/")[2] != FLU or not world or world.lower().endswith("ned"):
        raise ValueError(f"found {body[:40]!r} in {world[:40]!r}, wanted {FLU!r} in a world with z up, such as 'odom'")
    q, position, twist = message.pose.pose.orientation, message.pose.pose.position, message.twist.twist
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(length - 1.0) <= UNIT:
        raise ValueError(f"found an orientation of length {length:g}, wanted 1")
    sigma = [_sigma(variance) for variance in message.twist.covariance[::7]]
    tilt_variances = (message.pose.covariance[21], message.pose.covariance[28])
    velocity_mps = half_turn(_plain(twist.linear))
    state = Navigation(
        attitude_rad=sname_from_quaternion(q),
        rate_radps=half_turn(_plain(twist.angular)),
        velocity_mps=velocity_mps,
        depth_m=-position.z,
        altitude_m=math.nan,
        position_m=(position.y, position.x),
        dvl_locked=all(map(math.isfinite, velocity_mps)),
        velocity_sigma_mps=(sigma[0], sigma[1], sigma[2]),
        consistency=Consistency(tilt_sigma_rad=math.sqrt(max(0.0, *tilt_variances))),
        position_sigma_m=max(map(_sigma, message.pose.covariance[:8:7])),
    )
    return Stamped(stamp_from_msg(message.header.stamp), state)


def _sigma(variance: float) -> float:
    return math.sqrt(variance) if variance > 0.0 else math.nan


def navigation_to_msg(stamped: Stamped[Navigation]) -> NavigationStatus:
    """Full navigation state, SNAME; undone by `navigation_from_msg`."""
    state = stamped.reading
    ages = state.ages_s
    message = NavigationStatus()
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), FSD
    message.roll, message.pitch, message.heading = state.attitude_rad
    message.roll_rate, message.pitch_rate, message.yaw_rate = state.rate_radps
    message.surge_velocity, message.sway_velocity, message.heave_velocity = state.velocity_mps
    sigmas = state.velocity_sigma_mps
    message.surge_velocity_sigma, message.sway_velocity_sigma, message.heave_velocity_sigma = sigmas
    message.depth, message.altitude = state.depth_m, state.altitude_m
    message.position_north, message.position_east = state.position_m
    message.dvl_locked = state.dvl_locked
    message.depth_age = ages.get("ms5837", math.inf)
    message.altitude_age = ages.get("ping1d", math.inf)
    message.heave_velocity_age = min(message.depth_age, message.altitude_age)
    message.depth_valid = math.isfinite(state.depth_m)
    message.altitude_valid = math.isfinite(state.altitude_m)
    message.heave_velocity_valid = math.isfinite(state.velocity_mps[2])
    message.sources, message.ages = list(ages), list(ages.values())
    return message


def navigation_from_msg(message: NavigationStatus) -> Stamped[Navigation]:
    """Undo `navigation_to_msg`."""
    state = Navigation(
        attitude_rad=(message.roll, message.pitch, message.heading),
        rate_radps=(message.roll_rate, message.pitch_rate, message.yaw_rate),
        velocity_mps=(message.surge_velocity, message.sway_velocity, message.heave_velocity),
        depth_m=message.depth,
        altitude_m=message.altitude,
        position_m=(message.position_north, message.position_east),
        dvl_locked=message.dvl_locked,
        ages_s=dict(zip(message.sources, message.ages, strict=True)),
        velocity_sigma_mps=(
            message.surge_velocity_sigma,
            message.sway_velocity_sigma,
            message.heave_velocity_sigma,
        ),
    )
    return Stamped(stamp_from_msg(message.header.stamp), state)


def wrench_to_msg(stamp: Stamp, wrench: Vec6) -> WrenchStamped:
    """Wrench in the SNAME body frame."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamp), FSD
    message.wrench.force = _vector(wrench[:3])
    message.wrench.torque = _vector(wrench[3:])
    return message


def wrench_from_msg(message: WrenchStamped) -> Vec6:
    """Six numbers in whatever frame the header names."""
    return (*_plain(message.wrench.force), *_plain(message.wrench.torque))


def estimate_to_msg(stamped: Stamped[Estimate]) -> ModelEstimate:
    """Coefficients and covariance of one motion."""
    estimate = stamped.reading
    message = ModelEstimate(
        motion=estimate.motion,
        names=list(estimate.names),
        units=list(estimate.units),
        values=list(estimate.values),
        covariance=[entry for row in estimate.covariance for entry in row],
        samples=estimate.samples,
        effective_samples=estimate.effective_samples,
        state="learning" if estimate.learning else "holding",
        reason=estimate.reason,
        last_innovation=estimate.innovation,
    )
    message.header.stamp, message.header.frame_id = stamp_to_msg(stamped.stamp), FSD
    return message


def estimate_from_msg(message: ModelEstimate) -> Stamped[Estimate]:
    """Undo `estimate_to_msg`."""
    n = len(message.values)
    flat = list(message.covariance)
    estimate = Estimate(
        motion=message.motion,
        names=tuple(message.names),
        units=tuple(message.units),
        values=tuple(message.values),
        covariance=tuple(tuple(flat[row * n : row * n + n]) for row in range(n)),
        samples=message.samples,
        effective_samples=message.effective_samples,
        learning=message.state == "learning",
        reason=message.reason,
        innovation=message.last_innovation,
    )
    return Stamped(stamp_from_msg(message.header.stamp), estimate)
