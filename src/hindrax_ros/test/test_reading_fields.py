"""Readings written in place against the message objects of the same readings."""

import math
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from geometry_msgs.msg import TwistWithCovarianceStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, NavSatFix

from hindrax_core.events import Stamp, Stamped
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
    Vec3,
)
from hindrax_core.topics import ALTITUDE, DVL_ATTITUDE, DVL_DETAIL, IMU, MAGNETIC, PRESSURE
from hindrax_msgs.msg import Dvl
from hindrax_ros.messages import reading_fields
from hindrax_ros.messages.reading_fields import FIELDS, reader, writer
from hindrax_ros.testing import sensor_messages

number = st.floats(width=32, allow_nan=False)
three = st.tuples(*[number] * 3)
maybe = st.none() | number
beams = st.lists(st.builds(Beam, st.booleans(), number, maybe, number), min_size=4, max_size=4).map(tuple)
tracks = st.builds(
    BottomTrack,
    *(st.booleans(), *[st.floats(-3, 3)] * 3, maybe, st.just((0.0, 0.0)), beams | st.just(())),
    *(st.just(""), st.just(0)),
)
speeds = st.builds(BottomVelocity, st.none() | three, st.floats(0, 1e3), number, number, st.integers(0, 2**63))
READINGS = {
    Inertial: st.builds(Inertial, three, three, number),
    Magnetic: st.builds(Magnetic, three),
    Pressure: st.builds(Pressure, number, number),
    Thermal: st.builds(Thermal, number),
    Air: st.builds(Air, number, number, number),
    Echo: st.builds(Echo, number, number),
    BottomTrack: tracks,
    BottomVelocity: speeds,
    Position: st.builds(Position, number, number, st.booleans()),
    Battery: st.builds(Battery, number, number | st.just(math.nan)),
    SonarHealth: st.builds(SonarHealth, st.none(), number, number, number),
}


def stamped(reading: Any) -> Any:
    return st.builds(Stamped, st.integers(0, 2**31 * 10**9 - 1).map(Stamp), reading)


def same(data: bytes | None, message: Any) -> bool:
    """Whether bytes say what a message says; padding may hold anything."""
    if data is None or message is None:
        return data is message
    wanted = serialize_message(message)
    read, expected = (deserialize_message(one, type(message)) for one in (data, wanted))
    return repr(read) == repr(expected) and len(data) == len(wanted)


def altitude(one: Stamped[BottomTrack | Echo]) -> Any:
    altitude_m = one.reading.range_m if isinstance(one.reading, Echo) else one.reading.altitude_m
    if altitude_m is None:
        return None
    return sensor_messages.echo_to_msg(
        Stamped(one.stamp, Echo(altitude_m, 1.0)), "link", reading_fields.DVL_LIMITS_m, reading_fields.DVL_VIEW_rad
    )


MESSAGES: dict[str, Callable[[Any], Any]] = {
    "data_raw": lambda one: sensor_messages.inertial_to_msg(
        one, "link", reading_fields.SIGMA_FORCE_mps2, reading_fields.SIGMA_RATE_radps
    ),
    "mag": lambda one: sensor_messages.magnetic_to_msg(one, "link", reading_fields.SIGMA_FIELD_T),
    "pressure": lambda one: sensor_messages.pressure_to_msg(one, "link", reading_fields.SIGMA_PRESSURE_Pa),
    "range": lambda one: sensor_messages.echo_to_msg(
        one, "link", reading_fields.PING_LIMITS_m, reading_fields.PING_VIEW_rad
    ),
    "altitude": altitude,
    "attitude": lambda one: sensor_messages.attitude_to_msg(one, "link", reading_fields.SIGMA_ATTITUDE_rad),
    "velocity": lambda one: sensor_messages.velocity_to_msg(one, "link"),
    "position": lambda one: sensor_messages.position_to_msg(one, "link"),
    "humidity": lambda one: sensor_messages.humidity_to_msg(one, "link", reading_fields.SIGMA_HUMIDITY),
    "temperature": lambda one: sensor_messages.temperature_to_msg(one.stamp, one.reading.temperature_C, "link"),
    "die_temperature": lambda one: sensor_messages.temperature_to_msg(one.stamp, one.reading.temperature_C, "link"),
    "processor_temperature": lambda one: sensor_messages.temperature_to_msg(one.stamp, one.reading.processor_C, "link"),
    "board_temperature": lambda one: sensor_messages.temperature_to_msg(one.stamp, one.reading.board_C, "link"),
    "battery": sensor_messages.battery_to_msg,
    "supply": lambda one: sensor_messages.battery_to_msg(Stamped(one.stamp, Battery(one.reading.supply_V))),
}


@pytest.mark.parametrize("quantity", sorted(FIELDS.keys() - {"detail"}))
@settings(max_examples=30)
@given(st.data())
def test_every_quantity_in_place_states_what_its_message_states(quantity: str, data: st.DataObject) -> None:
    make, write = MESSAGES[quantity], writer(quantity, "link")
    of_kinds = [READINGS[kind] for kind in FIELDS[quantity].kinds]
    for one in data.draw(st.lists(stamped(st.one_of(of_kinds)), min_size=1, max_size=3)):
        assert same(write(one), make(one))


