"""The doctor: every problem has its remedy, with devices, without, and with a stack that is up."""

import importlib.util
import json
import os
import shutil
import subprocess
import tty
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import pytest

from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.network import security
from hindrax_bringup.network.tether import Tether
from hindrax_bringup.process_state import Running, running
from hindrax_bringup.ros_graph import PROFILE
from hindrax_bringup.share_files import default_vehicle, hindrax_with
from hindrax_bringup.stack import MockOptions, Stack, environment
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.stack_process import RUNNER
from hindrax_bringup.supervisor import Supervisor
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.health_checks import machine, nodes, wires
from hindrax_cli.health_checks.machine import KernelTime
from hindrax_core.bus_operations import DeviceError
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.buses import gpio
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_drivers.output.output_guard import OutputGuardKnobs, Pulses
from hindrax_drivers.output.output_ports import LineOutput, StillAnsweringError

NOW_S = 1_767_225_600.0  # 2026-01-01


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))


def test_with_nothing_attached_every_problem_has_a_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = hindrax_file(tmp_path, ("/dev/", f"{tmp_path}/dev/"))
    assert main(["doctor", "--json", "--vehicle", str(file)]) == 1
    checks = json.loads(capsys.readouterr().out)["checks"]
    assert all(set(one) == {"name", "ok", "found", "remedy"} for one in checks)
    assert all(one["found"] and bool(one["remedy"]) is not one["ok"] for one in checks)
    by_name = {one["name"]: one for one in checks}
    assert {"python", "ros", "disk", "time", "groups", "processes"} <= set(by_name)
    for name in ("dvl75", "ping1d", "icm20948", "ms5837", "thrusters", f"{tmp_path}/dev/i2c-1"):
        assert not by_name[name]["ok"], name


def test_people_get_the_same_as_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = hindrax_file(tmp_path, ("/dev/", f"{tmp_path}/"))
    assert main(["doctor", "--vehicle", str(file)]) == 1
    printed = capsys.readouterr().out
    assert "-> check cable and power" in printed
    assert "checks found a problem" in printed


def test_the_clock() -> None:
    good = machine.clock(KernelTime(True, 0.02), NOW_S)
    assert (good.ok, good.found) == (True, "2026-01-01 00:00 UTC, synchronized, error at most 20 ms")
    assert "was never set" in machine.clock(KernelTime(True, 0.0), 3600.0).found
    assert "chrony" in machine.clock(KernelTime(False, 16.0), NOW_S).remedy
    assert "wait for NTP" in machine.clock(KernelTime(True, 3.0), NOW_S).remedy


def test_the_kernel_can_be_asked() -> None:
    assert machine.kernel_time().error_s >= 0.0


def test_room_for_bags(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert machine.disk(tmp_path).ok
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: Message(free=10_000_000))
    assert "wanted 0.5 GB" in machine.disk(tmp_path).remedy


@pytest.mark.parametrize(("free", "remedy"), [(0, "remove the files that ended processes left there"), (1 << 20, "")])
def test_shared_memory_without_room_is_named(monkeypatch: pytest.MonkeyPatch, free: int, remedy: str) -> None:
    monkeypatch.setattr("hindrax_bringup.ros_graph.shutil.disk_usage", lambda _place: Message(free=free))
    found = machine.shared_memory()
    assert found.ok == (not remedy)
    assert found.remedy.startswith(remedy)


def test_another_ros_is_named() -> None:
    found = machine.ros({"ROS_DISTRO": "humble"})
    assert not found.ok
    assert found.found == "ROS 2 humble" or found.found.startswith("no ")


def test_nodes_without_a_parent_are_left_behind_and_those_with_one_are_not() -> None:
    node = "python -m hindrax_drivers.nodes.thrusters --ros-args"
    init, tool = Running(1, 0, 0, "/sbin/init"), Running(50, 20, 7, "python -m hindrax_cli up")
    cared, lost, foreign = Running(51, 50, 7, node), Running(60, 1, 7, node), Running(61, 1, 8, node)
    assert machine.leftovers([init, tool, cared, foreign], 7).ok
    found = machine.leftovers([init, tool, cared, lost, foreign], 7)
    assert not found.ok
    assert found.remedy == "end them: kill 60"
    assert machine.leftovers([init, lost], 7, "/run/another").ok
    up = f"python -m {RUNNER} {{}}"
    assert machine.leftovers([init, Running(70, 1, 7, up, name="python")], 7).ok, "a service is nobody's child"
    assert not machine.leftovers([init, Running(71, 1, 7, up, name="control")], 7).ok, "this one was forked"


def test_in_a_container_our_own_tool_may_be_the_first_process() -> None:
    first = Running(1, 0, 7, "python -m hindrax_cli up")
    assert machine.leftovers([first, Running(9, 1, 7, "python -m hindrax_sim.nodes.mock")], 7).ok


