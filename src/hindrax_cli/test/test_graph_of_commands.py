"""No command loads the client library before it has the graph of its stack: that is when the library reads it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_bringup.ros_graph import RMW
from hindrax_bringup.stack_lock import CLONE, FOLDER, StackLock, announced

COMMANDS = (
    "arm",
    "disarm",
    "hold depth",
    "recentre",
    "wrench 1 0 0 0 0 0",
    "lights off",
    "thruster disable T1",
    "thruster 1 --force 3 --mock",
    "weigh surge --load 3",
    "joystick",
    "monitor",
    "web --port 0",
    "status",
)
PROGRAM = """
import json, os, sys
from contextlib import contextmanager
from hindrax_bringup import stack
from hindrax_core.errors import HindraxError

joined = []

@contextmanager
def adopted(wanted):
    joined.append(wanted.get("RMW_IMPLEMENTATION") if "rclpy" not in sys.modules else "too late")
    raise HindraxError("as far as this")
    yield

stack.adopted = adopted
from hindrax_cli.command_line import main
from hindrax_operator.monitor import graph_link

sys.stdin.isatty = sys.stderr.isatty = lambda: True
code = main(json.loads(sys.argv[1]))
print(json.dumps([code, joined]))
"""


@pytest.mark.parametrize("words", COMMANDS)
def test_the_library_is_loaded_in_the_graph_of_the_stack(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.delenv(CLONE, raising=False)
    graph = {"ROS_DOMAIN_ID": "7", RMW: "that of the stack"}
    vehicle = str(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
    environment = dict(os.environ) | {RMW: "rmw_cyclonedds_cpp"}
    with announced(StackLock(os.getpid(), mock=True, vehicle=vehicle, folder="runs/a", graph=graph)):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, json.dumps(words.split())],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
    assert done.returncode == 0, done.stderr
    code, joined = json.loads(done.stdout.splitlines()[-1])
    assert joined == ["that of the stack"], done.stderr
    assert code == (0 if words == "status" else 1)