@settings(max_examples=30)
@given(st.lists(st.tuples(stamped(speeds), st.none() | tracks), min_size=1, max_size=3))
def test_the_detail_in_place_states_what_its_message_states(pairs: list[tuple[Any, Any]]) -> None:
    write = writer("detail", "link")
    for velocity, track in pairs:
        assert same(write(velocity, track, 1500.0), sensor_messages.dvl_to_msg(velocity, track, "link", 1500.0))


STAMP = Stamp(1_234_567_890_123_456_789)


def written(quantity: str, reading: Any) -> Any:
    return writer(quantity, "link")(Stamped(STAMP, reading))


@pytest.mark.parametrize(
    ("velocity", "message"),
    [((1.0, 0.0, 0.0), (1, 0, 0)), ((0.0, 1.0, 0.0), (0, -1, 0)), ((0.0, 0.0, 1.0), (0, 0, -1))],
)
def test_dvl_velocity_axis_by_axis(velocity: Vec3, message: Vec3) -> None:
    data = written("velocity", BottomVelocity(velocity, 0.01, 1.0, 0.05, 7))
    made = deserialize_message(data, TwistWithCovarianceStamped)
    linear = made.twist.twist.linear
    assert (linear.x, linear.y, linear.z) == message
    assert made.twist.covariance[0] == pytest.approx(0.01**2)


def test_no_velocity_is_no_message() -> None:
    assert written("velocity", BottomVelocity(None, 0.01, 0.0, 0.05, 7)) is None


def test_sensors_there_and_back() -> None:
    inertial = Inertial((0.1, 0.2, -9.8), (0.01, 0.02, 0.03), 20.0)
    back = reader(IMU)(written("data_raw", inertial)).reading
    assert isinstance(back, Inertial)
    assert back.specific_force_mps2 == inertial.specific_force_mps2
    assert back.rate_radps == inertial.rate_radps
    magnetic = Magnetic((17e-6, 1e-6, -13e-6))
    assert reader(MAGNETIC)(written("mag", magnetic)) == Stamped(STAMP, magnetic)
    pressure = written("pressure", Pressure(110_000.0, 20.0))
    found = reader(PRESSURE)(pressure).reading
    assert isinstance(found, Pressure)
    assert found.pressure_Pa == 110_000.0
    echo = reader(ALTITUDE)(written("range", Echo(0.75, 1.0))).reading
    assert isinstance(echo, Echo)
    assert echo.range_m == 0.75
    track = BottomTrack(True, 0.1, -0.2, 3.0, 1.0, (0.0, 0.0), (), "3333", 0)
    made = reader(DVL_ATTITUDE)(written("attitude", track)).reading
    assert isinstance(made, BottomTrack)
    assert (made.roll_rad, made.pitch_rad, made.heading_rad) == pytest.approx((0.1, -0.2, 3.0))


@pytest.mark.parametrize("velocity", [(0.4, -0.1, 0.02), None])
def test_dvl_detail_there_and_back(velocity: Vec3 | None) -> None:
    reading = BottomVelocity(velocity, 0.01 if velocity else 0.0, 0.9, 0.05, 123456)
    track = BottomTrack(True, 0.1, -0.2, 3.0, 1.25, (0.0, 0.0), (), "3333", 0)
    data = writer("detail", "dvl75_link")(Stamped(STAMP, reading), track, 1484.0)
    assert data is not None
    message = deserialize_message(data, Dvl)
    assert message.altitude == 1.25
    assert reader(DVL_DETAIL)(data).reading == reading


@pytest.mark.parametrize(("rates", "forces"), [(-1.0, 0.01), (0.01, -1.0)])
def test_what_an_imu_says_it_does_not_measure_is_nan(rates: float, forces: float) -> None:
    message = Imu()
    message.linear_acceleration.z = 9.8
    message.angular_velocity_covariance[0], message.linear_acceleration_covariance[0] = rates, forces
    found = reader(IMU)(serialize_message(message)).reading
    assert isinstance(found, Inertial)
    assert math.isnan(found.rate_radps[0]) == (rates < 0.0)
    assert math.isnan(found.specific_force_mps2[2]) == (forces < 0.0)


def test_an_orientation_alone_is_no_inertial_sample() -> None:
    message = Imu()
    message.angular_velocity_covariance[0] = message.linear_acceleration_covariance[0] = -1.0
    assert reader(IMU)(serialize_message(message)).reading == Reading()


def test_a_place_states_whether_a_gps_gives_it() -> None:
    for fixed, status in ((True, 0), (False, -1)):
        message = deserialize_message(written("position", Position(44.96, -93.51, fixed)), NavSatFix)
        assert (message.latitude, message.longitude, message.status.status) == (44.96, -93.51, status)
        assert math.isnan(message.altitude)
        assert message.position_covariance_type == 0