def test_processes_are_read_as_the_kernel_shows_them() -> None:
    mine = next(one for one in running() if one.pid == os.getpid())
    assert (mine.parent, mine.owner) == (os.getppid(), os.getuid())
    assert "py" in mine.words
    with subprocess.Popen(["sleep", "60"], env={"HOME": "/", FOLDER: "/run/there"}) as child:
        places = {one.pid: one.place for one in running()}
        child.kill()
    assert places[child.pid] == "/run/there"


def test_ports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert wires.port("/dev/null").ok
    assert "raspi-config" in wires.port("/dev/i2c-77").remedy
    assert "./hindrax mock" in wires.port("mock:/nowhere/i2c").remedy
    (tmp_path / "file").write_text("")
    assert wires.port(str(tmp_path / "file")).found == "no device file"
    monkeypatch.setattr(wires, "is_mounted", lambda file: file == tmp_path / "file")
    assert wires.port(str(tmp_path / "file")).found == "bus of a mock"
    link = tmp_path / "dvl"
    link.symlink_to("/dev/null")
    assert wires.port(str(link)).found == "there, it is /dev/null"


@pytest.mark.skipif(os.getuid() == 0, reason="root may open everything")
def test_a_port_of_another_group_names_it(tmp_path: Path) -> None:
    path = tmp_path / "port"
    path.write_text("")
    path.chmod(0)
    assert "usermod" in wires.port(str(path)).remedy


def test_every_port_is_looked_at_once() -> None:
    vehicle = load_vehicle(default_vehicle())
    names = [one.name for one in wires.ports(vehicle, {"thrusters": "mock:/x/i2c"})]
    assert names == ["/dev/hindrax/dvl", "/dev/hindrax/ping", "/dev/i2c-1", "mock:/x/i2c"]


def test_an_address_of_the_network_is_asked_and_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wires, "ANSWER_S", 0.2)
    network = {"dvl75": "udp://127.0.0.1:9999"}
    vehicle = load_vehicle(default_vehicle())
    assert wires.ports(vehicle, network)[0].ok
    found = next(
        one for one in wires.devices(Settings(vehicle, vehicle.output.port), network, "system") if one.name == "dvl75"
    )
    assert not found.ok
    assert "silence" in found.found


def status(level: bytes, message: str, **values: str) -> Message:
    pairs = [Message(key=key.replace("_", " "), value=value) for key, value in values.items()]
    return Message(level=level, message=message, values=pairs)


def test_a_stack_that_is_up_is_asked_instead_of_its_wires() -> None:
    diagnostics = {
        "hindrax: dvl75": status(b"\x00", "measuring", identity="DVL-75", last_trouble="slow once"),
        "hindrax: ping1d": status(b"\x02", "no reading for 3.0 s", last_trouble="Errno 5"),
    }
    diagnostics["hindrax: dvl75"].values.append(Message(key="rate [Hz]", value="20.04"))
    up, dvl, ping, pilot = nodes.judged(diagnostics, ("dvl75", "ping1d", "pilot"), "vehicle")
    assert up.ok
    assert (dvl.ok, dvl.found) == (True, "DVL-75, measuring, 20.0 Hz")
    assert (ping.ok, ping.remedy) == (False, "last trouble: Errno 5")
    assert pilot.found == "its node sends nothing"


def test_a_node_without_wires_is_not_told_to_check_them() -> None:
    sentence = "leak: water in the hull; surface, disarm and open the hull"
    found = {"hindrax: pilot": status(b"\x01", sentence), "hindrax: dvl75": status(b"\x02", "has not answered yet")}
    found["hindrax: dvl75"].values.append(Message(key="rate [Hz]", value="0.0"))
    _, pilot, dvl = nodes.judged(found, ("pilot", "dvl75"), "vehicle")
    assert (pilot.found, pilot.remedy) == (sentence, nodes.AS_IT_SAYS)
    assert "wiring" in dvl.remedy


def test_a_stack_of_which_nobody_reports_is_a_problem() -> None:
    (only,) = nodes.judged({}, ("dvl75",), "vehicle")
    assert not only.ok


def test_the_devices_of_a_vehicle_answer_through_their_drivers(mock_ports: dict[str, Any]) -> None:
    vehicle = load_vehicle(default_vehicle())
    settings = Settings(vehicle, vehicle.output.port)
    found = wires.ports(vehicle, mock_ports) + wires.devices(settings, mock_ports, mock_ports["clock"])
    assert [one.name for one in found if not one.ok] == []
    by_name = {one.name: one.found for one in found}
    assert by_name["dvl75"].startswith("Cerulean DVL-75")
    assert by_name["thrusters"].startswith("PCA9685 at 0x40")
    assert "Ping" in by_name["ping1d"]
    assert "supply 5.00 V" in by_name["ping1d"]


