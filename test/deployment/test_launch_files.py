"""The launch files start the process that `hindrax up` becomes, and what they start runs.

A stand-in for launch, which is not among the wheels of ROS, takes the words that launch takes; then the process is
started as launch would start it. Where launch is installed it has its own say.
"""

import ast
import configparser
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from launch_stand_in import Said, actions_of, put_in_place, said

from hindrax_bringup import child_process
from hindrax_bringup.network.tether import Tether
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import MOCK, ONBOARD, RECORDER, SENSORS, Process
from hindrax_bringup.ros_graph import PROFILE
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, environment, own_domain
from hindrax_bringup.stack_lock import FOLDER, stacks
from hindrax_bringup.stack_process import RUNNER, UpOptions
from hindrax_bringup.supervisor import PATIENCE_S
from hindrax_core.vehicle import load_vehicle

ROOT = Path(__file__).parents[2]
FILES = sorted(
    set(ROOT.glob("src/hindrax_bringup/launch/*.launch.py"))
    - {ROOT / "src/hindrax_bringup/launch/ros2_control.launch.py"}
)
"""Those of a whole stack; the one of single nodes beside ros2_control is run in `test/ros/test_ros2_control.py`."""
ACTIONS = "hindrax_bringup.launch_actions"
KEYWORDS = {
    "LaunchDescription": set(),
    "DeclareLaunchArgument": {"default_value", "description"},
    "ExecuteProcess": {"cmd", "additional_env", "output", "on_exit", "sigterm_timeout", "sigkill_timeout"},
    "OpaqueFunction": {"function"},
    "Shutdown": {"reason"},
}
"""What of launch 3.4 (Jazzy) the files use, with keywords that it takes: see its sources."""


def take(kind: str, *words: Any, **keywords: Any) -> Said:
    assert set(keywords) <= KEYWORDS[kind], f"{kind} does not take {set(keywords) - KEYWORDS[kind]}"
    return said(kind, *words, **keywords)


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    put_in_place(monkeypatch, take)
    monkeypatch.delitem(sys.modules, ACTIONS, raising=False)
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    monkeypatch.delenv(PROFILE, raising=False)
    yield
    sys.modules.pop(ACTIONS, None)


def described(name: str) -> tuple[dict[str, str], Said]:
    """Arguments of a launch file with their defaults, and what it does once they are known."""
    *declared, action = actions_of(ROOT / f"src/hindrax_bringup/launch/{name}.launch.py")
    return {one.words[0]: one.keywords["default_value"] for one in declared}, action


def executed(name: str, **chosen: str) -> Said:
    """The process that a launch file starts with these arguments."""
    defaults, action = described(name)
    context = SimpleNamespace(launch_configurations=defaults | chosen)
    (process,) = cast("list[Said]", action.keywords["function"](context))
    assert process.kind == "ExecuteProcess"
    return process


def options_of(process: Said) -> UpOptions:
    """Options of the stack that it is."""
    *words, options = process.keywords["cmd"]
    assert words == child_process.command_line(RUNNER, []), "it ends with the launch"
    return UpOptions.from_json(options)


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
            names.add(str(node.module).partition(".")[0])
    assert names - sys.stdlib_module_names <= {"launch", "hindrax_bringup"}


@pytest.mark.parametrize("process", [*ONBOARD, RECORDER, MOCK], ids=lambda process: process.name)
def test_every_process_is_an_executable_of_its_package(process: Process) -> None:
    assert scripts_of(process.package)[process.name] == f"{process.module}:main"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
