"""The launch files describe the same processes as the tool, and what they describe runs.

A stand-in for launch, which is not among the wheels of ROS, takes the words that launch takes and reads the files out;
then the processes are started as launch would start them. Where launch is installed it has its own say.
"""

from __future__ import annotations

import ast
import configparser
import contextlib
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="the mock's own words are read from its process, which imports rclpy")

from ament_index_python import get_package_prefix

from hindrax_bringup import launch_settings, security
from hindrax_bringup.processes import MOCK, ONBOARD, RECORDER, Process
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import PROFILE, own_domain
from hindrax_bringup.stack_lock import FOLDER, LAUNCHED, choose, stacks
from hindrax_sim.nodes.mock import parser as mock_parser

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob("src/hindrax_bringup/launch/*.launch.py"))
ALLOWED = {"launch", "launch_ros", "hindrax_bringup"}
LOCAL = {"output", "on_exit", "respawn", "respawn_delay", "condition"}
KEYWORDS = {
    "LaunchDescription": set(),
    "DeclareLaunchArgument": {"default_value", "description"},
    "SetEnvironmentVariable": set(),
    "ExecuteProcess": {"cmd"} | LOCAL,
    "Shutdown": set(),
    "IfCondition": set(),
    "LaunchConfiguration": set(),
    "NotEqualsSubstitution": set(),
    "OpaqueFunction": {"function", "kwargs"},
    "Node": {"package", "executable", "parameters", "ros_arguments"} | LOCAL,
    "ExecutableInPackage": {"package", "executable"},
    "ParameterValue": {"value_type"},
}
"""What of launch 3.4 and launch_ros 0.26 (Jazzy) the files use, with keywords that these take: see their sources."""


@dataclass
class Said:
    """Whatever a launch file makes: its words and keywords."""

    kind: str
    words: tuple[Any, ...]
    keywords: dict[str, Any]


def take(kind: str, *words: Any, **keywords: Any) -> Said:
    assert set(keywords) <= KEYWORDS[kind], f"{kind} does not take {set(keywords) - KEYWORDS[kind]}"
    return Said(kind, words, keywords)


def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    here = ("launch", "launch.actions", "launch.conditions", "launch.substitutions")
    there = ("launch_ros.actions", "launch_ros.substitutions", "launch_ros.parameter_descriptions")
    for name in (*here, *there):
        module = ModuleType(name)
        module.__getattr__ = lambda kind: partial(take, kind)  # type: ignore[method-assign]
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "launch_ros", ModuleType("launch_ros"))


def described(file: Path) -> list[Said]:
    spec = importlib.util.spec_from_file_location("launch_file", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description().words[0]


def processes(found: list[Said]) -> set[tuple[str, str]]:
    """Package and executable of everything that is started."""
    started = [one for one in found if one.kind == "Node"]
    started += [one.keywords["cmd"][0] for one in found if one.kind == "ExecuteProcess"]
    return {(one.keywords["package"], one.keywords["executable"]) for one in started}


def words_of(found: list[Said]) -> list[str]:
    """Words of the one process that is no node of ROS, with a choice of ours where that of the user stands."""
    (process,) = (one for one in found if one.kind == "ExecuteProcess")
    return [
        one if isinstance(one, str) else {"world": "ideal"}.get(one.words[0], "1")
        for one in process.keywords["cmd"][1:]
    ]


def pairs(wanted: tuple[Process, ...]) -> set[tuple[str, str]]:
    return {(one.package, one.executable) for one in wanted}


def scripts_of(package: str) -> dict[str, str]:
    """Executables of a package, by name."""
    parser = configparser.ConfigParser()
    parser.read(ROOT / "src" / package / "setup.cfg")
    lines = parser["options.entry_points"]["console_scripts"].strip().splitlines()
    return dict(line.replace(" ", "").split("=") for line in lines)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_they_use_launch_and_our_own_packages_only(file: Path) -> None:
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {one.name.partition(".")[0] for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.partition(".")[0])
    assert names - sys.stdlib_module_names <= ALLOWED


@pytest.mark.parametrize("process", [*ONBOARD, RECORDER, MOCK], ids=lambda process: process.name)
def test_every_process_is_an_executable_of_its_package(process: Process) -> None:
    assert scripts_of(process.package)[process.executable] == f"{process.module}:main"


def test_the_vehicle_is_the_onboard_stack_with_its_identities(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch)
    monkeypatch.delenv(PROFILE, raising=False)
    found = described(FILES[-1])
    assert FILES[-1].name == "vehicle.launch.py"
    assert processes(found) == pairs((*ONBOARD, RECORDER))
    nodes = [one for one in found if one.kind == "Node"]
    assert {one.keywords["executable"]: one.keywords["ros_arguments"] for one in nodes} == {
        one.executable: security.arguments(one.name) for one in (*ONBOARD, RECORDER)
    }
    assert all(one.keywords["respawn"] for one in nodes)
    assert all(
        value.keywords == {"value_type": str} for one in nodes for value in one.keywords["parameters"][0].values()
    )
    (recorder,) = (one for one in nodes if one.keywords["executable"] == RECORDER.executable)
    assert [one for one in nodes if "bag" in one.keywords["parameters"][0]] == [recorder], "no other node declares it"
    assert recorder.keywords["condition"].words[0].words == (Said("LaunchConfiguration", ("record",), {}), "")
    set_here = {one.words for one in found if one.kind == "SetEnvironmentVariable"}
    assert any(key == PROFILE and value.endswith("loopback.xml") for key, value in set_here)


def test_the_mock_brings_its_own_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch)
    found = described(ROOT / "src/hindrax_bringup/launch/mock.launch.py")
    assert processes(found) == pairs((*ONBOARD, MOCK))
    words = mock_parser().parse_args(words_of(found))
    (file,) = {one.keywords["parameters"][0] for one in found if one.kind == "Node"}
    parameters = yaml.safe_load(Path(file).read_text())
    assert parameters["/**"]["ros__parameters"]["use_sim_time"]
    assert parameters["/**/dvl75"]["ros__parameters"]["port"] == f"{words.folder}/dvl75"
    assert parameters["/**/icm20948"]["ros__parameters"]["port"] == f"mock:{words.folder}/i2c"


