"""The parts of the virtual vehicle that need no machine."""

import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.knobs import build
from hindrax_core.sensor_table import SENSORS, row_of
from hindrax_core.vehicle import Vehicle, capabilities
from hindrax_sim.devices.icm20948 import Icm20948
from hindrax_sim.devices.pca9685 import Pca9685
from hindrax_sim.hardware import Hardware
from hindrax_tools.virtual_vehicle import gpio
from hindrax_tools.virtual_vehicle.checks import Finding, every_device
from hindrax_tools.virtual_vehicle.gpio import labels_of_chips
from hindrax_tools.virtual_vehicle.hardware import seen_in, thrust_after_s
from hindrax_tools.virtual_vehicle.image import ADDRESS, Image, identity, missing_packages
from hindrax_tools.virtual_vehicle.machine import Machine

LINES = ["1000.0 10.0 neutral", "1000.1 10.1 thrust", "1000.2 10.2 thrust", "1000.3 10.3 neutral", "1000.4 10.4 neut"]


def test_the_last_line_of_the_witness_may_be_cut_off() -> None:
    assert [one.monotonic_s for one in seen_in(LINES)] == [10.0, 10.1, 10.2, 10.3]


def test_thrust_lasts_until_the_first_neutral_that_stays() -> None:
    seen = seen_in(LINES)
    assert thrust_after_s(seen, 10.1) == pytest.approx(0.2)
    assert thrust_after_s(seen, 10.3) == 0.0
    again = [*LINES[:4], "1000.5 10.5 thrust", "1000.6 10.6 neutral"]
    assert thrust_after_s(seen_in(again), 10.1) == pytest.approx(0.5)


def test_thrust_that_does_not_end_and_a_silent_witness_are_no_neutral() -> None:
    assert thrust_after_s(seen_in(LINES[:3]), 10.0) is None
    assert thrust_after_s(seen_in(LINES), 99.0) is None


def test_a_finding_is_one_line() -> None:
    assert Finding("boot", good=False, figure="never").line().split() == ["BAD", "boot", "never"]


def test_what_is_missing_is_named_by_its_debian_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda tool: None if tool in ("ip", "mke2fs") else tool)
    assert missing_packages() == ["e2fsprogs", "iproute2"]


def test_another_set_up_is_another_image() -> None:
    assert identity("one") == identity("one") != identity("other")


@pytest.fixture(scope="module")
def network() -> None:
    """Skip where nobody may make a network, and say why."""
    words = ["unshare", "--user", "--map-root-user", "--net", "ip", "tuntap", "add", "mode", "tap", "name", "vehicle"]
    try:
        subprocess.run(words, check=True, capture_output=True, text=True, timeout=20)
    except FileNotFoundError as error:
        pytest.skip(f"needs {error.filename} to make a network of its own")
    except subprocess.CalledProcessError as error:
        pytest.skip(f"may not make a network of its own here: {error.stderr.strip()}")


@pytest.fixture
def machine(network: None, tmp_path: Path) -> Iterator[Machine]:  # noqa: ARG001  # skips
    """A machine whose kernel is a shell: it starts a second process, and tells what network it sees."""
    kernel, disk = tmp_path / "kernel", tmp_path / "disk"
    kernel.write_text("#!/bin/sh\nsleep 600 &\nip -brief address\nexec sleep 600\n")
    kernel.chmod(0o755)
    disk.write_bytes(bytes(4096))
    image = Image(disk, kernel, tmp_path / "key")
    with (
        tempfile.TemporaryDirectory() as folder,
        Machine(image, Path(folder)) as made,
    ):  # short: ssh makes a socket there
        yield made


def _until(seen: Callable[[], bool]) -> None:
    for _ in range(500):
        if seen():
            return
        time.sleep(0.02)
    raise AssertionError("waited in vain")


def test_the_machine_is_alone_in_a_network_that_only_its_ssh_enters(machine: Machine) -> None:
    machine.power_on()
    log = machine.folder / "kernel.log"
    _until(lambda: "vehicle" in log.read_text())
    assert {line.split()[0] for line in log.read_text().splitlines()} == {"lo", "vehicle"}
    assert ADDRESS in (machine.folder / "ssh_config").read_text()
    refused = machine.run("true")
    assert refused.returncode == 255
    assert ADDRESS in refused.stderr, "ssh went into the network, and found nobody there"


def test_a_power_cut_leaves_nothing_of_the_machine_running(machine: Machine) -> None:
    for _ in range(2):
        machine.power_on()
        group = int((machine.folder / "pid").read_text())
        _until(partial(_runs, group, 2))
        machine.cut_power()
        _until(partial(_runs, group, 0))


def test_a_kernel_that_ends_by_itself_is_told_with_its_last_words(machine: Machine) -> None:
    machine.image.kernel.write_text("#!/bin/sh\necho Kernel panic >&2\nexit 1\n")
    machine.power_on()
    _until(lambda: "panic" in (machine.folder / "kernel.log").read_text())
    with pytest.raises(HindraxError, match=r"the machine has ended; its last words: [^/]*Kernel panic$"):
        machine.until("a login", lambda: False, 20.0)
    machine.cut_power()


