"""What is put on a Raspberry Pi agrees with itself, with the vehicle file and with the tools of the system."""

import configparser
import os
import re
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command import MODULES
from hindrax_core.knobs import knob_of
from hindrax_core.sensor_table import SENSORS
from hindrax_core.vehicle import Output, load_vehicle

ROOT = Path(__file__).parents[2]
PI = ROOT / "docker/pi"
SET_UP = PI / "set-up.sh"
COMPOSE = yaml.safe_load((ROOT / "docker/compose.yaml").read_text())["services"]["hindrax"]
OVERLAY_OF_ADDRESS = {"fe201600": "uart3", "fe201800": "uart4", "fe201a00": "uart5"}
"""UARTs of the BCM2711 as Raspberry Pi's documentation of its overlays and the kernel's messages name them."""
MAJOR_OF_KIND = {"i2c": "89", "ttyAMA": "204", "ttyACM": "166", "ttyUSB": "188", "gpiochip": "${GPIO_MAJOR"}
"""Linux, Documentation/admin-guide/devices.txt; the number of gpiochip is given by the kernel as it starts."""
KINDS = {"serial": ("ttyAMA", "ttyACM", "ttyUSB"), "i2c": ("i2c",), "gpio": ("gpiochip",)}
SUBSYSTEM = {"serial": "tty", "i2c": "i2c-dev", "gpio": "gpio"}
GROUP = {"serial": "dialout", "i2c": "i2c", "gpio": "gpio"}
LIBRARY = {"serial": "pyserial", "i2c": "smbus2", "gpio": "gpiod"}
"""By the wire of a sensor: kinds of device, their subsystem, the group that may open them, the library that does."""
WIRES_OF_OUTPUT = {"pca9685": ("i2c", "gpio"), "stm32": ("serial",), "ardusub": ("serial",), "ros2_control": ()}
"""A PCA9685 may have a line that enables its outputs, which may drive a timer; topics have no wire."""


class CasedParser(configparser.ConfigParser):
    """Keeps the letters of a name as they are."""

    def optionxform(self, optionstr: str) -> str:
        return optionstr


