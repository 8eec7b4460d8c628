"""Ctrl-C in the middle of a plateau: neutral thrusters, a readable bag, no orphan."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bag.read.bag_reader import messages
from hindrax_core.topics import THRUSTER_STATE, resolved

pytestmark = pytest.mark.ros


def test_ctrl_c_in_a_plateau(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    printed = tmp_path / "printed"
    words = ["pool-test", "--mock", "--seed", "5", "--headless", "--out", str(folder)]
    with printed.open("w") as stream:
        flight = subprocess.Popen([sys.executable, "-m", "hindrax_cli", *words], stdout=stream, stderr=stream)
    wait_for(lambda: "plateau" in printed.read_text(), 240.0)
    flight.send_signal(signal.SIGINT)
    assert flight.wait(60.0) == 130
    assert "operator: stopped by Ctrl-C" in printed.read_text()
    states = [one.decoded() for one in messages(folder / "bag", [resolved(THRUSTER_STATE)])]
    assert any(state.armed for state in states)
    assert not states[-1].armed
    assert all(abs(pulse - 1500.0) < 2.0 for pulse in states[-1].pulses)
    assert (folder / "bag" / "metadata.yaml").is_file()
    wait_for(lambda: not processes_of(folder), 10.0)


def wait_for(true: Callable[[], bool], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def processes_of(folder: Path) -> list[str]:
    found = []
    for process in Path("/proc").iterdir():
        try:
            if process.name.isdigit() and str(folder) in (process / "cmdline").read_text(errors="replace"):
                found.append(process.name)
        except OSError:
            continue
    return found
