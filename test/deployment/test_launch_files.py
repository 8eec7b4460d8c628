"""The launch files start the same stack as the tool, and what they start runs.

A stand-in for launch, which is not among the wheels of ROS, takes the words that launch takes; then the processes are
started as launch would start them. Where launch is installed it has its own say.
"""

import ast
import configparser
import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import yaml
from launch_stand_in import Said, actions_of, put_in_place, said

pytest.importorskip("rclpy", reason="the mock's own words are read from its process, which imports rclpy")

from ament_index_python import get_package_prefix

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import MOCK, ONBOARD, RECORDER, SENSORS, Process
from hindrax_bringup.ros_graph import PROFILE
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, own_domain
from hindrax_bringup.stack_lock import FOLDER, LAUNCHED, stacks
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.nodes.mock import parser as mock_parser

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob("src/hindrax_bringup/launch/*.launch.py"))
ACTIONS = "hindrax_bringup.launch_actions"
LOCAL = {"output", "on_exit", "respawn", "respawn_delay"}
KEYWORDS = {
    "LaunchDescription": set(),
    "DeclareLaunchArgument": {"default_value", "description"},
    "SetEnvironmentVariable": set(),
    "ExecuteProcess": {"cmd"} | LOCAL,
    "OpaqueFunction": {"function", "args"},
    "OnProcessIO": {"target_action", "on_stdout"},
    "RegisterEventHandler": set(),
    "Shutdown": {"reason"},
    "Node": {"package", "executable", "parameters", "ros_arguments"} | LOCAL,
    "ExecutableInPackage": {"package", "executable"},
}
"""What of launch 3.4 and launch_ros 0.26 (Jazzy) the files use, with keywords that these take: see their sources."""


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


def executed(name: str, **chosen: str) -> list[Said]:
    """Actions of a launch file with these arguments, at once and once the mock has said that its devices are there."""
    defaults, action = described(name)
    context = SimpleNamespace(launch_configurations=defaults | chosen)
    found = cast("list[Said]", action.keywords["function"](context, *action.keywords["args"]))
    waiting = [one.words[0].keywords["on_stdout"] for one in found if one.kind == "RegisterEventHandler"]
    return [*found, *(one for at_first_word in waiting for one in at_first_word(None))]


def processes(found: Sequence[Said]) -> set[tuple[str, str]]:
    """Package and executable of everything that is started."""
    started = [one for one in found if one.kind == "Node"]
    started += [one.keywords["cmd"][0] for one in found if one.kind == "ExecuteProcess"]
    return {(one.keywords["package"], one.keywords["executable"]) for one in started}


def words_of(found: Sequence[Said]) -> list[str]:
    """Words of the one process that is no node of ROS."""
    (process,) = (one for one in found if one.kind == "ExecuteProcess")
    return list(process.keywords["cmd"][1:])


def pairs(wanted: tuple[Process, ...]) -> set[tuple[str, str]]:
    return {(one.package, one.name) for one in wanted}


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
def test_the_nodes_start_when_the_tether_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HINDRAX_TETHER", "nowhere0")
    (waiting,) = executed("vehicle")
    assert waiting.keywords["cmd"] == [sys.executable, "-m", "hindrax_bringup.network.tether"]
    given_up = waiting.keywords["on_exit"](SimpleNamespace(returncode=1), None)
    assert given_up.kind == "Shutdown"


class Started(Supervisor):
    """A supervisor that starts nothing, and keeps what it was to start."""

    def __init__(self, facts: Mapping[str, object]) -> None:
        super().__init__(Path("logs"), {})
        self.facts, self.words = facts, dict[Process, list[str]]()

    def start(self, process: Process, arguments: Sequence[str] = (), *, pipe: bool = False) -> Any:
        assert not pipe
        self.words[process] = list(arguments)


def told(words: Sequence[str], parameters: str) -> tuple[list[str], Any]:
    """ROS arguments of a process, and the content of its parameter file."""
    return list(words), yaml.safe_load(Path(parameters).read_text(encoding="utf-8"))


MINE = "/**/pilot: {ros__parameters: {holds: {turn_radps: 0.3}}}"


