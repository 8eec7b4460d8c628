"""The operator's commands: what their words mean, what is refused before the vehicle is asked, what is said."""

import contextlib
import json
import math
import re
import signal
import socket
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any, NoReturn

import numpy as np
import pytest
import yaml

from hindrax_analysis.identification.verdict import NextFlight
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle, vehicle_file
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import FOLDER, StackLock
from hindrax_bringup.stack_runner import asked_to_end, startup_text
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine import mock
from hindrax_cli.commands.operate import manual_control
from hindrax_cli.commands.pool import report_export
from hindrax_control.allocation.allocator import Allocator
from hindrax_control.allocation.thrust_curve import ThrustCurve
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import fitted
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import AllocationStatus
from hindrax_operator import one_thruster
from hindrax_operator.one_thruster import pulses_of
from hindrax_operator.pool_run import FlownManeuver, finish, simulated_world


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))


# ---- lights


def test_one_brightness_goes_for_every_lamp() -> None:
    assert manual_control.brightness(["0.5"], 2) == [0.5, 0.5]
    assert manual_control.brightness(["1", "0"], 2) == [1.0, 0.0]
    assert manual_control.brightness(["off"], 2) == [0.0, 0.0]


# ---- recentre


def test_a_place_is_meters_and_degrees_or_nothing() -> None:
    assert manual_control.place_of(["5", "3", "90"]) == pytest.approx((5.0, 3.0, math.pi / 2))
    assert manual_control.place_of(["5", "3"])[:2] == (5.0, 3.0)
    assert all(map(math.isnan, manual_control.place_of([])))
    assert manual_control.place_text(5.0, 3.0) == "5.00 m from the south wall, 3.00 m from the west wall"
    assert manual_control.place_text(math.nan, math.nan) == "at its start"


# ---- hold


def test_angles_are_given_in_degrees_and_distances_in_meters() -> None:
    axes, value, engaged = manual_control.held("heading", "90")
    assert (axes, engaged) == (("heading",), True)
    assert value == pytest.approx(math.pi / 2)
    assert manual_control.held("depth", "0.8") == (("depth",), 0.8, True)


def test_without_a_value_the_vehicle_holds_where_it_is() -> None:
    axes, value, engaged = manual_control.held("altitude", None)
    assert (axes, engaged) == (("altitude",), True)
    assert math.isnan(value)


def test_off_lets_go_of_one_or_all() -> None:
    assert manual_control.held("roll", "off")[::2] == (("roll",), False)
    assert manual_control.held("all", "off")[::2] == (
        ("heading", "roll", "pitch", "depth", "altitude", "station"),
        False,
    )


def test_headings_are_shown_from_0_to_360() -> None:
    assert manual_control.shown("heading", math.radians(-90.0)) == "270.0 deg"
    assert manual_control.shown("pitch", math.radians(-10.0)) == "-10.0 deg"
    assert manual_control.shown("depth", 0.8) == "0.80 m"
    assert manual_control.shown("station", 0.0) == "this place"


# ---- joystick


def test_steering_without_a_stack_states_where_it_is_looked_for(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the node of the joystick needs it")
    monkeypatch.setattr("hindrax_ros.process.StopSignal", lambda: Message(number=signal.SIGINT))
    monkeypatch.setattr("hindrax_ros.process.spin", lambda _make, _words, _stop: 0)
    assert main(["joystick"]) == 130
    assert "no `./hindrax up` runs here; looking in the ROS graph" in capsys.readouterr().err


# ---- wrench


def test_a_wrench_is_six_finite_numbers() -> None:
    assert manual_control.checked([1, 2, 3, 4, 5, 6]) == (1, 2, 3, 4, 5, 6)


def test_a_wrench_beyond_the_limits_of_the_vehicle_is_refused() -> None:
    limits = load_vehicle(default_vehicle()).limits.wrench
    manual_control.require_within(limits, limits)
    with pytest.raises(UsageError, match=r"wrench N: found -500, wanted -\d+ to \d+ "):
        manual_control.require_within((0.0, 0.0, 0.0, 0.0, 0.0, -500.0), limits)


def test_what_came_of_a_wrench_names_what_lacks() -> None:
    plan = AllocationStatus(
        achieved=[9.0, 0.0, 0.0, 0.0, 0.0, 0.5], shortfall=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], refused=["Y: found nan"]
    )
    printed = manual_control.outcome_text(plan)
    assert printed == "done; total force including holds: X +9.0 N, N +0.5 N m; lacking X +1.0 N; refused: Y: found nan"
    assert manual_control.wrench_text([0.01] * 6) == "nothing"


