"""The launch files describe the same processes as the tool. Where launch is not installed a stand-in reads them out."""

from __future__ import annotations

import ast
import configparser
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="the mock's own words are read from its process, which imports rclpy")

from hindrax_bringup import security
from hindrax_bringup.stack import PROFILE
from hindrax_bringup.system import MOCK, ONBOARD, RECORDER, Process
from hindrax_sim.nodes.mock import parser as mock_parser

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob("src/hindrax_bringup/launch/*.launch.py"))
ALLOWED = {"launch", "launch_ros", "hindrax_bringup"}


@dataclass
class Said:
    """Whatever a launch file makes: its words and keywords."""

    kind: str
    words: tuple[Any, ...]
    keywords: dict[str, Any]


def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    here = ("launch", "launch.actions", "launch.conditions", "launch.substitutions")
    for name in (*here, "launch_ros.actions", "launch_ros.substitutions"):
        module = ModuleType(name)
        module.__getattr__ = lambda kind: lambda *words, **keywords: Said(kind, words, keywords)  # type: ignore[method-assign]
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
    """Words of the one process that is no node of ROS, with numbers where the user's choice stands."""
    (process,) = (one for one in found if one.kind == "ExecuteProcess")
    return [one if isinstance(one, str) else "1" for one in process.keywords["cmd"][1:]]


def pairs(wanted: tuple[Process, ...]) -> set[tuple[str, str]]:
    return {(one.package, one.executable) for one in wanted}


def scripts_of(package: str) -> dict[str, str]:
    """Executables of a package, by name."""
    parser = configparser.ConfigParser()
    parser.read(ROOT / "src" / package / "setup.cfg")
    lines = parser["options.entry_points"]["console_scripts"].strip().splitlines()
    return dict(line.replace(" ", "").split("=") for line in lines)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_they_use_launch_and_our_own_packages_only(file):
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {one.name.partition(".")[0] for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.partition(".")[0])
    assert names - sys.stdlib_module_names <= ALLOWED


@pytest.mark.parametrize("process", [*ONBOARD, RECORDER, MOCK], ids=lambda process: process.name)
def test_every_process_is_an_executable_of_its_package(process):
    assert scripts_of(process.package)[process.executable] == f"{process.module}:main"


def test_the_vehicle_is_the_onboard_stack_with_its_identities(monkeypatch):
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
    set_here = {one.words for one in found if one.kind == "SetEnvironmentVariable"}
    assert any(key == PROFILE and value.endswith("loopback.xml") for key, value in set_here)


def test_the_mock_brings_its_own_vehicle(monkeypatch):
    stand_in(monkeypatch)
    found = described(ROOT / "src/hindrax_bringup/launch/mock.launch.py")
    assert processes(found) == pairs((*ONBOARD, MOCK))
    words = mock_parser().parse_args(words_of(found))
    (file,) = {one.keywords["parameters"][0] for one in found if one.kind == "Node"}
    parameters = yaml.safe_load(Path(file).read_text())
    assert parameters["/**"]["ros__parameters"]["use_sim_time"]
    assert parameters["/**/dvl75"]["ros__parameters"]["port"] == f"{words.folder}/dvl75"
    assert parameters["/**/icm20948"]["ros__parameters"]["port"] == f"mock:{words.folder}/i2c"
