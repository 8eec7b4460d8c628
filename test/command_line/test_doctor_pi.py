"""The doctor on a Raspberry Pi: every way to be wrong has its remedy, and what docker/pi sets up is right."""

import subprocess
from pathlib import Path

import pytest

from hindrax_bringup.clone import clone_root
from hindrax_bringup.network.tether import SETTING, Tether
from hindrax_cli.command_line import main
from hindrax_cli.health_checks import machine, nodes, pi
from hindrax_core.errors import HindraxError

SET_UP = clone_root() / "docker/pi/set-up.sh"


def write(root: Path, name: str, content: str | bytes) -> None:
    file = root / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content.encode() if isinstance(content, str) else content)


@pytest.fixture
def fresh(tmp_path: Path) -> Path:
    """A Pi as it comes: I2C off, clocks free."""
    write(tmp_path, pi.MODEL, "Raspberry Pi 4 Model B Rev 1.4\0")
    write(tmp_path, "boot/firmware/config.txt", "[all]\ndtparam=audio=on\n[pi5]\ncore_freq=500\ncore_freq_min=500\n")
    write(tmp_path, pi.THROTTLED, "0\n")
    return tmp_path


@pytest.fixture
def ready(fresh: Path) -> Path:
    """The same after set-up and reboot."""
    subprocess.run([SET_UP, "--root", fresh, "--tether", "eth0:192.168.2.1"], check=True, capture_output=True)
    write(fresh, pi.I2C_SPEED, (400_000).to_bytes(4, "big"))
    write(fresh, pi.UNIT, "")
    write(fresh, "dev/hindrax/dvl", "")
    return fresh


def wrong(root: Path) -> dict[str, str]:
    return {one.name: f"{one.found} -> {one.remedy}" for one in pi.board(root) if not one.ok}


def test_what_the_set_up_makes_is_right(ready: Path) -> None:
    assert wrong(ready) == {}
    found = {one.name: one.found for one in pi.board(ready)}
    assert found["i2c speed"] == "400 kHz"
    assert found["core clock"] == "fixed at 500 MHz"
    assert found["device names"] == "/dev/hindrax: dvl"


def test_a_fresh_pi_lacks_everything_and_gets_the_remedies(fresh: Path) -> None:
    found = wrong(fresh)
    assert set(found) == {"i2c speed", "core clock", "uarts", "device names", "service"}
    assert all("sudo docker/pi/set-up.sh" in remedy for remedy in found.values())
    assert "I2C is switched off" in found["i2c speed"]


def test_another_machine_has_nothing_to_check(tmp_path: Path) -> None:
    assert pi.board(tmp_path) == []
    write(tmp_path, pi.MODEL, "Raspberry Pi 5 Model B\0")
    assert pi.board(tmp_path) == []


@pytest.mark.parametrize(
    ("file", "content", "name", "words"),
    [
        (pi.I2C_SPEED, (100_000).to_bytes(4, "big"), "i2c speed", "100 kHz, wanted 400 ->"),
        (pi.RULES, "# of an earlier version\n", "device names", "differs from the file of this version"),
        (pi.THROTTLED, "50005\n", "power", "under-voltage now"),
        (pi.THROTTLED, "50000\n", "power", "there was under-voltage since the start"),
        ("boot/firmware/config.txt", "core_freq=500\ncore_freq_min=200\n", "core clock", "changes with the load"),
        ("boot/firmware/config.txt", "dtoverlay=uart3\n", "uarts", "uart5 switched off"),
        ("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16\n", "ttyUSB0", "keeps bytes for 16 ms, wanted 1"),
    ],
)
def test_each_thing_that_is_wrong_is_named(ready: Path, file: str, content: bytes | str, name: str, words: str) -> None:
    write(ready, file, content)
    assert words in wrong(ready)[name]


def test_a_missing_adapter_although_it_is_asked_for(ready: Path) -> None:
    (ready / pi.I2C_SPEED).unlink()
    assert "modprobe i2c-dev" in wrong(ready)["i2c speed"]


def test_the_tether_is_looked_at_where_one_is_named() -> None:
    assert machine.tether(None) == []
    (found,) = machine.tether(Tether("nowhere0"))
    assert (found.ok, found.found, found.remedy) == (False, "nowhere0: no such interface", "`ip link` lists them")
    (found,) = machine.tether(Tether("lo", ("192.168.2.1",)))
    assert (found.ok, found.found) == (True, "lo is 127.0.0.1; at its other end 192.168.2.1")


def test_two_clocks_are_compared_by_the_youngest_stamp() -> None:
    assert nodes.clocks([0.012, 0.004, 0.3]).found == "the vehicle's stamps arrive 4 to 300 ms old"
    assert nodes.clocks([5.0, 4.5]).found == "the vehicle's clock is 4.50 s behind this one"
    ahead = nodes.clocks([-1.5, -1.2])
    assert (ahead.ok, ahead.found) == (False, "the vehicle's clock is 1.50 s ahead of this one")
    assert "two-machines.md" in ahead.remedy
    assert not nodes.clocks([]).ok


def test_the_far_end_needs_a_tether(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv(SETTING, "")
    assert main(["doctor", "--topside"]) == 2
    assert "wanted one: --tether eth0:192.168.2.2" in capsys.readouterr().err


def test_the_far_end_may_be_a_mock_with_its_own_clock_and_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def joined(_found: None, **how: object) -> None:
        raise HindraxError(f"joined with {how}")

    monkeypatch.setattr("hindrax_cli.commands.machine.doctor.joined", joined)
    monkeypatch.setenv(SETTING, "eth9:192.168.2.1")
    assert main(["doctor", "--topside", "--sim-time", "--namespace", "/rov2", "--json"]) == 1
    assert "joined with {'sim_time': True, 'namespace': '/rov2'}" in capsys.readouterr().out
    assert "--sim-time" in nodes.clocks([1.7e9]).remedy