# ---- thruster


VEHICLE = load_vehicle(default_vehicle())


@pytest.mark.parametrize("name", ["3", "T3"])
def test_one_thruster_alone_gets_a_pulse_and_the_others_rest(name: str) -> None:
    index, pulses = pulses_of(VEHICLE, name, -4.0)
    assert index == 2
    assert 1100.0 < pulses[2] < 1475.0
    assert [pulse for at, pulse in enumerate(pulses) if at != 2] == [1500.0] * 7
    assert pulses_of(VEHICLE, name, 4.0)[1][2] > 1525.0


def test_a_thruster_at_a_desk_is_not_waited_for_in_silence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextlib.contextmanager
    def nobody(_stack: object) -> Iterator[Message]:
        yield Message(thrusters=None, pause=lambda _seconds: None)

    monkeypatch.setattr(one_thruster, "joined", nobody)
    monkeypatch.setattr(one_thruster, "stacks", list)
    monkeypatch.setattr(one_thruster, "_own_thrusters", lambda _file, *, mock: pytest.fail(f"started, mock: {mock}"))
    file = hindrax_file(tmp_path, ("/dev/i2c-1", str(tmp_path / "i2c")))
    with pytest.raises(HindraxError, match=r"no thrusters on the graph and no .*/i2c on this machine.* --mock"):
        one_thruster.run_one("T1", 3.0, 1.0, file, mock=False)
    assert "looking for thrusters in the ROS graph of this terminal" in " ".join(capsys.readouterr().err.split())


