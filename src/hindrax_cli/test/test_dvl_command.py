"""`hindrax dvl` on a pty with the emulated DVL behind it."""

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_cli.command_line import main
from hindrax_sim.buses.serial_ends import Pty, UdpEnd
from hindrax_sim.devices.dvl75 import Dvl75, DvlSettings, DvlTruth
from hindrax_sim.testing.mock_wires import serial_device


@pytest.fixture(params=["serial", "network"])
def dvl(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, Dvl75]]:
    """Yield a path and the emulator that answers on it."""
    path, device = tmp_path / "dvl", Dvl75(settings=DvlSettings(speed_of_sound_mps=1500.0))
    device.set_truth(DvlTruth(), 0.0)
    end: Path | UdpEnd = UdpEnd(*free_ports(2)) if request.param == "network" else path
    with serial_device(end, device):
        yield str(end.path if isinstance(end, UdpEnd) else path), device


def free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)]
        for one in held:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in held]


def hindrax(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(["dvl", *words])
    found = capsys.readouterr()
    return code, found.out, found.err


def test_setup_sends_what_differs_and_verifies_it(dvl: tuple[str, Dvl75], capsys: pytest.CaptureFixture[str]) -> None:
    path, device = dvl
    code, out, _ = hindrax(capsys, "setup", "--port", path, "--json")
    report = json.loads(out)
    assert code == 0
    assert report["orders"] == ["SEND-DVPDL ON", "SET-SPEED-OF-SOUND 1484.0"]
    assert (report["sent"], report["verified"]) == (True, True)
    assert (device.settings.deltas, device.settings.speed_of_sound_mps) == (True, 1484.0)
    code, out, _ = hindrax(capsys, "setup", "--port", path)
    assert "nothing to change" in out


def test_a_dry_run_changes_nothing(dvl: tuple[str, Dvl75], capsys: pytest.CaptureFixture[str]) -> None:
    path, device = dvl
    before = device.settings
    _, out, _ = hindrax(capsys, "setup", "--port", path, "--dry-run", "--velocity-adjustment", "1.01")
    assert "would send: SET-VELOCITY-ADJUSTMENT 1.010" in out
    assert device.settings == before


def test_the_whole_set_up_of_a_pool_day_and_what_cannot_be_verified(
    dvl: tuple[str, Dvl75], capsys: pytest.CaptureFixture[str]
) -> None:
    path, device = dvl
    words = ("--orientation", "0", "0", "90", "--heading-offset", "-10", "--declination", "2.5", "--pool-mode", "on")
    more = ("--retweet-gps", "on", "--kalman", "on", "--imu-calibration", "grab", "--baud-rate", "57600", "--reboot")
    code, out, _ = hindrax(capsys, "setup", "--port", path, *words, *more, "--json")
    assert code == 0
    report = json.loads(out)
    assert report["orders"][0] == "GRAB-IMU-CAL"
    assert report["orders"][-2:] == ["BAUD-RATE 57600", "REBOOT"]
    assert report["unverified"] == ["Pool Mode", "Heading offset"]
    found = device.settings
    assert (found.orientation_deg, found.heading_offset_deg, found.declination_deg) == ((0.0, 0.0, 90.0), -10.0, 2.5)
    assert (found.pool_mode, found.retweet_gps, found.kalman, found.baud) == (True, True, True, 57600)
    _, out, _ = hindrax(capsys, "setup", "--port", path, "--baud", "57600", "--declination", "0")
    assert "sent: DECLINATION 0.0" in out
    assert device.settings.declination_deg == 0.0


def test_show_prints_identity_and_settings(dvl: tuple[str, Dvl75], capsys: pytest.CaptureFixture[str]) -> None:
    path, _ = dvl
    _, out, _ = hindrax(capsys, "show", "--port", path)
    assert "Cerulean DVL-75, firmware Oct 1 2021" in out
    assert "Speed of sound: 1500.0" in out


def test_a_silent_port_is_an_error_with_its_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = Pty(tmp_path / "silent")
    code, _, err = hindrax(capsys, "show", "--port", str(tmp_path / "silent"))
    port.close()
    assert code == 1
    assert "found silence, wanted a DVL at 115200 baud; check power" in err


def test_ethernet_has_no_speed_of_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        number = free.getsockname()[1]
    code, _, err = hindrax(capsys, "show", "--port", f"udp://127.0.0.1:{number}")
    assert code == 1
    assert "found silence, wanted a DVL; check power, cable and where the DVL sends to" in err


def test_a_port_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = hindrax(capsys, "show", "--port", os.fspath(tmp_path / "none"))
    assert code == 1
    assert "no such port" in err