def _runs(group: int, processes: int) -> bool:
    """Whether so many processes of a group run."""
    listed = subprocess.run(["ps", "-e", "-o", "pid=,pgid=,stat="], capture_output=True, text=True, check=True).stdout
    rows = [row.split() for row in listed.splitlines()]
    return sum(int(of_group) == group and not state.startswith("Z") for _, of_group, state in rows) == processes


def test_what_was_not_run_is_neither_good_nor_bad() -> None:
    assert Finding("all devices", good=None, figure="no chip").line().split()[:3] == ["skip", "all", "devices"]


def test_the_vehicle_of_all_devices_has_one_on_every_kind_of_wire() -> None:
    vehicle = build(Vehicle, every_device(timed=True), "all devices")
    assert {row_of(mount.device).wire for mount in vehicle.sensors.values()} == {row.wire for row in SENSORS}
    assert vehicle.output.enable_timer
    assert vehicle.sensors["icm20948"].data_ready
    measured = {one for row in SENSORS for one in row.measures}
    found = {one for name in vehicle.sensors for one in capabilities(vehicle.sensors[name])}
    assert measured - {"range"} <= found
    assert labels_of_chips(vehicle) == {"pinctrl-bcm2711"}


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of the lines of a chip that is there already; what the kernel would do with it is not played."""
    chip, lines = tmp_path / "config/vehicle", tmp_path / "platform/gpio-sim.0/gpiochip0"
    (chip / "bank").mkdir(parents=True)
    (chip / "dev_name").write_text("gpio-sim.0\n")
    (chip / "bank/chip_name").write_text("gpiochip0\n")
    for line in range(54):
        (lines / f"sim_gpio{line}").mkdir(parents=True)
        (lines / f"sim_gpio{line}/value").write_text("0\n")
    monkeypatch.setattr(gpio, "SIMULATED", tmp_path / "config")
    monkeypatch.setattr(gpio, "PLATFORM", tmp_path / "platform")
    return lines


def test_lines_carry_what_the_emulated_devices_say(kernel: Path, tmp_path: Path) -> None:
    hardware = Hardware(build(Vehicle, every_device(timed=False), "all devices"), 1)
    wiring = gpio.Wiring(hardware, tmp_path)
    output = hardware.output
    assert isinstance(output, Pca9685)
    for data in ("0030", "fe1e", "0020", "0600003301"):
        output.write(bytes.fromhex(data), 10.0)

    def step() -> str:
        hardware.advance(Stamp(hardware.stamp + stamp_from_s(0.02)))
        wiring.step(hardware.stamp)
        return (kernel / "sim_gpio27/pull").read_text()

    assert step() == "pull-down"
    assert output.pulse_us(0) is not None
    (tmp_path / gpio.LEAK).touch()
    step()
    assert step() == "pull-up"
    (tmp_path / gpio.CUT_ENABLE).touch()
    step()
    assert output.pulse_us(0) is None
    (tmp_path / gpio.CUT_ENABLE).unlink()
    (kernel / "sim_gpio26/value").write_text("1\n")
    step()
    assert output.pulse_us(0) is None


def test_each_sample_raises_the_data_ready_line_unless_its_wire_is_cut(kernel: Path, tmp_path: Path) -> None:
    hardware = Hardware(build(Vehicle, every_device(timed=False), "all devices"), 1)
    wiring, pulls = gpio.Wiring(hardware, tmp_path), kernel / "sim_gpio22/pull"
    imu = hardware.registers["icm20948"]
    assert isinstance(imu, Icm20948)
    imu.write(b"\x06\x01", 10.0)  # awake
    imu.write(b"\x11\x01", 10.0)  # a pulse for each sample

    def pulses() -> bool:
        pulls.unlink(missing_ok=True)
        hardware.advance(Stamp(hardware.stamp + stamp_from_s(0.1)))
        wiring.step(hardware.stamp)
        return pulls.exists()

    assert pulses()
    (tmp_path / gpio.CUT_READY).touch()
    assert not pulses()


def test_a_timer_keeps_the_outputs_enabled_for_a_while_after_a_pulse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "events/gpio/gpio_value").mkdir(parents=True)
    os.mkfifo(tmp_path / "trace_pipe")
    monkeypatch.setattr(gpio, "TRACING", tmp_path)
    reader = os.open(tmp_path / "trace_pipe", os.O_RDONLY | os.O_NONBLOCK)
    pipe = os.open(tmp_path / "trace_pipe", os.O_WRONLY)
    timer = gpio.Monostable()
    assert not timer.enables(10.0)
    os.write(pipe, b" python-7 [000] .... 1.0: gpio_value: 538 set 1\n")
    assert not timer.enables(10.0)
    os.write(pipe, b" python-7 [000] .... 1.0: gpio_value: 538 set 0\n")
    assert timer.enables(10.0)
    assert timer.enables(10.2)
    assert not timer.enables(10.4)
    os.close(pipe)
    os.close(reader)