def test_the_output_is_asked_at_the_rest_of_its_node(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Any] = []

    class Asked:
        def set_up(self) -> str:
            return "PCA9685"

        def close(self) -> None:
            pass

    def open_output(*_words: Any, neutral: Pulses) -> Asked:
        opened.append(neutral.thrusters)
        return Asked()

    monkeypatch.setattr(wires, "open_output", open_output)
    bare = replace(load_vehicle(default_vehicle()), sensors={})
    moved = replace(bare, curves={"main": replace(bare.curves["main"], stop_us=1520.0)})
    tuned = Settings(bare, "/dev/null", knobs=OutputGuardKnobs(neutral_us=1530.0))
    for settings in (Settings(moved, "/dev/null"), tuned):
        assert [one.found for one in wires.devices(settings, {}, "system")] == ["PCA9685 at /dev/null"]
    assert opened == [(1520.0,) * 8, (1530.0,) * 8]


@pytest.mark.parametrize("lack", ["", "/dev/null: ardusub: its FRAME_CONFIG is 7"])
def test_an_autopilot_that_is_still_answering_is_waited_for(lack: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow(LineOutput):
        def __init__(self) -> None:
            pass

        def set_up(self, *, patient: bool = False) -> str:
            if not patient:
                raise StillAnsweringError("/dev/null: ardusub: still answering")
            if lack:
                raise DeviceError(lack)
            return "ArduSub 4.5.7"

        def close(self) -> None:
            pass

    monkeypatch.setattr(wires, "open_output", lambda *_words, **_neutral: Slow())
    bare = replace(load_vehicle(default_vehicle()), sensors={})
    (found,) = wires.devices(Settings(bare, "/dev/null"), {}, "system")
    assert found.ok is not bool(lack)
    assert found.found.startswith(lack or "ArduSub 4.5.7")


def test_a_silent_device_is_a_problem_with_its_line(mock_ports: dict[str, Any]) -> None:
    vehicle = load_vehicle(default_vehicle())
    only = replace(vehicle, sensors={"dvl75": vehicle.sensors["dvl75"]})
    silent, end = os.openpty()
    tty.setraw(end)  # or it would echo
    try:
        ports = mock_ports | {"dvl75": os.ttyname(end)}
        found = {one.name: one for one in wires.devices(Settings(only, only.output.port), ports, "system")}
        assert not found["dvl75"].ok
        assert "silence" in found["dvl75"].found
    finally:
        os.close(silent)
        os.close(end)


@pytest.fixture
def mock_ports(tmp_path: Path) -> Iterator[dict[str, Any]]:
    """Ports of a mock vehicle in a process of its own, without ROS."""
    if importlib.util.find_spec("rclpy") is None:
        pytest.skip("the mock's process imports rclpy")
    folder = RunFolder(Path(tmp_path / "run"))
    folder.path.mkdir()
    shutil.copyfile(default_vehicle(), folder.vehicle)
    with Supervisor(folder.logs, environment(mock=True, domain=None)) as supervisor:
        stack = Stack(folder, supervisor)
        stack.start_mock(MockOptions(), "--no-ros")
        ports = stack.mock_facts["ports"]
        assert isinstance(ports, dict)
        yield {**ports, "clock": stack.mock_facts["clock"]}


def test_a_chip_of_lines_is_there_or_given(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    vehicle = hindrax_with("sos_leak")
    line = vehicle.sensors["sos_leak"].port
    monkeypatch.setattr(gpio, "DEVICES", tmp_path)
    (missing,) = (one for one in wires.ports(vehicle, {}) if one.name == line)
    assert not missing.ok
    assert "found the chips none, wanted 'pinctrl-bcm2711'" in missing.remedy
    monkeypatch.setattr(wires, "find_chip", lambda chip: f"/dev/gpiochip0 of {chip}")
    (there,) = (one for one in wires.ports(vehicle, {}) if one.name == line)
    assert there.ok
    assert there.found == "there, it is /dev/gpiochip0 of pinctrl-bcm2711"


def test_what_protects_the_graph(tmp_path: Path) -> None:
    open_graph = machine.protection(None, {})
    assert open_graph.ok
    assert open_graph.found.startswith("network only: this machine may command; nothing is signed")
    tethered = machine.protection(Tether("eth0"), {PROFILE: "/mine.xml"})
    assert "this machine and everybody on eth0 may command" in tethered.found
    assert machine.protection(None, {PROFILE: "/mine.xml"}).found.startswith("your profile /mine.xml decides")
    wheels = machine.protection(None, {security.KEYSTORE: str(tmp_path), security.FROM_WHEELS: "1"})
    assert not wheels.ok
    assert "ROS from wheels has no DDS security" in wheels.found
    missing = machine.protection(None, {security.KEYSTORE: str(tmp_path)})
    assert (missing.ok, "make one with" in missing.remedy) == (False, True)
    for enclave in security.enclaves():
        (tmp_path / f"enclaves{enclave}").mkdir(parents=True)
        (tmp_path / f"enclaves{enclave}" / "key.pem").touch()
    whole = machine.protection(None, {security.KEYSTORE: str(tmp_path)})
    assert whole.ok
    assert "SROS2 enforced" in whole.found
    assert "keys of every process" in whole.found
    (tmp_path / "enclaves/hindrax/thrusters/key.pem").unlink()
    assert "keys of the operator only" in machine.protection(None, {security.KEYSTORE: str(tmp_path)}).found