def test_one_thruster_of_two_stacks_is_that_of_the_one_that_was_named(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [StackLock(pid, True, str(default_vehicle()), "runs", {}) for pid in (7, 8)]
    joined: list[StackLock] = []

    def join(stack: StackLock) -> NoReturn:
        joined.append(stack)
        raise HindraxError("joined")

    monkeypatch.setattr(one_thruster, "joined", join)
    monkeypatch.setattr(one_thruster, "stacks", lambda: found)
    with pytest.raises(UsageError, match=r"found 2 stacks, wanted one: add --stack PID; 7 .*; 8 "):
        one_thruster.run_one("T1", 3.0, 1.0, default_vehicle(), mock=True)
    with pytest.raises(HindraxError, match="joined"):
        one_thruster.run_one("T1", 3.0, 1.0, default_vehicle(), mock=False, pid=8)
    assert joined == [found[1]]


@pytest.mark.parametrize(
    ("name", "force", "words"),
    [
        ("0", 1.0, "has T1, T2, T3, T4, T5, T6, T7, T8, or 1 to 8"),
        ("9", 1.0, "not of this vehicle"),
        ("T9", 1.0, "not of this vehicle"),
        ("1", 1e3, "wanted -15"),
        ("1", math.nan, "found nan N"),
        ("1", 0.05, "less than it can give"),
    ],
)
def test_a_thruster_that_cannot_do_it_states_what_it_can(name: str, force: float, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        pulses_of(VEHICLE, name, force)


def test_the_forces_that_are_wanted_are_taken() -> None:
    with pytest.raises(UsageError, match="found 1000 N, wanted ") as refused:
        pulses_of(VEHICLE, "1", 1000.0)
    low, high = re.findall(r"-?\d+\.\d", str(refused.value))
    assert pulses_of(VEHICLE, "1", float(low))[1][0] < pulses_of(VEHICLE, "1", float(high))[1][0]


def test_no_force_is_rest() -> None:
    assert pulses_of(VEHICLE, "1", 0.0)[1] == [1500.0] * 8


def sweep_file(folder: Path, offset_N: float, volts: float, linear: float) -> Path:
    pulses = np.r_[np.linspace(1100, 1470, 12), np.linspace(1530, 1900, 12)]
    loads = 2e-7 * (pulses - 1500) ** 3 + linear * (pulses - 1500) + offset_N
    rows = [f"{pulse},{load},{volts}" for pulse, load in zip(pulses, loads, strict=True)]
    sweep = folder / "sweep.csv"
    sweep.write_text("\n".join(["pulse_us,load_N,supply_V", *rows]), encoding="utf-8")
    return sweep


def test_a_sweep_becomes_the_curve_of_the_vehicle_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, sweep = hindrax_file(tmp_path), sweep_file(tmp_path, 0.0, 15.2, 4e-3)
    words = ["thruster", "fit", str(sweep), "--lever-ratio", "2", "--load-cell-std", "0.02", "--vehicle", str(file)]
    assert main(words) == 0
    assert "--write saves it to" in capsys.readouterr().out
    assert load_vehicle(file).curves["main"].supply_V == 14.8
    assert main([*words, "--write"]) == 0
    curve = load_vehicle(file).curves["main"]
    assert curve.supply_V == 15.2
    assert curve.positive is not None
    assert curve.positive.force_N(1800.0) == pytest.approx(2 * (2e-7 * 300**3 + 4e-3 * 300), rel=1e-6)
    before, after = (yaml.safe_load(path.read_text(encoding="utf-8")) for path in (default_vehicle(), file))
    assert after | {"curves": before["curves"]} == before


def test_data_of_a_manufacturer_become_a_table_that_allocates(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, data = hindrax_file(tmp_path), tmp_path / "T200 16V.csv"
    pulses = [*range(1100, 1901, 4)]
    kgf = [math.copysign(max(0.0, abs(pulse - 1500) - 28) ** 1.5 / 1500.0, pulse - 1500) for pulse in pulses]
    lines = [
        f"{pulse},0,0.1,{volts},1,{force * volts / 16:.6f},1"
        for volts in (12, 16)
        for pulse, force in zip(pulses, kgf, strict=True)
    ]
    header = " PWM (µs), RPM, Current (A), Voltage (V), Power (W), Force (Kg f), Efficiency (g/W)"
    data.write_text("\n".join([header, *lines]), encoding="utf-8")
    assert main(["thruster", "fit", str(data), "--vehicle", str(file), "--write"]) == 0
    told = capsys.readouterr().out
    assert "1472 to 1528" in told
    vehicle = load_vehicle(file)
    table = vehicle.curves["main"].table
    assert table is not None
    assert table.supply_V == (12.0, 16.0)
    assert (vehicle.supply_V, vehicle.curves["main"].gain_sigma) == (14.8, 0.05)
    for volts in (12.0, 14.0, 16.0):
        found = Allocator(vehicle).allocate((10.0, 0.0, 5.0, 0.0, 0.0, 1.0), supply_V=volts)
        assert found.achieved == pytest.approx(found.wanted, abs=0.15)
    assert main(["vehicle", "check", str(file)]) == 0


def test_the_deviation_of_the_load_cell_is_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sweep = sweep_file(tmp_path, 0.0, 15.2, 4e-3)
    for words in (["thruster", "fit", str(sweep)], ["bollard", str(sweep)]):
        assert main(words) == 2
        assert (
            "--load-cell-std: found none, wanted how far the load cell may be off, such as 0.02"
            in capsys.readouterr().err
        )


def test_low_thrust_that_a_cubic_misses_is_said_and_a_table_follows_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, sweep = hindrax_file(tmp_path), tmp_path / "sweep.csv"
    pulses = [*range(1100, 1901, 20)]
    loads = [math.copysign(max(0.0, abs(pulse - 1500) - 20) ** 1.5 / 300.0, pulse - 1500) for pulse in pulses]
    sweep.write_text(
        "\n".join(["pulse_us,load_N", *(f"{p},{f}" for p, f in zip(pulses, loads, strict=True))]), encoding="utf-8"
    )
    words = ["thruster", "fit", str(sweep), "--load-cell-std", "0.02", "--supply", "14.8", "--vehicle", str(file)]
    main(words)
    assert "--table" in capsys.readouterr().err
    assert main([*words, "--table", "--write"]) == 0
    curve = ThrustCurve(load_vehicle(file).curves["main"])
    for pulse, load in zip(pulses, loads, strict=True):
        assert curve.force(pulse) == pytest.approx(load, abs=0.06 + 0.015 * abs(load)), pulse


@pytest.mark.parametrize(
    ("offset_N", "volts", "reason"),
    [
        (
            3.0,
            15.2,
            "branch gives 0.8.* N at 1470 us, wanted a negative force; tare the load cell, .* outliers",
        ),
        (0.0, 15200.0, "curves.main.supply_V: found 15200, wanted 5 to 60 .*; look for another unit"),
    ],
)
def test_a_sweep_that_makes_no_curve_is_refused_before_it_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], offset_N: float, volts: float, reason: str
) -> None:
    sweep = sweep_file(tmp_path, offset_N, volts, 0.07)
    assert main(["thruster", "fit", str(sweep), "--load-cell-std", "0.02"]) == 1
    assert re.search(reason, capsys.readouterr().err)


# ---- pool-test


def test_a_mock_that_ran_into_a_wall_reports_it_at_the_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nothing: Any = Message(results=Message(motions={}))
    finish(nothing, RunFolder(tmp_path), FlownManeuver(facts={"wall_hits": 0}), NextFlight())
    assert capsys.readouterr().err == ""
    finish(nothing, RunFolder(tmp_path), FlownManeuver(facts={"wall_hits": 2}), NextFlight())
    assert capsys.readouterr().err == "the mock vehicle ran into a wall of its pool (contacts: 2)\n"


def test_the_world_that_was_drawn_is_for_the_report_with_its_units() -> None:
    facts = {"world": {"tether": 0.52449, "wake": 0.00172}, "world_units": {"tether": "N", "wake": "-"}}
    assert simulated_world(facts) == ["the mock's world: tether 0.524 N, wake 0.00172"]
    assert simulated_world({}) == []


def test_a_terminal_does_without_the_sizes_of_the_mocks_world(capsys: pytest.CaptureFixture[str]) -> None:
    facts = {"world": {"tether": 0.52449}, "world_units": {"tether": "N"}}
    report_export._note([*(f"assumed: {one}" for one in simulated_world(facts)), "surge: k_q 59"])
    assert capsys.readouterr().err == "note: surge: k_q 59\n"


def test_the_last_line_of_a_run_is_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nothing: Any = Message(results=Message(motions={}))
    finish(nothing, RunFolder(tmp_path), FlownManeuver(), NextFlight())
    assert capsys.readouterr().out == f"report: {tmp_path / 'report.html'}\n"


# ---- up and mock


def test_up_states_how_to_reach_it(tmp_path: Path) -> None:
    lock = StackLock(5, True, "v", "f", {"ROS_DOMAIN_ID": "7", "ROS_DISTRO": "jazzy"})
    printed = startup_text(lock, RunFolder(tmp_path), record=True)
    assert "export ROS_DOMAIN_ID=7\n" in printed
    assert str(tmp_path / "bag") in printed
    assert "bag" not in startup_text(lock, RunFolder(Path("x")), record=False)


def test_settings_of_up_can_be_copied_from_a_narrow_screen() -> None:
    settings = {
        "ROS_DOMAIN_ID": "117",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTRTPS_DEFAULT_PROFILES_FILE": "/run/user/1000/hindrax/tether-of-some-length/eth0/profiles.xml",
    }
    printed = startup_text(StackLock(5, True, "v", "f", settings), RunFolder(Path("x")), record=True)
    lines = fitted(printed, 60).splitlines()
    for key, value in settings.items():
        assert f"export {key}={value}" in [line.strip() for line in lines]
    assert all(len(line) <= 60 for line in lines if "PROFILES" not in line)


@pytest.mark.parametrize(
    ("numbers", "end"),
    [
        ([signal.SIGINT, signal.SIGTERM], pytest.raises(KeyboardInterrupt)),
        ([signal.SIGTERM, signal.SIGTERM], contextlib.nullcontext()),
    ],
)
def test_a_signal_is_noted_and_interrupts_nothing(
    numbers: list[int], end: contextlib.AbstractContextManager[object]
) -> None:
    seen: list[bool] = []
    with end, asked_to_end() as over:
        assert not over()
        for number in numbers:
            signal.raise_signal(number)
        seen.append(over())
    assert seen == [True]


def test_the_devices_alone_lie_at_stable_paths_and_only_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reported: dict[str, str] = {}
    asked = threading.Event()
    folder = tmp_path / "runtime" / "mock"

    def tell(found: Mapping[str, str]) -> None:
        reported.update(found)
        assert main(["mock"]) == 1
        asked.set()

    mock.serve(default_vehicle(), MockOptions(rate=1.0), tell, asked.is_set)
    assert reported["dvl75"] == str(folder / "dvl75")
    assert reported["icm20948"] == reported["clock"] == f"mock:{folder / 'i2c'}"
    assert "a mock runs there already" in capsys.readouterr().err
    assert not (folder / "dvl75").exists()


def test_ports_are_reported_to_people_scripts_and_programs() -> None:
    found = {"dvl75": "/run/dvl75", "clock": "mock:/run/i2c"}
    assert mock.plain(found) == "dvl75 /run/dvl75\nclock mock:/run/i2c"
    assert json.loads(mock.document(found)) == {"ports": found}
    assert "  dvl75  /run/dvl75" in mock.table(found)
    assert "udp" not in mock.table(found)


def test_a_port_that_the_network_has_is_not_given(tmp_path: Path) -> None:
    reported: dict[str, str] = {}
    options, place = MockOptions(rate=1.0), tmp_path / "ports"
    mock.serve(default_vehicle(), options, reported.update, lambda: True, place=place, dvl_udp=True)
    assert reported["dvl75"] == "udp://0.0.0.0:27000"
    assert reported["ping1d"] == str(tmp_path / "ports" / "ping1d")
    assert "udp://0.0.0.0:27000: listen there; it accepts commands at port 50000" in mock.table(reported)


def test_an_autopilot_is_served_at_the_port_that_is_free(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reported: dict[str, str] = {}
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        heavy = ["mock", "--vehicle", "bluerov2-heavy", "--folder", str(tmp_path / "ports"), "--autopilot-tcp"]
        assert main([*heavy, str(port)]) == 1
        assert f"tcp {port} for a device: Address already in use" in capsys.readouterr().err
    options, place = MockOptions(rate=1.0), tmp_path / "ports"
    vehicle = vehicle_file("bluerov2-heavy")
    mock.serve(vehicle, options, reported.update, lambda: True, place=place, autopilot_tcp=port)
    assert reported["thrusters"] == f"tcp://127.0.0.1:{port}"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main(["mock", "--folder", str(tmp_path / "file" / "mock")]) == 2
    assert "choose another with --folder" in capsys.readouterr().err
