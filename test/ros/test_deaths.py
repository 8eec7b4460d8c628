"""Processes die or freeze, the vehicle does not: each in flight, and wires and the true pose are judged."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bringup.liveness import processes_of
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack_lock import FOLDER, runtime_folder
from hindrax_operator.nodes.orders import hold
from hindrax_tools.faults.fault_outcome import HOLD, MANEUVER, OPERATOR
from hindrax_tools.faults.process_faults import BOTH, DEAD_MAN, DIED, FROZEN, ROWS, FaultyStack, faulty_stack

pytestmark = pytest.mark.ros

SERVICE = Path(__file__).parents[2] / "docker/pi/hindrax.service"
SLOW = 4.0
"""Supervisor and dead man look by the wall's clock: a slow machine has more time than the table of a quiet one."""


@pytest.fixture(scope="module")
def flying(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FaultyStack]:
    """A mock vehicle with its stack."""
    with faulty_stack(tmp_path_factory.mktemp("deaths"), 2, record=False) as stack:
        yield stack


@pytest.mark.parametrize(
    ("who", "what", "mode"),
    [
        ("identifier", DIED, HOLD),
        ("sensors", DIED, HOLD),
        ("sensors", FROZEN, OPERATOR),
        ("sensors", DIED, MANEUVER),
        ("control", DIED, HOLD),
        ("control", FROZEN, HOLD),
        ("thrusters", DIED, HOLD),
        ("thrusters", FROZEN, HOLD),
        (DEAD_MAN, FROZEN, HOLD),
        (BOTH, FROZEN, HOLD),
    ],
)
def test_no_death_and_no_freeze_thrusts_on_a_lie(flying: FaultyStack, who: str, what: str, mode: str) -> None:
    (row,) = [one for one in ROWS if (one.who, one.what) == (who, what)]
    cell = flying.cell(replace(row, within_s=SLOW * row.within_s), mode, 1)
    assert cell.violated == ()
    assert (cell.neutral_s is not None) == bool(cell.reason), "who is neutral for good says why"


def test_what_systemd_runs_after_it_has_killed_everything_puts_neutral_on_the_wire(
    flying: FaultyStack, tmp_path: Path
) -> None:
    operator = flying.operator
    flying.prepare(HOLD)
    hold(operator, ["depth"], 0.8, engaged=True)
    flying.wait(lambda: not flying.neutral, "thrust")
    found = processes_of(runtime_folder(), flying.stack.pid)
    killed = [pid for name, pid in sorted(found.items(), reverse=True) if name != "mock"]
    assert {"thrusters", "thrusters_node"} <= found.keys()
    for pid in killed:
        os.kill(pid, signal.SIGSTOP)
    for pid in killed:
        os.kill(pid, signal.SIGKILL)
    assert not flying.neutral, "then nothing is to be shown"
    file = tmp_path / "vehicle.yaml"
    document = yaml.safe_load(default_vehicle().read_text())
    document["output"]["port"] = flying.port
    file.write_text(yaml.safe_dump(document))
    (line,) = [one for one in SERVICE.read_text().splitlines() if one.startswith("ExecStopPost=")]
    words = line.removeprefix("ExecStopPost=/opt/hindrax/hindrax ").split()
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli", *words, "--vehicle", file],
        env=os.environ | {FOLDER: str(tmp_path / "runtime")},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout == "neutral is on the wire\n"
    flying.wait(lambda: flying.neutral, "neutral in the log of the mock")
    flying.wait(lambda: not operator.armed, "the thrusters to be disarmed")