def set_up(root: Path, *words: str) -> str:
    command: list[str | Path] = [SET_UP, "--root", root, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout


@pytest.fixture
def pi(tmp_path: Path) -> Path:
    boot = tmp_path / "boot/firmware"
    boot.mkdir(parents=True)
    (boot / "config.txt").write_text("[all]\ndtparam=audio=on\n")
    return tmp_path


def contents(root: Path) -> dict[str, str]:
    return {str(path.relative_to(root)): path.read_text() for path in root.rglob("*") if path.is_file()}


def test_a_second_run_changes_nothing(pi: Path) -> None:
    assert "write /boot/firmware/config.txt" in set_up(pi, "--tether", "eth0:192.168.2.1")
    first = contents(pi)
    again = set_up(pi, "--tether", "eth0:192.168.2.1")
    assert contents(pi) == first
    assert "write" not in again
    assert "reboot" not in again


def test_a_dry_run_changes_nothing_and_states_everything(pi: Path) -> None:
    before = contents(pi)
    printed = set_up(pi, "--dry-run", "--tether", "eth0:192.168.2.1")
    assert contents(pi) == before
    done = set_up(pi, "--tether", "eth0:192.168.2.1")
    assert printed.replace("would write", "write") == done


def test_what_was_in_the_boot_settings_stays(pi: Path) -> None:
    set_up(pi)
    assert (pi / "boot/firmware/config.txt").read_text().startswith("[all]\ndtparam=audio=on\n# hindrax begin\n")


def test_an_old_block_is_replaced(pi: Path) -> None:
    config = pi / "boot/firmware/config.txt"
    config.write_text("# hindrax begin\ncore_freq=250\n# hindrax end\n[all]\ndtparam=audio=on\n")
    set_up(pi)
    assert config.read_text() == "[all]\ndtparam=audio=on\n" + (PI / "config.txt").read_text()


def test_the_tether_is_named_everywhere_and_only_there(pi: Path) -> None:
    set_up(pi, "--tether", "eth0:192.168.2.1")
    found = contents(pi)
    assert "HINDRAX_TETHER=eth0:192.168.2.1\n" in found["etc/hindrax/hindrax.env"]
    assert "server 192.168.2.1 iburst" in found["etc/chrony/conf.d/hindrax.conf"]
    assert "RestrictNetworkInterfaces=lo eth0\n" in found["etc/systemd/system/hindrax.service.d/tether.conf"]


def test_settings_of_the_owner_survive_a_new_tether(pi: Path) -> None:
    set_up(pi)
    settings = pi / "etc/hindrax/hindrax.env"
    settings.write_text(settings.read_text().replace("ROS_DOMAIN_ID=0", "ROS_DOMAIN_ID=42"))
    set_up(pi, "--tether", "eth1:192.168.3.1")
    assert "ROS_DOMAIN_ID=42\n" in settings.read_text()
    assert "HINDRAX_TETHER=eth1:192.168.3.1\n" in settings.read_text()


def test_whoever_sets_it_up_may_open_the_wires_too(pi: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUDO_USER", "nobody")
    assert "would run usermod --append --groups dialout,i2c,gpio nobody" in set_up(pi)
    monkeypatch.delenv("SUDO_USER")
    assert "usermod" not in set_up(pi)


def test_udev_reads_the_rules_when_their_groups_are_there(pi: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ignores a group that it does not know: a chip stayed root's until the next boot."""
    tools = pi / "tools"
    tools.mkdir()
    (tools / "getent").write_text("#!/bin/sh\nexit 2\n")
    (tools / "getent").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    for _ in range(2):  # also where the rules are those of an earlier set-up, without the groups
        said = set_up(pi).splitlines()
        groups = [said.index(f"would run groupadd --system {group}") for group in ("i2c", "gpio")]
        assert max(groups) < said.index("would run udevadm control --reload")


def test_a_container_gets_the_group_of_its_bus_and_no_service(tmp_path: Path) -> None:
    clone = tmp_path / "clone/docker"
    shutil.copytree(PI, clone / "pi")
    root = tmp_path / "root"
    command: list[str | Path] = [clone / "pi/set-up.sh", "--root", root, "--container"]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    assert list(root.rglob("hindrax.service")) == []
    (settings,) = root.rglob(".env")
    assert re.fullmatch(r"I2C_GID=\d+\nGPIO_GID=\d+\nGPIO_MAJOR=\d+\n", settings.read_text())


def test_a_machine_that_is_no_pi_gets_no_boot_settings(tmp_path: Path) -> None:
    assert "no       /boot/firmware/config.txt: this is no Raspberry Pi" in set_up(tmp_path)
    assert not (tmp_path / "boot").exists()


@pytest.mark.parametrize(
    "words",
    [
        *(["--tether", "eth0"], ["--tether", "e;h:1.2.3.4"], ["--tether", "eth0:999.1.1.1"], ["--tether", "e:1.2.3"]),
        *(["--tether"], ["--tether", ""], ["--root"], ["--frobnicate"]),
    ],
)
def test_wrong_words_are_refused(tmp_path: Path, words: list[str]) -> None:
    done = subprocess.run([SET_UP, "--root", tmp_path, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "wanted" in done.stderr
    assert contents(tmp_path) == {}


# --- The files and the vehicle ---------------------------------------------------------------------------------------


def rules() -> list[str]:
    lines = (PI / "60-hindrax.rules").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def test_the_rules_are_rules() -> None:
    term = re.compile(
        r'(?:ACTION|SUBSYSTEM|KERNEL|DRIVER|DEVPATH|ATTRS?\{\w+\})(?:==|=)"[^"]*"|(?:GROUP|MODE)="\w+"|SYMLINK\+="[\w/-]+"'
    )
    for rule in rules():
        assert all(term.fullmatch(one.strip()) for one in rule.split(",")), rule


def test_udev_accepts_the_rules() -> None:
    udevadm = shutil.which("udevadm")
    version = (
        subprocess.run([udevadm, "--version"], capture_output=True, text=True, check=True).stdout if udevadm else "0"
    )
    if int(version) < 254:
        pytest.skip("needs `udevadm verify`, which systemd has from 254 on; the terms are looked at one by one above")
    assert udevadm is not None
    command: list[str | Path] = [udevadm, "verify", "--resolve-names=never", PI / "60-hindrax.rules"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_device_of_the_vehicle_has_its_name() -> None:
    vehicle = load_vehicle(default_vehicle())
    ports = {mount.port for mount in vehicle.sensors.values()} | {vehicle.output.port}
    named = {f"/dev/{name}" for rule in rules() for name in re.findall(r'SYMLINK\+="([^"]+)"', rule)}
    assert {port for port in ports if port.startswith("/dev/hindrax/")} <= named
    assert {port for port in ports if not port.startswith("/dev/hindrax/")} == {"/dev/i2c-1"}


def test_every_uart_that_is_named_is_switched_on() -> None:
    config = (PI / "config.txt").read_text().splitlines()
    switched = {line.removeprefix("dtoverlay=") for line in config if line.startswith("dtoverlay=uart")}
    named = {OVERLAY_OF_ADDRESS[one] for rule in rules() for one in re.findall(r"(fe20\w+)\.serial", rule)}
    assert named == switched


def test_the_core_clock_stands_still() -> None:
    lines = dict(line.split("=", 1) for line in (PI / "config.txt").read_text().splitlines() if "=" in line)
    assert lines["core_freq"] == lines["core_freq_min"]
    assert lines["dtparam"] == "i2c_arm=on,i2c_arm_baudrate=400000"


def test_service_and_container_may_open_the_same_kinds_of_device() -> None:
    allowed = {words.removeprefix("c ").partition(":")[0] for words in COMPOSE["device_cgroup_rules"]}
    assert allowed == set(MAJOR_OF_KIND.values())
    service = (PI / "hindrax.service").read_text()
    assert set(re.findall(r"DeviceAllow=char-(\w+) rw", service)) == set(MAJOR_OF_KIND)


USERS = [
    *(pytest.param((row.wire,), id=row.name) for row in SENSORS),
    *(pytest.param(WIRES_OF_OUTPUT[name], id=name) for name in knob_of(fields(Output)[0]).choices),
    pytest.param(("gpio",), id="data_ready"),
]
"""Whatever a vehicle file can name, by its wires."""


@pytest.mark.parametrize("wires", USERS)
def test_whatever_a_vehicle_file_names_may_be_opened_as_deployed(wires: tuple[str, ...]) -> None:
    """A leak probe could not work: neither unit nor container allowed its chip, and no lock had gpiod."""
    service, set_up_script = (PI / "hindrax.service").read_text(), SET_UP.read_text()
    (groups,) = re.findall(r"^SupplementaryGroups=(.*)$", service, re.MULTILINE)
    for wire in wires:
        for kind in KINDS[wire]:
            assert f"DeviceAllow=char-{kind} rw\n" in service, f"hindrax.service: {kind} is shut off"
            major = MAJOR_OF_KIND[kind]
            assert any(rule.startswith(f"c {major}:") for rule in COMPOSE["device_cgroup_rules"]), f"compose: {kind}"
        group = GROUP[wire]
        assert group in groups.split(), f"hindrax.service: {group}"
        assert any(group == one or f"{{{group.upper()}_GID:" in one for one in COMPOSE["group_add"]), (
            f"compose: {group}"
        )
        assert re.search(rf"--groups \S*\b{group}\b", set_up_script), f"set-up.sh: {group}"
        ruled = [rule for rule in rules() if f'SUBSYSTEM=="{SUBSYSTEM[wire]}"' in rule and f'GROUP="{group}"' in rule]
        assert ruled, f"60-hindrax.rules: {group}"
        for lock in ("native.lock", "wheels.lock"):
            locked = (ROOT / "setup" / lock).read_text()
            assert re.search(rf"^{LIBRARY[wire]}==", locked, re.MULTILINE), f"{lock}: {LIBRARY[wire]}"


def test_the_container_is_kept_up_and_held_back() -> None:
    assert COMPOSE["restart"] == "unless-stopped"
    assert COMPOSE["cap_drop"] == ["ALL"]
    assert COMPOSE["read_only"]
    assert "privileged" not in COMPOSE
    assert (ROOT / "docker" / COMPOSE["build"]["context"] / COMPOSE["build"]["dockerfile"]).is_file()
    dockerfile = (ROOT / "docker/Dockerfile").read_text()
    (user,) = re.findall(r"^USER (\d+)$", dockerfile, re.MULTILINE)
    assert int(user) > 0
    assert f"--uid {user} " in dockerfile
    assert f"/run/hindrax:uid={user},gid={user},mode=0700" in COMPOSE["tmpfs"]
    assert COMPOSE["stop_signal"] == re.findall(r"^STOPSIGNAL (\w+)$", dockerfile, re.MULTILINE)[0]


def test_every_command_that_is_called_exists() -> None:
    called = re.findall(r"/opt/hindrax/hindrax\"?,? \"?([a-z-]+)", (ROOT / "docker/Dockerfile").read_text())
    called += re.findall(r"/opt/hindrax/hindrax ([a-z-]+)", (PI / "hindrax.service").read_text())
    called += [COMPOSE["command"][0]]
    assert {"health", "setup", "up"} <= set(called)
    assert set(called) <= set(MODULES) | {"setup"}


def test_every_file_that_is_named_exists() -> None:
    texts = [path.read_text() for path in (*PI.iterdir(), ROOT / "docker/compose.yaml")]
    for name in {name for text in texts for name in re.findall(r"\b(?:docker|docs|src)/[\w/.-]*\.\w+", text)}:
        assert (ROOT / name).exists() or name == "docker/.env", name


def test_every_setting_is_one_that_the_stack_reads() -> None:
    sources = "".join(path.read_text() for path in ROOT.glob("src/hindrax_*/hindrax_*/**/*.py"))
    settings = re.findall(r"^(\w+)=", (PI / "hindrax.env").read_text(), re.MULTILINE)
    assert "HINDRAX_TETHER" in settings
    for name in settings:
        assert f'"{name}"' in sources, name


def test_the_service_is_watched_and_always_started_again() -> None:
    parser = CasedParser(strict=False, interpolation=None)
    parser.read(PI / "hindrax.service")
    service = parser["Service"]
    assert service["Type"] == "notify"
    assert int(service["WatchdogSec"]) > 0
    assert service["Restart"] == "always"
    # A vehicle that is switched off has not failed.
    assert service["KillSignal"] == "SIGINT"
    assert service["SuccessExitStatus"] == "130"
    assert parser["Unit"]["StartLimitIntervalSec"] == "0"
    assert service["User"] != "root"


def test_systemd_accepts_the_service(tmp_path: Path) -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("needs systemd-analyze, which this machine has not; the parts are looked at one by one above")
    unit = tmp_path / "hindrax.service"
    unit.write_text((PI / "hindrax.service").read_text().replace("/opt/hindrax", str(ROOT)))
    done = subprocess.run([analyze, "verify", unit], capture_output=True, text=True, check=False, timeout=60)
    assert [line for line in done.stderr.splitlines() if "hindrax" in line] == []


def test_the_scripts_pass_shellcheck() -> None:
    scripts = [*sorted(PI.glob("*.sh")), *sorted(ROOT.glob("src/*/security/*.sh"))]
    command = [Path(sys.executable).parent / "shellcheck", *scripts]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")
