"""Rows of other packages, and the topics of sensors by their names."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_core.sensor_table import QUANTITIES, Sensor, row_of
from hindrax_core.topics import TOPICS, carriers, topics_of
from hindrax_core.vehicle import NAMED_OTHERWISE, Mount, Vehicle

LOOK = """
from hindrax_core.sensor_table import all_sensors, row_of, unusable_sensors
print("good" in [row.name for row in all_sensors()])
for name in ("good", "raises", "other", "ms5837x"):
    try:
        print(row_of(name).driver_module)
    except ValueError as error:
        print(error)
print(*unusable_sensors())
"""
MODULE = """
from hindrax_core.sensor_table import Sensor
GOOD = Sensor("good", "i2c", {"temperature": 1}, "a good one", driver="mine.good")
OTHER = GOOD
"""
POINTS = "[hindrax.sensors]\ngood = mine_sensors:GOOD\nraises = mine_sensors:NOTHING\nother = mine_sensors:OTHER\n"


def test_an_installed_package_adds_a_row_and_a_broken_one_harms_no_other(tmp_path: Path) -> None:
    (tmp_path / "mine_sensors.py").write_text(MODULE)
    (tmp_path / "mine-1.0.dist-info").mkdir()
    (tmp_path / "mine-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (tmp_path / "mine-1.0.dist-info" / "entry_points.txt").write_text(POINTS)
    words = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{LOOK}"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    known, good, raises, other, unknown, unusable = done.stdout.splitlines()
    assert (known, good) == ("True", "mine.good")
    assert raises.startswith(
        "found 'raises', whose package cannot be used: entry point raises = mine_sensors:NOTHING: Attr"
    )
    assert other.endswith("wanted a Sensor of that name")
    assert unknown.startswith("found 'ms5837x', wanted one of dvl75, ")
    assert "good" in unknown.split(", ")
    assert {"raises", "other"} <= set(unusable.split())


def test_a_quantity_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="publishes: found 'salinity', wanted some of velocity, "):
        Sensor("ctd", "i2c", {"salinity": 1}, "a CTD")
    assert "temperature" in QUANTITIES


def test_topics_have_the_names_of_the_vehicle_file(vehicle: Vehicle) -> None:
    sensors = {"bow": Mount("ms5837"), "stern": Mount("ms5837", port="b"), "eye": Mount("ping1d")}
    named = replace(vehicle, sensors=sensors)
    assert {name: topic.name for name, topic in carriers(named, "depth").items()} == {
        "bow": "bow/pressure",
        "stern": "stern/pressure",
    }
    names = {topic.name for topic in topics_of(named)}
    assert {"bow/pressure", "raw/stern", "eye/range", "battery", "navigation/odometry"} <= names
    assert not {"ms5837/pressure", "raw/dvl75"} & names


def test_the_altitude_is_that_of_sonars_and_of_a_dvl_only_without_them(vehicle: Vehicle) -> None:
    assert [topic.name for topic in carriers(vehicle, "altitude").values()] == ["ping1d/range"]
    without = replace(vehicle, sensors={"log": Mount("a50"), "ahead": Mount("ping1d", rotation_deg=(0.0, 90.0, 0.0))})
    assert [topic.name for topic in carriers(without, "altitude").values()] == ["log/altitude"]


def test_no_sensor_can_have_the_name_of_something_else() -> None:
    """A sensor called `pilot` would be a second node of that name, one called `control` would mix with its topics."""
    kinds = {row_of(name).name for name in ("dvl75", "a50", "ping1d", "icm20948", "ms5837")}
    first = {topic.name.removeprefix("/").partition("/")[0] for topic in TOPICS if not topic.name.startswith("/")}
    others = {name for name in first if name not in NAMED_OTHERWISE}
    assert kinds <= others
    assert all(row_of(name).name == name for name in others)
