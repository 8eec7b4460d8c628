"""`hindrax commission` through the whole stack: a thruster wired backwards is named, the file mended, then proven."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.commissioning.record import NotProven, unproven
from hindrax_core.vehicle import load_vehicle

pytestmark = [pytest.mark.ros, pytest.mark.long]


def commissioned(file: Path, out: Path, *words: str) -> tuple[int, Any]:
    """Exit code and document of a commissioning in mock that writes into the file."""
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "hindrax_cli",
            "commission",
            "--mock",
            "--json",
            "--write",
            "--vehicle",
            str(file),
            "--out",
            str(out),
            *words,
        ],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.stdout, done.stderr[-3000:]
    return done.returncode, json.loads(done.stdout)


def test_a_reversed_thruster_is_named_and_mended(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    shutil.copyfile(default_vehicle(), file)
    code, found = commissioned(file, tmp_path / "first", "--fault", "thruster_reversed:T3")
    assert code == 1
    wrong = [row for row in found["findings"] if row["verdict"] == "wrong"]
    assert [(row["claim"], row["mends"]) for row in wrong] == [("T3", ["thrusters.T3.reversed: true"])]
    assert [one.reversed for one in load_vehicle(file).thrusters] == [at == 2 for at in range(8)]
    assert (tmp_path / "first" / "commissioning.svg").read_text(encoding="utf-8").startswith("<svg")
    assert unproven(load_vehicle(file)).code is NotProven.NEVER


def test_a_true_file_gets_its_record(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    shutil.copyfile(default_vehicle(), file)
    code, found = commissioned(file, tmp_path / "run")
    if not found["complete"]:
        # A stack that shares its cores may leave a claim open, which the vehicle is asked for once more.
        assert code == 1
        assert not [row for row in found["findings"] if row["verdict"] == "wrong"], found
        assert unproven(load_vehicle(file)).code is NotProven.NEVER
        code, found = commissioned(file, tmp_path / "again")
    assert (code, found["complete"]) == (0, True), found
    vehicle = load_vehicle(file)
    assert unproven(vehicle) == ""
    assert vehicle.commissioned is not None
    assert vehicle.commissioned.bag == found["bag"]
