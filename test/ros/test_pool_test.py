"""The main job through real processes: one surge pool test in mock, and what must be true of what it leaves."""

from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_analysis.identification.bag_identification import identify_bag
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import TOPICS, resolved
from hindrax_core.vehicle import load_vehicle

pytestmark = pytest.mark.ros
NOT_IN_MOCK = {
    *("ping1d/profile", "battery", "leak", "holds/setpoint", "operator/wrench"),
    *("joy", "cmd_vel", "lights", "thrusters/health_order"),
}
"""Rows of the table that nobody publishes during a plain pool test in mock, beside those of sensors not carried."""
COEFFICIENTS = {"k_q", "k_l", "b", "added_mass"}


@pytest.fixture(scope="module")
def run(tutorial_flight: tuple[Path, Any]) -> tuple[Path, Any]:
    return tutorial_flight


def test_the_document_has_the_agreed_shape(run: tuple[Path, Any]) -> None:
    folder, document = run
    assert document["aborted"] is None
    assert document["bag"] == str(folder / "bag")
    assert document["real_time_factor"] > 0.0
    surge = document["motions"]["surge"]
    assert surge["identifiable"] is True
    assert set(surge) >= COEFFICIENTS
    assert all({"value", "std", "truth"} <= set(surge[name]) for name in COEFFICIENTS)


def test_in_a_pool_the_drag_lies_within_its_calibrated_band(run: tuple[Path, Any]) -> None:
    """In the ideal water of a lock-step, hindrax_sim's test_lockstep.py holds drag and coefficients within 3 %."""
    surge = run[1]["motions"]["surge"]
    speed, force, std = (surge["drag_force"][name][-1] for name in ("speed", "force", "std_calibrated"))
    truth = surge["k_q"]["truth"] * speed**2 + surge["k_l"]["truth"] * speed
    assert abs(force - truth) < 3.0 * std
    assert std > 0.05 * force


def test_no_wall_was_touched(run: tuple[Path, Any]) -> None:
    assert run[1]["mock"]["wall_hits"] == 0


def test_identifying_over_the_bag_gives_the_same_numbers(run: tuple[Path, Any]) -> None:
    folder, document = run
    again = identify_bag(folder / "bag", load_vehicle(folder / "vehicle.yaml")).results.motions["surge"]
    for name, number in again.coefficients.items():
        assert number.value == pytest.approx(document["motions"]["surge"][name]["value"], rel=1e-9, abs=1e-12)


def test_the_bag_opens_with_rosbags_and_holds_every_topic(run: tuple[Path, Any]) -> None:
    rosbags = pytest.importorskip("rosbags.highlevel")
    with rosbags.AnyReader([run[0] / "bag"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        seen = set()
        for connection, _, data in reader.messages():
            if connection.topic not in seen:
                reader.deserialize(data, connection.msgtype)
                seen.add(connection.topic)
    absent = {sensor.name for sensor in SENSORS} - set(load_vehicle(run[0] / "vehicle.yaml").sensors)
    published = [topic for topic in TOPICS if not absent & set(topic.name.split("/"))]
    wanted = {resolved(topic): topic.type for topic in published if topic.recorded and topic.name not in NOT_IN_MOCK}
    assert {topic: kinds.get(topic) for topic in wanted} == wanted
    assert seen == {topic for topic, count in counts.items() if count}


def test_the_bag_opens_with_mcap_with_all_checksums(run: tuple[Path, Any]) -> None:
    from mcap.reader import make_reader

    file = next((run[0] / "bag").glob("*.mcap"))
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert reader.get_header().profile == "ros2"
        assert sum(1 for _ in reader.iter_messages()) == summary.statistics.message_count


def test_rosbag2_metadata_lies_beside_it(run: tuple[Path, Any]) -> None:
    information = yaml.safe_load((run[0] / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    files = [run[0] / "bag" / name for name in information["relative_file_paths"]]
    assert all(file.is_file() for file in files)


def test_results_are_written(run: tuple[Path, Any]) -> None:
    coefficients = yaml.safe_load((run[0] / "coefficients.yaml").read_text())
    assert coefficients["motions"]["surge"]["k_q"]["value"] == run[1]["motions"]["surge"]["k_q"]["value"]
    report = (run[0] / "report.html").read_text()
    assert "<svg" in report or "data:image/png" in report
    assert "http://" not in report.replace("http://www.w3.org", "")


def test_no_process_is_left(run: tuple[Path, Any]) -> None:
    vehicle = str(run[0])
    left = [entry.name for entry in Path("/proc").iterdir() if entry.name.isdigit() and vehicle in _command_line(entry)]
    assert left == []


def _command_line(process: Path) -> str:
    try:
        return (process / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""
