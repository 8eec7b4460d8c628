"""Vehicles with other sensors than the Hindrax, flown through the real processes: no node asks for a kind of sensor."""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bag.read.bag_reader import messages
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.topics import NAMESPACE, NAVIGATION, resolved

pytestmark = [pytest.mark.ros, pytest.mark.long]
OTHER_PACKAGE = Path(__file__).parents[1] / "other_package"
AHEAD = {
    "device": "ping1d",
    "port": "/dev/hindrax/ahead",
    "position_m": [0.3, 0.0, 0.0],
    "rotation_deg": [0.0, 90.0, 0.0],
}
A50 = {"device": "a50", "port": "tcp://192.168.2.95:16171", "position_m": [0.15, 0.0, 0.15]}
MORE = {"ahead": AHEAD, "bow_dvl": A50, "water": {"device": "tsys01", "port": "/dev/i2c-1"}}
"""A second Ping, an A50 beside the DVL-75, and the sensor of another package, which is found by its entry point."""
SHORT = {"levels": 2, "turning_levels": 1, "plateau_s": 6.0}
"""Fewer and shorter speeds identify as well; what is looked at here are the sensors."""
SETTLED_NS = 15_000_000_000


def flown(folder: Path, sensors: dict[str, Any], motion: str) -> tuple[Path, dict[str, Any]]:
    file, data = folder / "vehicle.yaml", yaml.safe_load(default_vehicle().read_text(encoding="utf-8"))
    file.write_text(yaml.safe_dump(data | {"sensors": sensors}, sort_keys=False), encoding="utf-8")
    path = os.pathsep.join([str(OTHER_PACKAGE), os.environ.get("PYTHONPATH", "")])
    words = [
        "pool-test",
        "--mock",
        "--headless",
        "--dof",
        motion,
        "--world",
        "ideal",
        *(word for name, value in SHORT.items() for word in ("--set", f"pilot.plan.{name}:={value}")),
        "--json",
        "--out",
        str(folder / "run"),
    ]
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli", *words, "--vehicle", str(file)],
        env=dict(os.environ, PYTHONPATH=path),
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder / "run", json.loads(done.stdout)


def on_board() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(default_vehicle().read_text(encoding="utf-8"))["sensors"]
    return found


def last_states(run: Path) -> list[Any]:
    found = [one.decoded() for one in messages(run / "bag", {resolved(NAVIGATION)})]
    begin = found[0].header.stamp.sec
    return [one for one in found if one.header.stamp.sec - begin > SETTLED_NS // 10**9]


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    return flown(tmp_path_factory.mktemp("many"), on_board() | MORE, "yaw")


def test_two_pings_two_dvls_and_a_sensor_of_another_package_fly(many: tuple[Path, dict[str, Any]]) -> None:
    run, document = many
    assert document["aborted"] is None
    assert document["motions"]["yaw"]["identifiable"]
    counts = Counter(one.topic.removeprefix(f"{NAMESPACE}/") for one in messages(run / "bag"))
    for name, quantity in (("ping1d", "range"), ("ahead", "range"), ("bow_dvl", "detail"), ("water", "temperature")):
        assert counts[f"{name}/{quantity}"] > 100, f"{name}: {counts}"
        assert counts[f"raw/{name}"] > 10


def test_the_sonar_ahead_sees_the_wall_and_moves_no_floor(many: tuple[Path, dict[str, Any]]) -> None:
    ahead = [one.decoded().range for one in messages(many[0] / "bag", {f"{NAMESPACE}/ahead/range"})]
    assert min(ahead) > 2.0, "walls are farther than the floor"
    states = last_states(many[0])
    assert all(abs(one.altitude + one.depth - 1.8) < 0.1 for one in states)
    assert {"ping1d", "bow_dvl", "dvl75"} <= set(states[-1].sources)
    assert not {"ahead", "water"} & set(states[-1].sources)


def test_a_vehicle_with_only_an_a50_flies_a_pool_test(tmp_path: Path) -> None:
    sensors = {name: one for name, one in on_board().items() if name not in ("dvl75", "ping1d")} | {"a50": A50}
    run, document = flown(tmp_path, sensors, "surge")
    assert document["aborted"] is None
    surge = document["motions"]["surge"]
    for name in ("k_q", "k_l"):
        assert abs(surge[name]["value"] - surge[name]["truth"]) < 3.0 * surge[name]["std"]
    # The altitude is that of the DVL, and so is its age.
    states = last_states(run)
    assert all(one.altitude_valid and one.altitude_age < 1.0 for one in states)
    assert all(abs(one.altitude + one.depth - 1.8) < 0.1 for one in states)
