"""Bytes written in place against those of rclpy, and numbers read in place against those of message objects."""

import math
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import FluidPressure, Imu, Range
from std_msgs.msg import Header

from hindrax_core.events import Stamp, Stamped
from hindrax_core.messages.cdr import CdrLayout, CdrReader
from hindrax_core.readings import (
    Beam,
    BottomTrack,
    BottomVelocity,
    Echo,
    Inertial,
    Magnetic,
    Pressure,
    Vec3,
    Vec6,
    vec6,
)
from hindrax_core.rotation import sname_from_xyzw
from hindrax_core.signals import Allocation, AppliedOutput, Command, Navigation
from hindrax_core.topics import ALTITUDE, DVL_ATTITUDE, DVL_DETAIL, IMU, MAGNETIC, PRESSURE
from hindrax_msgs.msg import AllocationStatus, NavigationStatus, ThrusterCommand, ThrusterState
from hindrax_ros.messages import convert, fast_serialization
from hindrax_ros.messages.reading_fields import reader
from hindrax_ros.messages.serialization import definition_of
from hindrax_ros.testing import sensor_messages
from hindrax_ros.testing.state_messages import navigation_from_msg, navigation_to_msg, odometry_to_msg

counts = st.integers(0, 2**32 - 1)
number = st.floats(width=32, allow_nan=False)


def same(data: bytes, message: Any) -> bool:
    """Whether bytes say what a message says; padding may hold anything."""
    return repr(deserialize_message(data, type(message))) == repr(message) and len(data) == len(
        serialize_message(message)
    )


stamps = st.integers(0, 2**31 * 10**9 - 1).map(Stamp)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
six = st.tuples(*[number] * 6)
three = st.tuples(*[number] * 3)
navigations = st.builds(
    Stamped,
    stamps,
    st.builds(
        Navigation,
        attitude_rad=st.tuples(*[st.floats(-3, 3)] * 3),
        rate_radps=three,
        velocity_mps=st.tuples(number, number, st.floats()),
        depth_m=st.floats(),
        altitude_m=number,
        position_m=st.tuples(number, number),
        dvl_locked=st.booleans(),
        ages_s=st.dictionaries(st.sampled_from(("ms5837", "ping1d", "dvl75", "x")), number),
        velocity_sigma_mps=three,
    ),
)


@given(stamps, texts, three, three)
def test_inertial(stamp: Stamp, frame: str, force_mps2: Vec3, rate_radps: Vec3) -> None:
    inertial = Stamped(stamp, Inertial(force_mps2, rate_radps, math.nan))
    message = sensor_messages.inertial_to_msg(inertial, frame, 0.02, 0.001)
    assert repr(reader(IMU)(serialize_message(message))) == repr(inertial)


@given(st.lists(navigations, min_size=1, max_size=4))
def test_navigation(states: list[Any]) -> None:
    status, odometry = fast_serialization.navigation_writer(), fast_serialization.odometry_writer()
    for state in states:
        message = navigation_to_msg(state)
        assert same(status(state), message)
        assert same(odometry(state), odometry_to_msg(state))
        message.sources, message.ages = [], []
        found = fast_serialization.navigation_from_bytes(status(state))
        assert repr(found) == repr(navigation_from_msg(message))


@given(stamps, six)
def test_wrench(stamp: Stamp, wrench: Vec6) -> None:
    assert same(fast_serialization.wrench_writer()(stamp, wrench), convert.wrench_to_msg(stamp, wrench))


@given(stamps, texts, st.floats(0, 2e5), number)
def test_pressure(stamp: Stamp, frame: str, pressure_Pa: float, temperature_C: float) -> None:
    reading = Stamped(stamp, Pressure(pressure_Pa, temperature_C))
    message = sensor_messages.pressure_to_msg(reading, frame, 20.0)
    assert repr(reader(PRESSURE)(serialize_message(message))) == repr(sensor_messages.pressure_from_msg(message))


@given(stamps, texts, three, number)
def test_magnetic_and_echo(stamp: Stamp, frame: str, field_T: Vec3, range_m: float) -> None:
    field = Stamped(stamp, Magnetic(field_T))
    magnetic = sensor_messages.magnetic_to_msg(field, frame, 3e-7)
    assert reader(MAGNETIC)(serialize_message(magnetic)) == field
    echo = Stamped(stamp, Echo(range_m, 1.0))
    message = sensor_messages.echo_to_msg(echo, frame, (0.25, 50.0), 0.5)
    # Infinity is no echo: out of range, or too close (REP-117).
    assert reader(ALTITUDE)(serialize_message(message)) == (
        echo if math.isfinite(range_m) else Stamped(stamp, Echo(0.0, 0.0))
    )


@given(stamps, texts, st.tuples(*[st.floats(-3, 3)] * 3))
def test_attitude(stamp: Stamp, frame: str, angles_rad: Vec3) -> None:
    track = Stamped(stamp, BottomTrack(True, *angles_rad, 1.5, (0.0, 0.0), (), "", 0))
    message = sensor_messages.attitude_to_msg(track, frame, 0.02)
    found = reader(DVL_ATTITUDE)(serialize_message(message))
    q = message.orientation
    attitude_rad = sname_from_xyzw(q.x, q.y, q.z, q.w)
    wanted = BottomTrack(True, *attitude_rad, None, (math.nan, math.nan), (), "", 0)
    assert repr(found) == repr(Stamped(stamp, wanted))


