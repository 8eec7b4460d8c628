"""A vehicle in MuJoCo, whose files our export wrote, flown and identified by the stack over topics."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("mujoco", reason="needs MuJoCo")

from hindrax_bringup.share_files import vehicle_file
from hindrax_bringup.stack import own_domain
from hindrax_core.vehicle import load_vehicle

pytestmark = pytest.mark.ros


def hindrax(environment: dict[str, str], *words: str, seconds: float = 300.0) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hindrax_cli", *words]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=seconds, check=False)


@pytest.fixture
def environment() -> Iterator[dict[str, str]]:
    with own_domain(mock=True) as domain:
        yield os.environ | {"ROS_DOMAIN_ID": str(domain)}


def test_a_vehicle_in_mujoco_is_flown_and_identified_within_its_uncertainty(
    environment: dict[str, str], tmp_path: Path
) -> None:
    exported = hindrax(environment, "export", "--vehicle", "lbv", "--to", "mujoco", "--out", str(tmp_path / "lbv"))
    assert exported.returncode == 0, exported.stderr
    node = [sys.executable, str(tmp_path / "lbv/ros_vehicle.py"), "--ros-args", "-p", "rate:=0.0"]
    words = ["pool-test", "--mock", "--simulator", "mujoco", "--vehicle", "lbv", "--dof", "yaw", "--json"]
    words += ["--set", "pilot.plan.turning_levels:=1"]
    quiet, heard = subprocess.DEVNULL, subprocess.PIPE
    with subprocess.Popen(node, env=environment, text=True, stdout=quiet, stderr=heard) as simulator:
        done = hindrax(environment, *words, "--out", str(tmp_path / "run"))
        simulator.send_signal(signal.SIGINT)  # Ctrl-C, as the page has it run in a terminal
        _, errors = simulator.communicate(timeout=10.0)
    assert (simulator.returncode, "Traceback" in errors) == (0, False), errors
    assert done.returncode == 0, done.stderr[-3000:]
    yaw = json.loads(done.stdout)["motions"]["yaw"]
    truth = load_vehicle(vehicle_file("lbv")).hydrodynamics
    assert truth is not None
    assert yaw["identifiable"] is True
    for name, value in (("k_q", truth.yaw.k_q), ("k_l", truth.yaw.k_l), ("added_mass", truth.added_mass[5])):
        assert yaw[name]["truth"] == pytest.approx(value)
        assert abs(yaw[name]["value"] - value) < 3.0 * yaw[name]["std_calibrated"]
    speed = yaw["drag_force"]["speed"][-1]
    found = yaw["drag_force"]["force"][-1]
    assert found == pytest.approx(truth.yaw.k_q * speed**2 + truth.yaw.k_l * speed, rel=0.1)
