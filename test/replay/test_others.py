"""Third-party bags, with messages only: replayed from the topics that their types or the user name."""

import json
from pathlib import Path

import pytest

from hindrax_bag.metadata import Channel
from hindrax_bag.read.bag_reader import attachments, messages
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.clone import clone_root
from hindrax_cli import command_line
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import ODOMETRY
from hindrax_ros.messages.serialization import serialized
from hindrax_ros.messages.share import share_lookup
from hindrax_ros.testing.state_messages import navigation_from_msg, odometry_to_msg

SURGE = clone_root() / "test" / "replay" / "bags" / "surge"
NAMES = {
    "/hindrax/icm20948/data_raw": "/auv/imu",
    "/hindrax/icm20948/mag": "/auv/mag",
    "/hindrax/ms5837/pressure": "/auv/pressure",
    "/hindrax/dvl75/detail": "/auv/dvl",
}


def others_bag(folder: Path, *, more: dict[str, str] | None = None, spoil: float = 0.0) -> Path:
    """Fourteen seconds as another vehicle would have recorded them, with its own odometry beside."""
    bag = BagWriter(folder, share_lookup, limits=BagLimits(keep_free_MB=0.0))
    bag.open()
    names, begin = NAMES | (more or {}), 0
    for one in messages(SURGE):
        begin = begin or one.received
        if one.received > begin + 14 * NS_PER_S:
            break
        if one.topic in names:
            bag.write(Channel(names[one.topic], one.type), one.data, one.received, one.sent)
        elif one.topic.endswith("navigation/status"):
            odometry = odometry_to_msg(navigation_from_msg(one.decoded()))
            odometry.pose.pose.position.z += spoil
            bag.write(Channel("/auv/odometry", ODOMETRY.type), serialized(odometry), one.received, one.sent)
    bag.close()
    return folder


@pytest.fixture
def vehicle(tmp_path: Path) -> str:
    file = tmp_path / "vehicle.yaml"
    file.write_bytes(attachments(SURGE)["vehicle.yaml"])
    return str(file)


def test_a_bag_of_others_is_replayed_by_its_types(
    tmp_path: Path, vehicle: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = others_bag(tmp_path / "auv")
    assert command_line.main(["replay", str(bag), "--vehicle", vehicle, "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["bags"]
    assert one["differences"] == []
    assert one["fields_compared"] > 100


def test_what_differs_from_their_odometry_is_named(
    tmp_path: Path, vehicle: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = others_bag(tmp_path / "auv", spoil=0.2)
    assert command_line.main(["replay", str(bag), "--vehicle", vehicle, "--json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)["bags"]
    assert {found["field"] for found in one["differences"]} == {"pose.pose.position.z"}


def test_two_topics_of_a_type_are_distinguished_by_name(
    tmp_path: Path, vehicle: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = others_bag(tmp_path / "auv", more={"/hindrax/dvl75/attitude": "/auv/second_imu"})
    words = ["replay", str(bag), "--vehicle", vehicle]
    assert command_line.main(words) == 2
    assert "several topics are of type sensor_msgs/msg/Imu" in capsys.readouterr().err
    remaps = [("/auv/imu", "icm20948/data_raw"), ("/auv/pressure", "ms5837/pressure"), ("/auv/dvl", "dvl75/detail")]
    remaps += [("/auv/odometry", "navigation/odometry"), ("/auv/second_imu", "dvl75/attitude")]
    reported = [word for theirs, ours in remaps for word in ("--remap", f"{theirs}:=/hindrax/{ours}")]
    assert command_line.main([*words, *reported]) == 0


@pytest.mark.parametrize(
    ("remap", "printed"),
    [
        ("/auv/imu:=/hindrax/nothing", "wanted THEIRS:=OURS"),
        ("/auv/none:=/hindrax/icm20948/data_raw", "no such topic"),
        ("/auv/mag:=/hindrax/icm20948/data_raw", "found sensor_msgs/msg/MagneticField"),
    ],
)
def test_a_remap_that_does_not_fit_is_refused(
    tmp_path: Path, vehicle: str, capsys: pytest.CaptureFixture[str], remap: str, printed: str
) -> None:
    bag = others_bag(tmp_path / "auv")
    assert command_line.main(["replay", str(bag), "--vehicle", vehicle, "--remap", remap]) == 2
    assert printed in capsys.readouterr().err


def test_without_a_vehicle_file_one_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["replay", str(others_bag(tmp_path / "auv"))]) == 2
    assert "--vehicle" in capsys.readouterr().err