@pytest.mark.parametrize("name", ["mock", "vehicle"])
def test_what_launch_starts_is_found_by_the_commands(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    """As long as launch lives, and with the arguments that it was given."""
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(launch_settings, "_announced", announced := [])
    stand_in(monkeypatch)
    found = described(ROOT / f"src/hindrax_bringup/launch/{name}.launch.py")
    (one,) = (one for one in found if one.kind == "OpaqueFunction")
    arguments = {} if name == "mock" else {"vehicle": "/somewhere/else.yaml", "record": "bag"}
    one.keywords["function"](SimpleNamespace(launch_configurations=arguments), **one.keywords["kwargs"])
    (stack,) = stacks()
    assert (stack.mock, stack.purpose, stack.bag) == (name == "mock", LAUNCHED, arguments.get("record", ""))
    assert stack.vehicle == arguments.get("vehicle", str(default_vehicle()))
    assert stack.graph["FASTRTPS_DEFAULT_PROFILES_FILE"].endswith("loopback.xml")
    assert choose(stacks(), None) == stack
    for file in announced:
        file.close()
    assert stacks() == []


def command(one: Said) -> list[str]:
    """The words that launch would run."""
    if one.kind == "ExecuteProcess":
        program, rest = one.keywords["cmd"][0].keywords, words_of([one])
    else:
        program, rest = one.keywords, ["--ros-args", *one.keywords.get("ros_arguments", [])]
        rest += [word for file in one.keywords["parameters"] for word in ("--params-file", file)]
    return [f"{get_package_prefix(program['package'])}/lib/{program['package']}/{program['executable']}", *rest]


@contextlib.contextmanager
def running(found: list[Said], environment: dict[str, str], log: Path) -> Iterator[None]:
    with log.open("wb") as file:
        started = [
            subprocess.Popen(command(one), env=environment, stdout=file, stderr=file, start_new_session=True)
            for one in found
            if one.kind in ("ExecuteProcess", "Node")
        ]
    try:
        yield
    finally:
        for child in started:
            child.terminate()
        for child in started:
            child.wait(30)


def domain_of(number: int | None) -> dict[str, str]:
    return {} if number is None else {"ROS_DOMAIN_ID": str(number)}


WATCH = """
from hindrax_operator.nodes.operator_node import Operator
with Operator(mock=True) as operator:
    operator.wait(lambda: operator.navigation is not None, 90.0, lambda: "a navigation solution")
"""


@pytest.mark.ros
def test_what_the_mock_file_describes_runs_until_the_vehicle_navigates(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stand_in(monkeypatch)
    found = described(ROOT / "src/hindrax_bringup/launch/mock.launch.py")
    monkeypatch.undo()
    environment = os.environ | {one.words[0]: one.words[1] for one in found if one.kind == "SetEnvironmentVariable"}
    log = tmp_path / "log"
    with own_domain(mock=True) as domain, running(found, environment | domain_of(domain), log):
        watch = [sys.executable, "-c", WATCH]
        seen = subprocess.run(
            watch, env=environment | domain_of(domain), check=False, capture_output=True, text=True, timeout=150
        )
    assert seen.returncode == 0, seen.stderr + log.read_text()


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_launch_itself_takes_them(file: Path) -> None:
    pytest.importorskip("launch_ros", reason="needs a ROS installation: launch is not among the wheels")
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    from launch import LaunchDescription

    description = get_launch_description_from_python_launch_file(str(file))
    assert isinstance(description, LaunchDescription)
    assert description.entities
