"""Parameters of the thrusters process, read without ROS as ROS reads them."""

from pathlib import Path

import pytest

from hindrax_core.errors import UsageError
from hindrax_core.topics import NAMESPACE
from hindrax_drivers.nodes.thruster_settings import Settings, namespace_of, read_settings
from hindrax_drivers.output.output_guard import OutputGuardKnobs, Pulses

VEHICLE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"


def written(folder: Path, text: str) -> list[str]:
    file = folder / "parameters.yaml"
    file.write_text(text.replace("VEHICLE", str(VEHICLE)), encoding="utf-8")
    return ["--ros-args", "--params-file", str(file)]


def read(folder: Path, text: str, *more: str) -> Settings:
    return read_settings([*written(folder, text), *more])


FILE = """
/**: {ros__parameters: {vehicle: VEHICLE, use_sim_time: true}}
PATTERN: {ros__parameters: {port: "mock:/tmp/i2c", clock: "mock:/tmp/i2c"}}
/hindrax/dvl75: {ros__parameters: {port: /dev/ttyUSB7}}
"""


@pytest.mark.parametrize("pattern", ["/**/thrusters", "/hindrax/thrusters", "/*/thrusters", "hindrax/thrusters"])
def test_blocks_of_this_node_count(tmp_path: Path, pattern: str) -> None:
    settings = read(tmp_path, FILE.replace("PATTERN", pattern))
    assert (settings.port, settings.clock) == ("mock:/tmp/i2c", "mock:/tmp/i2c")
    assert settings.vehicle.name == "hindrax"


@pytest.mark.parametrize("pattern", ["/**/recorder", "/other/thrusters", "thrusters", "/hindrax/thrusters2"])
def test_blocks_of_other_nodes_do_not(tmp_path: Path, pattern: str) -> None:
    settings = read(tmp_path, FILE.replace("PATTERN", pattern))
    assert (settings.port, settings.clock) == ("/dev/i2c-1", "system")


def test_a_word_on_the_command_line_wins(tmp_path: Path) -> None:
    text = FILE.replace("PATTERN", "/**/thrusters")
    settings = read(tmp_path, text, "-p", "port:=/dev/i2c-4", "-p", "thrusters:clock:=system")
    assert (settings.port, settings.clock) == ("/dev/i2c-4", "system")


def test_the_knobs_of_the_guard_are_read_and_judged_as_the_node_does(tmp_path: Path) -> None:
    text = FILE.replace("PATTERN", "/**/thrusters").replace("clock:", "neutral_us: 1480, clock:")
    assert read(tmp_path, text).knobs == OutputGuardKnobs(neutral_us=1480.0)
    changed = read(tmp_path, text, "-p", "light_off_us:=900.0").guard
    assert changed.neutral == Pulses((1480.0,) * 8, (900.0,) * 2)
    with pytest.raises(UsageError, match="neutral_us: found 900, wanted 1100 to 1900; without it: by the vehicle file"):
        read(tmp_path, text, "-p", "neutral_us:=900")
    with pytest.raises(UsageError, match="neutral_us: found 1950, wanted 1100 to 1900"):
        read(tmp_path, text, "-p", "neutral_us:=1950")
    with pytest.raises(UsageError, match="neutral_us: found 0, wanted 1100 to 1900"):
        read(tmp_path, text, "-p", "neutral_us:=0")
    with pytest.raises(UsageError, match="neutral_us: found 0, wanted 1100 to 1900"):
        read(tmp_path, FILE.replace("PATTERN", "/**/thrusters").replace("clock:", "neutral_us: 0, clock:"))


def test_the_vehicle_file_may_be_all_there_is() -> None:
    settings = read_settings(["--ros-args", "-p", f"vehicle:={VEHICLE}"])
    assert (settings.port, settings.clock, settings.alone) == ("/dev/i2c-1", "system", False)
    assert settings.knobs == OutputGuardKnobs()
    assert not Settings(settings.vehicle, settings.port).alone


def test_what_is_missing_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no vehicle file"):
        read_settings([])
    with pytest.raises(UsageError, match="cannot be read"):
        read_settings(["--ros-args", "--params-file", str(tmp_path / "nothing.yaml")])
    with pytest.raises(UsageError, match="is not YAML"):
        read(tmp_path, "{")
    with pytest.raises(UsageError, match="no vehicle file"):
        read(tmp_path, "[1, 2]")


def test_nested_blocks_of_an_output_without_a_vehicle_file_count_as_ros_reads_them(tmp_path: Path) -> None:
    text = "/**/thrusters: {ros__parameters: {channels: [3, 4], output: {address: 65, port: /dev/i2c-7}}}"
    settings = read(tmp_path, text)
    assert (settings.vehicle.output.address, settings.port) == (65, "/dev/i2c-7")
    assert settings.alone
    assert [(one.name, one.channel) for one in settings.vehicle.thrusters] == [("T1", 3), ("T2", 4)]


@pytest.mark.parametrize(
    ("words", "namespace"),
    [
        ([], NAMESPACE),
        (["-r", "__node:=thrusters", "-p", "__ns:=/no_rule"], NAMESPACE),
        (["-r", "__ns:=/rov1"], "/rov1"),
        (["--remap", "__ns:=/rov1/"], "/rov1"),
        (["-r", "__ns:=/rov1", "-r", "a:=b", "-r", "__ns:=/rov2", "-r", "__ns:=/rov3"], "/rov3"),
    ],
)
def test_the_last_rule_for_the_namespace_counts(words: list[str], namespace: str) -> None:
    assert namespace_of(["--ros-args", *words]) == namespace
