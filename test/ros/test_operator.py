"""The operator's commands against a stack that is up with the mock vehicle.

One stack for all: started once, driven through arming, holds, a push, a thruster out of use and a stop, then ended. A
command runs in this process, as a process of its own where its environment or its life is what is looked at.
"""

import contextlib
import http.client
import importlib.util
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import psutil
import pytest

from hindrax_bringup.stack_lock import FOLDER
from hindrax_cli.command_line import main

ROOT = Path(__file__).parents[2]
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
PATIENT_S = 120.0

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


@dataclass
class Terminal:
    """Where commands are typed."""

    environment: dict[str, str]
    folder: Path

    def start(self, *words: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "hindrax_cli", *words],
            env=self.environment,
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=(self.folder / f"{words[0]}.err").open("w"),
            text=True,
        )

    def run(self, *words: str) -> tuple[int, str, str]:
        """Code and output of a command in this process: one of its own imports ROS for longer than it does its work."""
        out, wrong = io.StringIO(), io.StringIO()
        here = patch.dict(os.environ, self.environment, clear=True)
        with here, contextlib.redirect_stdout(out), contextlib.redirect_stderr(wrong):
            code = main(words)
        return code, out.getvalue(), wrong.getvalue()

    def spawn(self, *words: str) -> tuple[int, str, str]:
        """The same of a process of its own, as the shell of an operator starts it."""
        child = self.start(*words)
        try:
            out, _ = child.communicate(timeout=PATIENT_S)
        finally:
            child.kill()
        return child.returncode, out, self.errors(words[0])

    def errors(self, command: str) -> str:
        return (self.folder / f"{command}.err").read_text()


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> Terminal:
    folder = tmp_path_factory.mktemp("operator")
    paths = [*SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    environment |= {"PYTHONPATH": os.pathsep.join(paths), FOLDER: str(folder / "runtime")}
    return Terminal(environment, folder)


def line_of(child: subprocess.Popen[str]) -> str:
    assert child.stdout is not None
    return child.stdout.readline()


def wait_for(done: Callable[[], bool], terminal: Terminal) -> None:
    deadline = time.monotonic() + PATIENT_S
    while not done():
        assert time.monotonic() < deadline, terminal.errors("up")
        time.sleep(0.2)


@pytest.fixture(scope="module")
def up(terminal: Terminal) -> Iterator[psutil.Process]:
    """A stack in mock, in a ROS domain of its own; yields the process that looks after it."""
    out = terminal.folder / "run"
    child = terminal.start("up", "--mock", "--record", "--set", "thrusters.arming_s:=1.0", "--out", str(out))
    first = line_of(child)
    assert "mock vehicle, ROS domain" in first, terminal.errors("up")
    wait_for(lambda: {"pilot: ok", "thrusters: ok"} <= set(terminal.errors("up").splitlines()), terminal)
    yield psutil.Process(child.pid)
    family = psutil.Process(child.pid).children(recursive=True)
    child.send_signal(signal.SIGINT)
    assert child.wait(PATIENT_S) == 130, terminal.errors("up")
    assert [one for one in family if one.is_running() and one.status() != psutil.STATUS_ZOMBIE] == []
    assert (out / "bag" / "metadata.yaml").is_file()
    assert list((terminal.folder / "runtime").glob("*.json")) == []


def test_without_a_stack_commands_say_what_is_missing(tmp_path: Path, terminal: Terminal, ros_domain: int) -> None:
    alone = Terminal(terminal.environment | {FOLDER: str(tmp_path), "ROS_DOMAIN_ID": str(ros_domain)}, tmp_path)
    code, _, printed = alone.run("disarm")
    assert code == 1
    assert "the thrusters node to offer thrusters/arm; `./hindrax health` shows the state of its stack" in printed
    code, _, printed = alone.run("stop")
    assert code == 1
    assert "cut the power" in printed


@pytest.mark.usefixtures("up")
def test_nothing_moves_before_it_is_armed(terminal: Terminal) -> None:
    code, _, printed = terminal.run("hold", "heading", "90")
    assert code == 1
    assert "wanted armed; `./hindrax arm` first" in printed
    assert terminal.run("wrench", "5", "0", "0", "0", "0", "0")[:2] == (1, "")


@pytest.mark.usefixtures("up")
def test_armed_it_holds_pushes_and_stops(terminal: Terminal) -> None:
    code, printed, wrong = terminal.run("arm")
    assert code == 0, wrong
    assert "armed (pca9685)" in printed
    code, printed, wrong = terminal.run("hold", "depth", "0.6")
    assert (code, printed) == (0, "holding depth at 0.60 m\n"), wrong
    code, printed, wrong = terminal.run("hold", "heading")
    assert code == 0, wrong
    assert printed.startswith("holding heading at ")
    code, printed, wrong = terminal.run("hold", "roll", "90")
    assert code == 1
    assert "hindrax hold: hold roll: found 90 deg, wanted -55 to 55 deg" in wrong
    code, printed, wrong = terminal.run("wrench", "1000", "0", "0", "0", "0", "0")
    assert (code, printed) == (2, "")
    assert "wrench X: found 1000, wanted -60 to 60 (limits of the vehicle file)" in wrong
    code, printed, wrong = terminal.run("wrench", "10", "0", "0", "0", "0", "0", "--for", "1")
    assert code == 0, wrong
    achieved = float(printed.partition("including holds: X ")[2].split()[0])
    assert achieved == pytest.approx(10.0, abs=2.0)
    code, printed, wrong = terminal.run("recentre", "5", "2")
    assert (code, printed) == (0, "the vehicle is 5.00 m from the south wall, 2.00 m from the west wall\n"), wrong
    code, printed, wrong = terminal.run("recentre", "5", "60")
    assert (code, printed) == (1, "")
    assert "recentre: y: found 60 m, wanted 0." in wrong
    code, printed, wrong = terminal.run("hold", "all", "off")
    assert code == 0, wrong
    code, printed, wrong = terminal.run("stop")
    assert code == 0, wrong
    assert printed.startswith("stopped and disarmed: hindrax (mock), ROS domain")
    assert "the thrusters are disarmed (by request)" in terminal.run("hold", "depth")[2]


FOREIGN = {
    "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp",
    "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
    "ROS_LOCALHOST_ONLY": "1",
    "FASTDDS_DEFAULT_PROFILES_FILE": "/nowhere.xml",
    "ROS_SECURITY_ENABLE": "true",
}
"""Settings of a shell that serves another robot."""


def test_a_shell_of_another_graph_arms_steers_and_stops_this_stack(terminal: Terminal, up: psutil.Process) -> None:
    foreign = Terminal(terminal.environment | FOREIGN, terminal.folder)
    code, _, wrong = foreign.spawn("arm")
    assert code == 0, wrong
    assert wrong.splitlines()[0].startswith("vehicle: hindrax (mock), ROS domain ")
    assert f"process {up.pid}, {terminal.folder / 'run'}" in wrong
    assert foreign.spawn("hold", "heading")[0] == 0
    for words in (["hold", "heading"], ["arm"], ["wrench", "5", "0", "0", "0", "0", "0"]):
        away = Terminal(terminal.environment | {"ROS_DOMAIN_ID": "230"}, terminal.folder)
        code, printed, wrong = away.run(*words)
        assert (code, printed) == (2, "")
        assert f"and ROS_DOMAIN_ID=230 is set here; if you mean it, add --stack {up.pid}" in wrong
    (thrusters,) = (one for one in up.children() if "hindrax_drivers.nodes.deadman" in one.cmdline())
    broken = Terminal(foreign.environment | {"ROS_DOMAIN_ID": "300"}, terminal.folder)
    code, printed, wrong = broken.spawn("stop", "--stack", str(up.pid))
    assert (code, wrong) == (0, "")
    assert printed == f"stopped and disarmed: {whole_title(terminal, up)}\n"
    assert thrusters.is_running()
    assert "wanted armed" in terminal.run("wrench", "5", "0", "0", "0", "0", "0")[2]


def test_a_stop_needs_no_ros_at_all(terminal: Terminal, up: psutil.Process) -> None:
    assert terminal.run("arm")[0] == 0
    without = Terminal(terminal.environment | {"LD_LIBRARY_PATH": ""}, terminal.folder)
    code, printed, wrong = without.spawn("stop")
    assert code == 0
    assert printed == f"stopped and disarmed: {whole_title(terminal, up)}\n"
    assert "disarmed, but over ROS nothing could be cancelled (ROS: ended with code 1" in wrong
    assert "wanted armed" in terminal.run("wrench", "5", "0", "0", "0", "0", "0")[2]


def whole_title(terminal: Terminal, up: psutil.Process) -> str:
    document = json.loads((terminal.folder / "runtime" / f"{up.pid}.json").read_text())
    domain = document["graph"]["ROS_DOMAIN_ID"]
    return f"hindrax (mock), ROS domain {domain}, process {up.pid}, {terminal.folder / 'run'}"


@pytest.mark.usefixtures("up")
def test_a_thruster_stays_out_of_use_though_its_command_has_ended(terminal: Terminal) -> None:
    code, printed, wrong = terminal.run("thruster", "disable", "T3", "T4", "--reason", "blade lost")
    assert (code, printed) == (0, "disabled: T3, T4; lost axes: sway\n"), wrong
    code, printed, wrong = terminal.run("thruster", "enable", "T4", "--json")
    assert json.loads(printed) == {"disabled": ["T3"], "lost_axes": []}, wrong
    for what in ("disable", "enable"):
        code, _, wrong = terminal.run("thruster", what, "T3", "T12")
        assert code == 1
        assert "found no thruster T12; the vehicle has T1" in wrong
    assert terminal.run("thruster", "enable", "T3", "T4")[1] == "disabled: none\n"


def test_a_control_process_that_comes_back_is_reported_what_is_out_of_use(
    terminal: Terminal, up: psutil.Process
) -> None:
    assert terminal.run("thruster", "disable", "T3", "T4")[0] == 0
    (control,) = (one for one in up.children() if one.name() == "control")
    control.kill()
    wait_for(lambda: "control was killed by signal 9; restarted" in terminal.errors("up"), terminal)
    for _ in range(10):  # a process that starts on a busy machine takes longer than the command waits
        code, printed, wrong = terminal.run("thruster", "enable", "T4", "--json")
        if code == 0:
            break
    assert code == 0, wrong
    assert json.loads(printed)["disabled"] == ["T3"]
    assert terminal.run("thruster", "enable", "T3", "T4")[1] == "disabled: none\n"
    # Where it is in the pool only a person knows now.
    wait_for(
        lambda: "pilot: pool_box: the vehicle was armed before this pilot began" in terminal.errors("up"), terminal
    )
    for _ in range(10):
        code, _, wrong = terminal.run("recentre")
        if code == 0:
            break
    assert code == 0, wrong


@pytest.mark.usefixtures("up")
def test_a_thruster_alone_is_refused_beside_control(terminal: Terminal) -> None:
    code, _, wrong = terminal.run("thruster", "2", "--force", "3", "--mock")
    assert code == 1
    assert "the control process commands the thrusters" in wrong


@pytest.mark.usefixtures("up")
def test_the_doctor_asks_the_nodes_of_a_stack_that_is_up(terminal: Terminal) -> None:
    for _ in range(15):  # a node may just be looking for its lock, or reports late while a busy mock goes slowly
        code, printed, _ = terminal.run("doctor", "--mock", "--json")
        if code == 0:
            break
    checks = {one["name"]: one for one in json.loads(printed)["checks"]}
    assert checks["stack"]["found"].startswith("mock vehicle")
    assert {"dvl75", "ping1d", "icm20948", "ms5837", "thrusters", "pilot"} <= set(checks)
    assert code == 0, [one for one in checks.values() if not one["ok"]]


@pytest.mark.usefixtures("up")
def test_the_page_flies_an_armed_vehicle_and_stops_it_in_mid_maneuver(terminal: Terminal) -> None:
    child = terminal.start("web", "--port", "0")
    try:
        found = re.fullmatch(r"web: http://(127\.0\.0\.1:\d+)/#(\S+)\n", line_of(child))
        assert found, terminal.errors("web")

        def ask(path: str, words: Mapping[str, object] | None = None) -> tuple[int, str]:
            """Status and first line."""
            body = None if words is None else json.dumps(words)
            headers = {"Authorization": f"Bearer {found[2]}", "Content-Type": "application/json"}
            with contextlib.closing(http.client.HTTPConnection(found[1], timeout=PATIENT_S)) as connection:
                connection.request("GET" if words is None else "POST", path, body, headers)
                with connection.getresponse() as answer:
                    return answer.status, answer.readline().decode()

        def state() -> dict[str, Any]:
            reported: dict[str, Any] = json.loads(ask("/events")[1].removeprefix("data: "))
            return reported

        surge = {"motions": ["surge"]}
        assert ask("/fly", surge)[0] == 409, "nothing flies before it is armed"
        code, _, wrong = terminal.run("arm")
        assert code == 0, wrong
        wait_for(lambda: ask("/fly", surge)[0] == 202, terminal)
        wait_for(lambda: (state()["flight"] or {}).get("motion") == "surge", terminal)
        assert ask("/stop", {})[0] == 202
        wait_for(lambda: len(state()["outcomes"]) == 2, terminal)
        output = {one["sentence"]: one["well"] for one in state()["outcomes"]}
        assert output.pop("stop: stopped and disarmed") is True
        ((flown, well),) = output.items()
        assert flown.startswith("fly: the maneuver ended early, by ")
        assert not well
        wait_for(lambda: state()["thrusters"]["state"] == "disarmed", terminal)
    finally:
        child.send_signal(signal.SIGINT)
        assert child.wait(PATIENT_S) == 130, terminal.errors("web")
