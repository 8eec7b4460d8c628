"""A launch file for each device alone: its settings are arguments, and what it describes runs without a vehicle file.

A stand-in for launch, which is not among the wheels of ROS, takes down what the files say.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from launch_stand_in import Said, actions_of, put_in_place

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from sensor_msgs.msg import FluidPressure

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.errors import UsageError
from hindrax_core.sensor_table import SENSORS, Sensor
from hindrax_core.topics import TOPICS_OF
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.nodes.thruster_settings import read_settings
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

FOLDER = Path(__file__).parents[2] / "src" / "hindrax_drivers" / "launch"
PATIENT_S = 60.0


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    put_in_place(monkeypatch)
    yield
    sys.modules.pop("hindrax_drivers.nodes.launch_description", None)


def described(name: str) -> tuple[dict[str, Said], Said]:
    """Arguments by name, and the one process."""
    *arguments, node = actions_of(FOLDER / f"{name}.launch.py")
    return {one.words[0]: one for one in arguments}, node


def value(said: Said) -> Any:
    """Default of an argument, read as launch reads it."""
    return yaml.safe_load(said.keywords["default_value"])


def loaded(text: str) -> Any:
    """Value of a text as launch converts it, which raises where YAML finds no scalar and no list of them."""
    found = yaml.safe_load(text)
    assert isinstance(found, str | int | float | list), f"launch refuses {text!r}"
    return found


def words_of(folder: Path, name: str, **given: str) -> list[str]:
    """What launch would run after the executable, with these arguments given: parameters travel in a file."""
    arguments, node = described(name)
    values = {key: given.get(key, one.keywords["default_value"]) for key, one in arguments.items()}
    typed = {
        key: values[key] if one.keywords["value_type"] is str else loaded(values[key])
        for key, one in node.keywords["parameters"][0].items()
    }
    file = folder / "parameters.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": typed}}), encoding="utf-8")
    return [*node.keywords["arguments"], "--ros-args", "-r", f"__ns:={values['namespace']}", "--params-file", str(file)]


@pytest.mark.usefixtures("stand_in")
def test_any_sensor_is_started_by_its_kind() -> None:
    """One file for all: a sensor of another package has none of its own."""
    *arguments, opaque = actions_of(FOLDER / "sensor.launch.py")
    assert [one.words[0] for one in arguments] == ["device", "port", "namespace", "parameters"]

    def nodes(**given: str) -> Any:
        made = {"port": "", "namespace": "/rov1", "parameters": ""} | given
        return opaque.keywords["function"](SimpleNamespace(launch_configurations=made))

    (node,) = nodes(device="ms5837", port="/dev/i2c-3")
    assert (node.keywords["executable"], node.keywords["arguments"]) == ("device", ["ms5837"])
    assert (node.keywords["parameters"], node.keywords["namespace"]) == ([{"port": "/dev/i2c-3"}], "/rov1")
    assert nodes(device="ms5837", parameters="mine.yaml")[0].keywords["parameters"] == ["mine.yaml"]
    with pytest.raises(UsageError, match="found 'ms58', wanted one of dvl75, "):
        nodes(device="ms58")


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("name", [sensor.name for sensor in SENSORS])
def test_every_setting_of_a_sensor_is_an_argument(name: str) -> None:
    arguments, node = described(name)
    knobs = driver_of(name).knobs
    wanted = {one.name for one in fields(knobs)} | {"port", "frame_id", "namespace"}
    assert wanted <= arguments.keys()
    for one in fields(knobs):
        found, default = value(arguments[one.name]), getattr(knobs(), one.name)
        if default in ("", None):
            assert found in (None, ""), "an empty text"
            continue
        assert (tuple(found) if isinstance(found, list) else str(found)) == (
            default if isinstance(default, tuple) else str(default)
        )
    assert node.keywords["executable"] == "device"
    assert node.keywords["arguments"] == [name]


@pytest.mark.usefixtures("stand_in")
def test_thrusters_have_channels_instead_of_a_vehicle(tmp_path: Path) -> None:
    settings = read_settings(words_of(tmp_path, "pca9685", channels="[2, 5]", port="/dev/i2c-7"))
    assert [(one.name, one.channel) for one in settings.vehicle.thrusters] == [("T1", 2), ("T2", 5)]
    assert (settings.port, settings.vehicle.output.rate_Hz, settings.alone) == ("/dev/i2c-7", 200.0, True)


def test_a_word_that_is_no_device_is_reported() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_drivers.nodes.device", "dvl76"], check=False, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr.startswith("device: found 'dvl76', wanted one of dvl75, a50, ping1d")


@pytest.mark.ros
@pytest.mark.usefixtures("stand_in")
def test_a_device_alone_publishes_under_the_names_that_it_is_given(tmp_path: Path) -> None:
    received: list[FluidPressure] = []
    with (
        MockVehicle(Hardware(load_vehicle(default_vehicle()), 1), tmp_path, rate=1.0) as mock,
        own_domain(mock=True) as domain,
    ):
        words = words_of(tmp_path, "ms5837", port=mock.ports["ms5837"], namespace="/rov1", frame_id="bar30")
        graph = environment(mock=True, domain=domain)
        with adopted(graph):
            rclpy.init()
            node = rclpy.create_node("listener")
            node.create_subscription(FluidPressure, "/rov1/ms5837/pressure", received.append, 10)
            child = subprocess.Popen([sys.executable, "-m", "hindrax_drivers.nodes.device", *words], env=graph)
            try:
                end = time.monotonic() + PATIENT_S
                while not received and time.monotonic() < end:
                    mock.step()
                    rclpy.spin_once(node, timeout_sec=0.0)
            finally:
                child.terminate()
                while child.poll() is None:
                    mock.step()
                node.destroy_node()
                rclpy.shutdown()
    assert received, "no pressure from a device without a vehicle file"
    assert received[0].header.frame_id == "bar30"
    assert child.returncode == 0


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_the_readme_states_what_a_device_publishes(sensor: Sensor) -> None:
    readme = (FOLDER.parent / "README.md").read_text(encoding="utf-8")
    (row,) = (line for line in readme.splitlines() if line.startswith(f"| `{sensor.name}.launch.py` |"))
    for topic in TOPICS_OF[sensor.name].values():
        assert f"`{topic.name}` ({topic.type.replace('/msg/', '/')})" in row
