"""The DVL's detail in the shape of another package, tried against a stand-in that has exactly that package's fields."""

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Beam, BottomTrack, BottomVelocity
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.reading_messages import MARINE_ACOUSTIC, ReadingMessages, fill
from hindrax_ros.graph import optional_class
from hindrax_ros.messages.serialization import message_class
from hindrax_ros.testing.sensor_messages import dvl_to_msg

VEHICLE_FILE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"
PACKAGE = ("marine_acoustic_msgs", "marine_acoustic_msgs.msg")


class Dvl(SimpleNamespace):
    """Fields of marine_acoustic_msgs/msg/Dvl.msg of github apl-ocean-engineering/marine_msgs."""

    __slots__ = (
        *("header", "velocity_mode", "dvl_type", "velocity", "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
        *("num_good_beams", "sound_speed", "beam_ranges_valid", "beam_velocities_valid", "beam_unit_vec", "range"),
        *("range_covar", "beam_quality", "beam_velocity", "beam_velocity_covar"),
    )


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in PACKAGE:
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["marine_acoustic_msgs.msg"].Dvl = Dvl  # type: ignore[attr-defined]  # a stand-in
    yield
    message_class.cache_clear()


def dvl_messages() -> ReadingMessages:
    return ReadingMessages("dvl75", "dvl75", load_vehicle(VEHICLE_FILE))


def test_every_field_is_filled_from_ours() -> None:
    beams = tuple(Beam(locked=True, velocity_mps=0.1 * n, range_m=1.0 + n, gain_dB=20.0 + n) for n in range(4))
    track = BottomTrack(True, 0.0, 0.0, 0.0, 1.4, (0.0, 0.0), beams, "3333", 0)
    velocity = Stamped(Stamp(5), BottomVelocity((0.3, -0.4, 0.1), 0.02, 1.0, 0.05, 77))
    theirs = fill(Dvl(), dvl_to_msg(velocity, track, "dvl75_link", 1490.0))
    assert all(hasattr(theirs, name) for name in Dvl.__slots__)
    assert (theirs.header.frame_id, theirs.header.stamp.nanosec) == ("dvl75_link", 5)
    assert (theirs.velocity.x, theirs.velocity.y, theirs.velocity.z) == (0.3, -0.4, 0.1)
    assert theirs.velocity_covar[::4] == pytest.approx([4e-4] * 3)
    assert (theirs.altitude, theirs.num_good_beams, theirs.sound_speed) == (1.4, 4, 1490.0)
    assert theirs.speed_gnd == pytest.approx(0.5)
    assert theirs.range == [1.0, 2.0, 3.0, 4.0]
    assert theirs.beam_velocity == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert theirs.beam_quality == [20.0, 21.0, 22.0, 23.0]
    assert theirs.beam_velocity_covar == [-1.0] * 4


def test_a_velocity_without_lock_is_unknown_there_too() -> None:
    lost = Stamped(Stamp(5), BottomVelocity(None, 0.0, 0.0, 0.05, 77))
    theirs = fill(Dvl(), dvl_to_msg(lost, None, "dvl75_link", 1490.0))
    assert theirs.velocity.x != theirs.velocity.x
    assert theirs.velocity_covar[0] == -1.0
    assert not theirs.beam_velocities_valid


def test_without_the_package_nothing_is_published_and_nothing_breaks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in PACKAGE:
        monkeypatch.setitem(sys.modules, name, None)
    message_class.cache_clear()
    assert optional_class(MARINE_ACOUSTIC) is None
    assert "dvl75/dvl" not in {topic.name for topic in dvl_messages().topics}


@pytest.mark.usefixtures("package")
def test_with_the_package_every_detail_is_published() -> None:
    made = dvl_messages()
    messages = dict(made.of(Stamped(Stamp(5), BottomVelocity(None, 0.0, 0.0, 0.05, 77))))
    assert "dvl75/dvl" in {topic.name for topic in made.topics if not topic.recorded}
    found = messages["dvl75/dvl"]
    assert isinstance(found, Dvl)
    assert found.header.frame_id == "dvl75_link"


def test_a_broken_package_is_not_taken_for_a_missing_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_msgs").mkdir()
    (tmp_path / "broken_msgs" / "__init__.py").touch()
    (tmp_path / "broken_msgs" / "msg.py").write_text("import gone_for_good")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="gone_for_good"):
        optional_class("broken_msgs/msg/Dvl")