velocities = st.builds(
    Stamped,
    stamps,
    st.builds(
        BottomVelocity,
        velocity_mps=st.none() | three,
        sigma_mps=st.floats(0, 1e3),
        confidence=number,
        interval_s=number,
        device_us=st.integers(0, 2**63),
    ),
)
beams = st.builds(Beam, st.booleans(), number, st.none() | number, number)
tracks = st.builds(
    BottomTrack,
    locked=st.booleans(),
    roll_rad=number,
    pitch_rad=number,
    heading_rad=number,
    altitude_m=st.none() | number,
    velocity_north_east_mps=st.just((0.0, 0.0)),
    beams=st.lists(beams, min_size=4, max_size=4).map(tuple) | st.just(()),
    imu_calibration=st.just(""),
    skipped_pings=st.just(0),
)


@given(texts, number, velocities, st.none() | tracks)
def test_dvl(frame: str, sound_mps: float, velocity: Stamped[Any], track: Any) -> None:
    message = sensor_messages.dvl_to_msg(velocity, track, frame, sound_mps)
    assert repr(reader(DVL_DETAIL)(serialize_message(message))) == repr(sensor_messages.dvl_from_msg(message))


@given(stamps, st.integers(0, 2**32 - 1), st.lists(number, max_size=9))
def test_command(stamp: Stamp, sequence: int, pulses: list[int]) -> None:
    message = ThrusterCommand(sequence=sequence, pulses=pulses)
    message.header.stamp, message.header.frame_id = convert.stamp_to_msg(stamp), "base_link_fsd"
    assert same(fast_serialization.command_writer(len(pulses))(stamp, sequence, pulses), message)


@given(stamps, st.integers(0, 2**32 - 1), st.lists(number, max_size=9), st.lists(number, max_size=3))
def test_a_command_keeps_pulses_and_lights_apart(
    stamp: Stamp, sequence: int, pulses: list[int], lights: list[int]
) -> None:
    message = ThrusterCommand(sequence=sequence, pulses=pulses, lights=lights)
    message.header.stamp = convert.stamp_to_msg(stamp)
    expected = Command(tuple(pulses), tuple(lights), stamp, sequence)
    assert fast_serialization.command_from_bytes(serialize_message(message)) == expected


@given(stamps, texts, st.booleans(), st.lists(number, max_size=9), st.tuples(counts, counts))
def test_applied(stamp: Stamp, text: str, armed: bool, pulses: list[int], numbers: tuple[int, int]) -> None:
    sequence, armings = numbers
    message = ThrusterState(armed=armed, state=text, reason=text + "x", pulses=pulses, sequence=sequence, output="o")
    message.armings, message.header.stamp = armings, convert.stamp_to_msg(stamp)
    applied = AppliedOutput(stamp, armed, tuple(pulses), sequence, armings)
    assert fast_serialization.applied_from_bytes(serialize_message(message)) == applied
    write = fast_serialization.applied_writer("o")
    other = applied._replace(pulses_us=(1500.0,), phase="other")
    assert deserialize_message(write(other), ThrusterState).state == "other"
    assert same(write(applied._replace(phase=text, reason=text + "x")), message)


@given(stamps, six, st.lists(texts, max_size=3), st.lists(st.booleans(), max_size=9))
def test_allocation(stamp: Stamp, wanted: tuple[float, ...], refused: list[Any], saturated: list[Any]) -> None:
    forces = [float(index) for index, _ in enumerate(saturated)]
    full = AllocationStatus(
        sequence=7,
        wanted=wanted,
        achieved=wanted[::-1],
        shortfall=wanted,
        forces=forces,
        pulses=forces,
        saturated=saturated,
        supply_voltage=16.0,
        supply_measured=True,
        header=Header(frame_id="base_link_fsd"),
        refused=refused,
        thrusters=["T1"],
    )
    full.header.stamp = convert.stamp_to_msg(stamp)
    applied = AppliedOutput(stamp, True, tuple(forces), 7, 0)
    wrenches = vec6(wanted), vec6(wanted[::-1]), vec6(wanted)
    found = Allocation(*wrenches, tuple(forces), (), tuple(saturated), refused=tuple(refused))
    data = fast_serialization.allocation_writer(["T1"], 12.0)(applied, found, 16.0)
    assert same(data, full)
    thrust = fast_serialization.thrust_from_bytes(data).reading
    assert (thrust.wrench, thrust.forces_N) == (wanted[::-1], tuple(forces))


def test_a_reader_learns_another_shape_and_comes_back() -> None:
    reader = CdrReader(definition_of(NavigationStatus), "depth", "ages")
    short = serialize_message(NavigationStatus(depth=1.0))
    long = serialize_message(NavigationStatus(depth=2.0, sources=["a", "b"], ages=[0.5, 0.6]))
    assert [reader.read(data) for data in (short, long, short)] == [(1.0,), (2.0, 0.5, 0.6), (1.0,)]


def test_shapes_of_one_length_are_distinguished() -> None:
    """A longer frame name beside fewer ages may give as many bytes, with every number somewhere else."""
    one = NavigationStatus(depth=1.0, ages=[0.5])
    other = NavigationStatus(depth=2.0)
    other.header.frame_id = "12345678"
    reader = CdrReader(definition_of(NavigationStatus), "depth")
    assert len(serialize_message(one)) == len(serialize_message(other))
    assert [reader.read(serialize_message(message)) for message in (one, other)] == [(1.0,), (2.0,)]


@pytest.mark.parametrize("data", [b"", b"\x00\x00" + bytes(400), b"\x00\x01" + bytes(60)])
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="found"):
        CdrReader(definition_of(Imu), "header.stamp.sec").read(data)


@pytest.mark.parametrize("kind", [Imu, FluidPressure, Range, NavigationStatus, AllocationStatus, ThrusterState])
def test_a_layout_covers_all_bytes(kind: Any) -> None:
    data = serialize_message(kind())
    assert 0 <= len(data) - CdrLayout(definition_of(kind), data).size < 8, "no more than padding may follow"
    assert deserialize_message(data, kind) == kind()
