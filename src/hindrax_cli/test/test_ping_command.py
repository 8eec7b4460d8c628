"""`hindrax ping` on a pty with the emulated sonar behind it."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_cli.command_line import main
from hindrax_sim.buses.serial_ends import Pty
from hindrax_sim.devices.ping1d import Ping1d, PingTruth
from hindrax_sim.testing.mock_wires import serial_device


@pytest.fixture
def sonar(tmp_path: Path) -> Iterator[str]:
    """Yield a path on which a sonar hears the bottom at 1.8 m."""
    path, device = tmp_path / "ping", Ping1d(noise=0.0)
    device.set_truth(PingTruth(1.8), 0.0)
    with serial_device(path, device):
        yield str(path)


def test_a_profile_is_asked_for_and_given(sonar: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ping", "profile", "--port", sonar, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["distance_m"] == pytest.approx(1.8, abs=0.002)
    assert found["confidence"] == 1.0
    assert found["identity"].startswith("Blue Robotics Ping sonar")
    assert found["round_trip_s"] > 0.0
    start, end = found["scan_m"]
    loudest = found["strength"].index(max(found["strength"]))
    assert start + (end - start) * loudest / len(found["strength"]) == pytest.approx(1.8, abs=0.05)


def test_a_profile_is_drawn(sonar: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ping", "profile", "--port", sonar]) == 0
    head, found, *rows = capsys.readouterr().out.splitlines()
    assert "answered in" in head
    assert found.startswith("1.80")
    longest = max(rows, key=lambda row: row.count("#"))
    assert float(longest.split()[0]) == pytest.approx(1.8, abs=0.2)


def test_the_device_itself_is_shown_and_gets_a_number(sonar: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ping", "show", "--port", sonar, "--device-id", "7", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["device_id"], found["supply_V"], found["processor_C"], found["board_C"]) == (7, 5.0, 30.0, 25.0)
    assert main(["ping", "show", "--port", sonar]) == 0
    assert "device_id: 7" in capsys.readouterr().out


def test_silence_is_reported_with_its_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hindrax_cli.commands.machine.ping.PATIENCE_S", 0.3)
    port = Pty(tmp_path / "ping")
    assert main(["ping", "profile", "--port", str(port.path)]) == 1
    assert "no answer in 0.3 s (silence); check power, cable and speed" in capsys.readouterr().err
    port.close()
