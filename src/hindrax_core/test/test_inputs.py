"""Messages of other stacks as velocities and depths. Fields: marine_acoustic_msgs/Dvl; REP-103, REP-105."""

import math
import struct
from collections.abc import Callable
from typing import Any

import pytest

from hindrax_core.hydrostatics import GRAVITY_mps2, Water
from hindrax_core.messages.contents import bytes_reader
from hindrax_core.messages.definition import ONE, Definition, Field
from hindrax_core.messages.inputs import INPUTS, InputKnobs
from hindrax_core.readings import BottomVelocity, Pressure
from hindrax_core.sensor_table import Capability

WATER, SIGMA_mps = Water(), 0.02
UNKNOWN = (-1.0, *(0.0,) * 8)

VECTOR = tuple(Field(axis, "float64", ONE) for axis in "xyz")
DVL: Definition = {
    "marine_acoustic_msgs/Dvl": (
        Field("header", "std_msgs/Header", ONE),
        Field("velocity_mode", "uint8", ONE),
        Field("dvl_type", "uint8", ONE),
        Field("velocity", "geometry_msgs/Vector3", ONE),
        Field("velocity_covar", "float64", 9),
        *(Field(name, "float64", ONE) for name in ("altitude", "course_gnd", "speed_gnd")),
        Field("num_good_beams", "uint8", ONE),
        Field("sound_speed", "float32", ONE),
        Field("beam_ranges_valid", "bool", ONE),
        Field("beam_velocities_valid", "bool", ONE),
    ),
    "std_msgs/Header": (Field("stamp", "builtin_interfaces/Time", ONE), Field("frame_id", "string", ONE)),
    "builtin_interfaces/Time": (Field("sec", "int32", ONE), Field("nanosec", "uint32", ONE)),
    "geometry_msgs/Vector3": VECTOR,
}
"""Definition of the message up to the beams, which are not read."""


def dvl(
    velocity: tuple[float, float, float],
    covariance: tuple[float, ...],
    *,
    mode: int = 1,
    beams: int = 4,
    valid: bool = True,
) -> BottomVelocity:
    """What is read of a message with this in it, from its bytes as DDS carries them (CDR, little endian)."""
    head = struct.pack("<iI", 7, 500_000_000) + struct.pack("<I", 4) + b"dvl\0" + bytes((mode, 0))
    head += bytes(-len(head) % 8)
    body = struct.pack("<3d9d3d", *velocity, *covariance, 2.5, 0.0, 0.3) + bytes((beams, 0, 0, 0))
    data = b"\x00\x01\x00\x00" + head + body + struct.pack("<f", 1500.0) + bytes((True, valid))
    row = INPUTS["velocity"]["dvl"]
    stamped = bytes_reader(DVL, row.contents(WATER, InputKnobs(velocity_sigma_mps=SIGMA_mps)))(data)
    assert stamped.stamp == 7_500_000_000
    assert isinstance(stamped.reading, BottomVelocity)
    return stamped.reading


def made_of(capability: Capability, word: str, *values: float, **knobs: float) -> Any:
    """What the values of a message of this topic make."""
    asked: Any = {"velocity_sigma_mps": SIGMA_mps, **knobs}
    made: Callable[..., Any] = INPUTS[capability][word].contents(WATER, InputKnobs(**asked)).made
    return made(*values)


def test_the_report_of_a_dvl_is_in_the_axes_of_the_instrument() -> None:
    found = dvl((0.3, 0.1, -0.2), (4e-4, *(0.0,) * 8))
    assert found.velocity_mps == (0.3, 0.1, -0.2)
    assert found.sigma_mps == pytest.approx(0.02)
    assert dvl((0.3, 0.1, -0.2), UNKNOWN, beams=3, valid=False).sigma_mps == SIGMA_mps


@pytest.mark.parametrize(
    ("velocity", "beams", "valid"),
    [
        ((0.0, 0.0, 0.0), 0, False),
        ((0.0, 0.0, 0.0), 4, True),
        ((0.1, 0.0, 0.0), 2, False),
        ((math.nan, 0.0, 0.0), 4, True),
    ],
)
def test_without_bottom_lock_there_is_no_velocity(
    velocity: tuple[float, float, float], beams: int, valid: bool
) -> None:
    assert dvl(velocity, UNKNOWN, beams=beams, valid=valid).velocity_mps is None
    assert dvl((0.3, 0.1, -0.2), (9999.0, *(0.0,) * 8)).velocity_mps is None


def test_a_velocity_through_the_water_is_refused() -> None:
    with pytest.raises(ValueError, match="found velocity_mode 2, wanted 1"):
        dvl((0.3, 0.0, 0.0), UNKNOWN, mode=2)


@pytest.mark.parametrize("word", ["velocity", "odometry"])
def test_a_twist_is_turned_from_rep_103(word: str) -> None:
    def made(*values: float) -> Any:
        return made_of("velocity", word, *values, *(0.0,) * 35)

    assert made(0.3, -0.1, 0.2, 4e-4) == BottomVelocity((0.3, 0.1, -0.2), 0.02, 1.0, 0.0, 0)
    assert made(0.3, -0.1, 0.2, 0.0).sigma_mps == SIGMA_mps
    assert made(0.0, 0.0, 0.0, 1e6).velocity_mps is None
    assert made(math.nan, 0.0, 0.0, 0.0).velocity_mps is None


@pytest.mark.parametrize("word", ["velocity", "odometry"])
def test_zeros_without_a_variance_are_a_driver_without_bottom_lock(word: str) -> None:
    for variance in (0.0, -1.0, math.nan):
        assert made_of("velocity", word, 0.0, 0.0, 0.0, variance, *(0.0,) * 35).velocity_mps is None
    assert made_of("velocity", word, 0.0, 0.0, 0.0, 1e-6, *(0.0,) * 35).velocity_mps == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("word", "around"), [("pose", (0.4, 0.3)), ("pose_stamped", (0.4, 0.3)), ("odometry", ())])
def test_a_height_is_the_pressure_at_its_depth(word: str, around: tuple[float, ...]) -> None:
    attitude = (0.0, 0.0, 0.0, 1.0) if around else ()
    found = made_of("depth", word, *around, -1.2, *attitude)
    assert isinstance(found, Pressure)
    assert WATER.depth_m(found.pressure_Pa) == pytest.approx(1.2)
    above_the_floor = made_of("depth", word, *around, 0.6, *attitude, surface_m=1.8)
    assert WATER.depth_m(above_the_floor.pressure_Pa) == pytest.approx(1.2)


@pytest.mark.parametrize("word", ["pose", "pose_stamped"])
def test_a_pose_that_a_tracker_repeats_is_no_depth(word: str) -> None:
    """While the markers are hidden the last pose comes again, with a new stamp: it was a depth at rest."""
    made: Callable[..., Any] = INPUTS["depth"][word].contents(WATER, InputKnobs()).made
    seen = (0.4, 0.3, -1.2, 0.0, 0.0, 0.0, 1.0)
    made(*seen)
    with pytest.raises(ValueError, match="found the same pose twice, to the last digit, wanted it as it is seen"):
        made(*seen)
    assert made(0.41, *seen[1:]).pressure_Pa == pytest.approx(WATER.surface_pressure_Pa + 1.2 * 1000.0 * GRAVITY_mps2)


def test_our_own_messages_are_the_default() -> None:
    assert [InputKnobs().of(one) for one in ("velocity", "depth", "rates")] == [None, None, None]
    assert InputKnobs(velocity="dvl").of("velocity") == ("dvl", INPUTS["velocity"]["dvl"])
