"""What is wrong is said in one sentence with its remedy, and the exit code tells whose fault it is."""

import os
import subprocess
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_cli import command_line

pytestmark = pytest.mark.ros


def refuse(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    code = command_line.main(["pool-test", "--headless", *words])
    return code, capsys.readouterr().err


def test_a_wrong_vehicle_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("name: x\nmass_kg: -3\n")
    code, printed = refuse(capsys, "--mock", "--vehicle", str(file))
    assert code == 2
    assert printed.strip().endswith("bad.yaml: mass_kg: found -3, wanted 0.1 to 100000 (mass [kg])")
    assert len(printed.splitlines()) == 1


def test_an_occupied_folder(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "something").touch()
    code, printed = refuse(capsys, "--mock", "--out", str(tmp_path))
    assert code == 2
    assert "is occupied; name an empty or new folder with --out" in printed
    assert len(printed.splitlines()) == 1


def test_a_fault_that_nobody_knows(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, printed = refuse(capsys, "--mock", "--fault", "gnats:dvl75", "--out", str(tmp_path / "run"))
    assert code == 2
    assert "found 'gnats', wanted one of absent, " in printed


@pytest.mark.root
@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
def test_a_full_disk(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1M", "tmpfs", str(disk)], check=True)
    try:
        code, printed = refuse(capsys, "--mock", "--out", str(disk / "run"))
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    assert code == 1
    assert "is full: 1 MB are free" in printed
    assert len(printed.splitlines()) == 1


def test_missing_ports(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, printed = refuse(capsys, "--out", str(tmp_path / "run"))
    assert code == 1
    assert "found no /dev/hindrax/dvl, " in printed
    assert "check cable and power" in printed
    assert len(printed.splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_port_that_delivers_garbage(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, printed = refuse(capsys, "--mock", "--fault", "baud_mismatch:dvl75@0+900", "--out", str(tmp_path / "run"))
    assert code == 1
    assert "aborted by start: dvl_lock: no bottom lock" in printed
    assert "dvl75: " in printed.split("aborted by")[1]
    assert "nothing was flown" in printed
    says_so(tmp_path / "run")
    (tmp_path / "run/report.html").unlink()
    assert command_line.main(["report", str(tmp_path / "run")]) == 0
    says_so(tmp_path / "run")


def says_so(run: Path) -> None:
    report, coefficients = (run / "report.html").read_text(), yaml.safe_load((run / "coefficients.yaml").read_text())
    assert "aborted: start: dvl_lock</span>" in report
    assert "Nothing was flown" in report
    assert coefficients["aborted"].startswith("start: dvl_lock: no bottom lock")
    assert coefficients["motions"] == {}


def test_options_that_contradict(capsys: pytest.CaptureFixture[str]) -> None:
    code, printed = refuse(capsys, "--rate", "2")
    assert code == 2
    assert "--fault, --world, --rate and --simulator are for --mock only" in printed