@pytest.mark.usefixtures("stand_in")
def test_asking_for_the_arguments_makes_no_file_and_waits_for_nothing(
    file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HINDRAX_TETHER", "nowhere0")
    defaults, _ = described(file.name.partition(".")[0])
    assert {"vehicle", "namespace", "params_file", "record", "without_operator"} <= set(defaults)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("stand_in")
def test_a_launched_stack_is_the_one_that_up_starts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HINDRAX_TETHER", "nowhere0")
    (tmp_path / "mine.yaml").write_text("/**/pilot: {ros__parameters: {holds: {turn_radps: 0.3}}}", encoding="utf-8")
    chosen = {"vehicle": str(default_vehicle()), "namespace": "/rov1", "params_file": str(tmp_path / "mine.yaml")}
    assert options_of(executed("vehicle", without_operator="neutral", **chosen)) == UpOptions(
        default_vehicle(),
        tether=Tether("nowhere0"),
        launched=True,
        without_operator="neutral",
        tuning=ParameterOverrides("/rov1", str(tmp_path / "mine.yaml")),
    )
    assert options_of(executed("vehicle")).without_operator == "stay"


@pytest.mark.usefixtures("stand_in")
def test_a_bag_is_in_the_folder_that_is_named(tmp_path: Path) -> None:
    options = options_of(executed("vehicle", record=str(tmp_path / "dive")))
    assert (options.record, options.out) == (True, str(tmp_path / "dive"))


@pytest.mark.usefixtures("stand_in")
def test_the_mock_is_reported_what_was_chosen_and_keeps_to_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HINDRAX_TETHER", "nowhere0")
    options = options_of(executed("mock", seed="7", rate="2", faults="garbage:dvl75@30+5 no_power@50"))
    assert options.mock == MockOptions(7, 2.0, ("garbage:dvl75@30+5", "no_power@50"))
    assert options.tether is None


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("name", ["mock", "vehicle"])
def test_the_launch_ends_with_its_stack_and_gives_it_the_time_to_leave_neutral(name: str) -> None:
    process = executed(name)
    assert process.keywords["on_exit"].kind == "Shutdown"
    assert min(float(process.keywords[one]) for one in ("sigterm_timeout", "sigkill_timeout")) > sum(PATIENCE_S)


WATCH = """
import json, sys
from hindrax_operator.nodes.operator_node import Operator
wanted = set(json.loads(sys.argv[1]))
with Operator(mock=True) as operator:
    operator.wait(lambda: operator.navigation is not None, 90.0, lambda: "a navigation solution")
    there = lambda: {name for name, space in operator.node.get_node_names_and_namespaces() if space == "/hindrax"}
    operator.wait(lambda: wanted <= there(), 30.0, lambda: f"the nodes {wanted - there()}")
"""


@pytest.mark.ros
@pytest.mark.usefixtures("stand_in")
def test_what_the_mock_file_describes_runs_until_the_vehicle_navigates(tmp_path: Path) -> None:
    process = executed("mock", record=str(tmp_path / "run"))
    log = tmp_path / "log"
    wanted = {node for one in (MOCK, *ONBOARD) for node in one.nodes}
    wanted -= set(SENSORS.nodes) - set(load_vehicle(default_vehicle()).sensors)
    with own_domain(mock=True) as domain, log.open("wb") as file:
        around = environment(mock=True, domain=domain)
        child = subprocess.Popen(
            process.keywords["cmd"], env=around | process.keywords["additional_env"], stdout=file, stderr=file
        )
        try:
            watch = [sys.executable, "-c", WATCH, json.dumps(sorted(wanted))]
            seen = subprocess.run(watch, env=around, check=False, capture_output=True, text=True, timeout=150)
            (lock,) = stacks()
        finally:
            child.send_signal(signal.SIGINT)
            code = child.wait(60)
    assert seen.returncode == 0, seen.stderr + log.read_text()
    assert (lock.pid, lock.bag) == (child.pid, str(tmp_path / "run" / "bag"))
    assert (code, log.read_text().splitlines()[-1]) == (0, "hindrax up: stopped by Ctrl-C")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_launch_itself_takes_them(file: Path) -> None:
    pytest.importorskip("launch_ros", reason="needs a ROS installation: launch is not among the wheels")
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    from launch import LaunchDescription

    description = get_launch_description_from_python_launch_file(str(file))
    assert isinstance(description, LaunchDescription)
    assert description.entities