@pytest.mark.parametrize("mock", [False, True])
@pytest.mark.usefixtures("stand_in")
def test_both_ways_start_the_same_stack(mock: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Same processes, in the same order, with the same parameters and ROS arguments: so the same nodes and topics."""
    mine, folder = tmp_path / "mine.yaml", make_run_folder(str(tmp_path / "run"), default_vehicle())
    mine.write_text(MINE, encoding="utf-8")
    chosen = {"vehicle": str(folder.vehicle), "namespace": "/rov1", "params_file": str(mine), "record": str(folder.bag)}
    found = executed("mock" if mock else "vehicle", without_operator="neutral", **chosen)
    launched = [one for one in found if one.kind == "Node"]
    (lock,) = stacks()
    assert (lock.mock, lock.namespace, lock.purpose) == (mock, "/rov1", LAUNCHED)
    facts = {"ports": lock.ports, "clock": lock.ports.get("thrusters", "")}

    supervisor = Started(facts)
    monkeypatch.setattr(Stack, "start_mock", lambda self, *_: setattr(self, "mock_facts", facts))
    Stack(folder, supervisor, "ros2 launch", ParameterOverrides("/rov1", str(mine))).start(
        MockOptions() if mock else None, record=True, without_operator="neutral"
    )
    assert processes(launched) == pairs((*ONBOARD, RECORDER))
    assert [one.keywords["executable"] for one in launched] == [one.name for one in supervisor.words]
    for one, (process, words) in zip(launched, supervisor.words.items(), strict=True):
        assert words[:2] == ["--ros-args", "--params-file"]
        launch_way = told(one.keywords["ros_arguments"], one.keywords["parameters"][0])
        assert launch_way == told(words[3:], words[2]), process.name
        assert launch_way[1]["/**/pilot"] == {"ros__parameters": {"holds.turn_radps": 0.3}}
        assert launch_way[1]["/**"]["ros__parameters"].get("use_sim_time", False) is mock
        assert one.keywords["respawn"]


@pytest.mark.usefixtures("stand_in")
def test_the_nodes_start_once_when_the_devices_of_the_mock_are_there() -> None:
    *at_once, handler, mock, _, _, _, _, _ = executed("mock")
    assert {one.kind for one in at_once} == {"SetEnvironmentVariable"}
    assert (handler.kind, mock.kind) == ("RegisterEventHandler", "ExecuteProcess")
    (at_first_word,) = handler.words
    assert at_first_word.keywords["target_action"] is mock
    assert at_first_word.keywords["on_stdout"](None) is None, "its later words start nothing"


@pytest.mark.usefixtures("stand_in")
def test_the_mock_is_reported_what_was_chosen_and_ends_the_rest_when_it_dies() -> None:
    found = executed("mock", seed="7", rate="2", namespace="/rov2", faults="garbage:dvl75@30+5 no_power@50")
    words = mock_parser().parse_args(words_of(found))
    assert (words.seed, words.rate, words.namespace) == (7, 2.0, "/rov2")
    assert words.fault == ["garbage:dvl75@30+5", "no_power@50"]
    (lock,) = stacks()
    assert lock.ports["dvl75"] == f"{words.folder}/dvl75"
    assert lock.ports["icm20948"] == f"mock:{words.folder}/i2c"
    (mock,) = (one for one in found if one.kind == "ExecuteProcess")
    assert mock.keywords["on_exit"].kind == "Shutdown"


@pytest.mark.usefixtures("stand_in")
def test_a_process_that_refuses_what_it_was_given_is_not_started_for_ever() -> None:
    thrusters = next(one for one in executed("vehicle") if one.keywords.get("executable") == "thrusters")
    assert thrusters.keywords["on_exit"](SimpleNamespace(returncode=-9), None) is None
    assert thrusters.keywords["on_exit"](SimpleNamespace(returncode=UsageError.exit_code), None).kind == "Shutdown"


@pytest.mark.usefixtures("stand_in")
def test_the_graph_of_a_launched_vehicle_keeps_to_this_machine() -> None:
    set_here = {one.words for one in executed("vehicle") if one.kind == "SetEnvironmentVariable"}
    assert any(key == PROFILE and value.endswith("loopback.xml") for key, value in set_here)


def command(one: Said) -> list[str]:
    """The words that launch would run."""
    if one.kind == "ExecuteProcess":
        program, rest = one.keywords["cmd"][0].keywords, words_of([one])
    else:
        program, rest = one.keywords, ["--ros-args", *one.keywords["ros_arguments"]]
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
    found = executed("mock")
    environment = os.environ | {one.words[0]: one.words[1] for one in found if one.kind == "SetEnvironmentVariable"}
    log = tmp_path / "log"
    wanted = {node for process in (MOCK, *ONBOARD) for node in process.nodes}
    wanted -= set(SENSORS.nodes) - set(load_vehicle(default_vehicle()).sensors)
    with own_domain(mock=True) as domain, running(found, environment | domain_of(domain), log):
        watch = [sys.executable, "-c", WATCH, json.dumps(sorted(wanted))]
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
