"""A stack in a process of its own: refused, killed, and orphaned by its client, with thrusters that turn."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.liveness import processes_of
from hindrax_bringup.process_state import HeldProcesses
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import FOLDER, runtime_folder
from hindrax_bringup.stack_process import StackProcess, UpOptions
from hindrax_core.errors import HindraxError, UsageError
from hindrax_operator.nodes.orders import hold
from hindrax_tools.faults.fault_outcome import HOLD
from hindrax_tools.faults.process_faults import faulty_stack

pytestmark = pytest.mark.ros
PATIENT_S = 30.0


def until(done: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENT_S
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_what_is_refused_is_the_sentence_of_the_client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    run = make_run_folder(str(tmp_path / "run"), default_vehicle())
    options = UpOptions(run.vehicle, MockOptions(world="moon"), out=str(run.path), client="test")
    with StackProcess(options) as stack:
        assert stack.entry.mock
        with pytest.raises(UsageError, match=r"^the mock vehicle refused; .*world moon: found 'moon'") as refused:
            until(stack.check)
    assert "hindrax up" not in str(refused.value)
    assert not list((tmp_path / "runtime").iterdir())


def test_a_stack_whose_supervisor_is_killed_in_flight_ends_neutral(tmp_path: Path) -> None:
    def fly_and_kill() -> None:
        with faulty_stack(tmp_path, 3, record=False) as flying:
            flying.prepare(HOLD)
            hold(flying.operator, ["depth"], 0.8, engaged=True)
            flying.wait(lambda: not flying.neutral, "thrust")
            found = processes_of(runtime_folder(), flying.stack.pid)
            assert {"mock", "sensors", "thrusters", "thrusters_node", "control"} <= found.keys()
            held.append(HeldProcesses(found.values()))
            os.kill(flying.stack.pid, signal.SIGKILL)
            try:
                flying.operator.pause(PATIENT_S)
            finally:
                until(lambda: not held[0]._at_work())
                assert flying.neutral, "the last word of the mock"

    held: list[HeldProcesses] = []
    with pytest.raises(HindraxError, match="its process was killed by signal 9"):
        fly_and_kill()
    held[0].kill(0.0)


CLIENT = """
import sys, time
from pathlib import Path
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_process import StackProcess, UpOptions
run = Path(sys.argv[1])
with StackProcess(UpOptions(run / "vehicle.yaml", MockOptions(), out=str(run), client="test")) as stack:
    stack.entry
    print(stack.pid, flush=True)
    time.sleep(600)
"""


def test_a_client_that_is_killed_takes_its_stack_along(tmp_path: Path) -> None:
    environment = os.environ | {FOLDER: str(tmp_path / "runtime")}
    run = make_run_folder(str(tmp_path / "run"), default_vehicle())
    with subprocess.Popen(
        [sys.executable, "-c", CLIENT, run.path], env=environment, stdout=subprocess.PIPE, text=True
    ) as client:
        assert client.stdout is not None
        pid = int(client.stdout.readline())
        until(lambda: {"mock", "thrusters"} <= processes_of(tmp_path / "runtime", pid).keys())
        held = HeldProcesses([pid, *processes_of(tmp_path / "runtime", pid).values()])
        client.kill()
    until(lambda: not held._at_work())
    held.kill(0.0)
    assert (run.logs / "up.log").read_text().splitlines()[-1] == "hindrax up: stopped by Ctrl-C"
