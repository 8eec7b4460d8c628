"""A vehicle file behind an autopilot at an address: what is kept, what is left out, what is no address."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hindrax_bringup.share_files import default_vehicle, simulated_vehicle, vehicle_file
from hindrax_cli import autopilot_vehicle
from hindrax_cli.autopilot_vehicle import ask_autopilot, behind_autopilot
from hindrax_cli.command_line import main
from hindrax_control.maneuver.goal import flyable_motions
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_drivers.buses.clock import Clock
from hindrax_drivers.buses.line import Line, open_line
from hindrax_drivers.output import output_ports
from hindrax_sim.devices.ardupilot.firmware import BOOT_S, ArduSub, AutopilotTruth


def test_only_what_the_autopilot_measures_stays_aboard() -> None:
    file, left_out = behind_autopilot(vehicle_file("bluerov2-heavy"), "tcp:127.0.0.1:5760")
    vehicle, before = load_vehicle(file), load_vehicle(vehicle_file("bluerov2-heavy"))
    assert left_out == ("dvl75", "ping1d")
    assert vehicle.on_output_line == tuple(vehicle.sensors) == ("autopilot", "estimator")
    assert (vehicle.output.device, vehicle.output.port) == ("ardusub", "tcp:127.0.0.1:5760")
    assert vehicle.output.control == "manual_control"
    assert (vehicle.thrusters, vehicle.name) == (before.thrusters, before.name)


def test_a_file_keeps_its_way_of_driving_and_its_mounts(tmp_path: Path) -> None:
    text = vehicle_file("bluerov2-heavy").read_text()
    text = text.replace("control: manual_control", "control: motor_test")
    text = text.replace("autopilot: {device: ardusub,", "imu: {device: ardusub, rotation_deg: [0.0, 0.0, 90.0],")
    mine = tmp_path / "mine.yaml"
    mine.write_text(text)
    vehicle = load_vehicle(behind_autopilot(mine, "udpin:0.0.0.0:14550")[0])
    assert vehicle.output.control == "motor_test"
    assert vehicle.sensors["imu"].rotation_deg == (0.0, 0.0, 90.0)
    assert set(vehicle.sensors) == {"imu", "estimator"}


def test_a_file_without_a_dvl_gets_no_velocity(tmp_path: Path) -> None:
    lines = vehicle_file("bluerov2-heavy").read_text().splitlines(keepends=True)
    mine = tmp_path / "mine.yaml"
    mine.write_text("".join(one for one in lines if "dvl75" not in one))
    vehicle = load_vehicle(behind_autopilot(mine, "udpin:0.0.0.0:14550")[0])
    assert tuple(vehicle.sensors) == ("autopilot",)
    assert not vehicle.measuring("velocity")


@pytest.mark.parametrize(
    ("file", "elsewhere"), [(vehicle_file("bluerov2-heavy"), ("dvl75", "ping1d")), (simulated_vehicle(), ())]
)
def test_an_estimator_that_nothing_aids_is_left_out(file: Path, elsewhere: tuple[str, ...]) -> None:
    copy, left_out = behind_autopilot(file, "tcp:127.0.0.1:5760", aided=False)
    vehicle = load_vehicle(copy)
    assert left_out == elsewhere
    assert tuple(vehicle.sensors) == ("autopilot",)
    assert flyable_motions(AXES, vehicle).flown == ("heave", "roll", "pitch", "yaw")


def test_a_vehicle_with_another_output_may_be_flown_by_an_autopilot_too() -> None:
    vehicle = load_vehicle(behind_autopilot(default_vehicle(), "/dev/ttyACM0")[0])
    assert vehicle.output.device == "ardusub"
    assert vehicle.output_channels() == tuple(range(8))


@pytest.mark.parametrize("address", ["", "127.0.0.1:5760", "http://127.0.0.1"])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match=r"--autopilot: found .*, wanted an address such as udpin:"):
        behind_autopilot(default_vehicle(), address)


@contextmanager
def sending(autopilot: ArduSub) -> Iterator[str]:
    """An autopilot that sends datagrams to a free port of this machine, as an endpoint of BlueOS does; its address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    over = threading.Event()

    def run() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.settimeout(0.01)
            while not over.is_set():
                now_s = time.monotonic()
                data = autopilot.step(now_s)
                if data:
                    line.sendto(data, ("127.0.0.1", port))
                try:
                    answer = autopilot.receive(line.recv(4096), now_s)
                except OSError:  # nothing came, or nobody listens yet
                    continue
                line.sendto(answer, ("127.0.0.1", port))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield f"udpin:127.0.0.1:{port}"
    finally:
        over.set()
        thread.join()


def test_the_file_of_a_vehicle_comes_from_the_autopilot_that_it_has(tmp_path: Path) -> None:
    autopilot = ArduSub(load_vehicle(vehicle_file("bluerov2-heavy")).thrusters, now_s=time.monotonic())
    autopilot.parameters |= {
        "MOT_4_DIRECTION": -1.0,
        "SERVO1_FUNCTION": 34.0,
        "SERVO2_FUNCTION": 33.0,
        "MOT_PWM_MAX": 1850.0,
        "BATT_LOW_VOLT": 14.2,
    }
    autopilot.parameters |= {f"SERVO{n}_{what}": 0.0 for n in range(9, 17) for what in ("FUNCTION", "REVERSED")}
    autopilot.parameters |= {f"SERVO{n}_REVERSED": 0.0 for n in range(1, 9)}
    before, made = dict(autopilot.parameters), tmp_path / "mine.yaml"
    with sending(autopilot) as address:
        assert main(["vehicle", "new", "mine", "--from", address, "--out", str(made)]) == 0
    vehicle = load_vehicle(made)
    assert [one.channel for one in vehicle.thrusters] == [1, 0, 2, 3, 4, 5, 6, 7]
    assert [one.name for one in vehicle.thrusters if one.reversed] == ["T4"]
    assert vehicle.limits.battery_V == 14.2
    assert vehicle.output.port == address
    assert tuple(vehicle.sensors) == vehicle.on_output_line, "what else is on board, it does not know"
    assert "pulses from 1100 to 1850 us only" in made.read_text()
    assert autopilot.parameters == before


def test_a_motor_without_an_output_is_named_with_what_helps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    autopilot = ArduSub(load_vehicle(vehicle_file("bluerov2-heavy")).thrusters, now_s=time.monotonic())
    autopilot.parameters["SERVO8_FUNCTION"] = 7.0  # a camera's tilt, as in ArduPilot's own sub.parm
    made = tmp_path / "mine.yaml"
    with sending(autopilot) as address:
        assert main(["vehicle", "new", "mine", "--from", address, "--out", str(made)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "drives 7 (by its SERVOn_FUNCTION motors 1, 2, 3, 4, 5, 6, 7); give each motor its output" in said
    assert "--vehicle" not in said, "this command has no such option"


def test_a_vehicle_file_that_does_not_fit_is_refused_before_anything_is_waited_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    autopilot = ArduSub(load_vehicle(vehicle_file("bluerov2-heavy")).thrusters, now_s=time.monotonic())
    autopilot.parameters |= {"FRAME_CONFIG": 4.0, "SERVO4_FUNCTION": 0.0}
    with sending(autopilot) as address:
        words = ["--autopilot", address, "--vehicle", "bluerov2-heavy", "--dof", "yaw"]
        assert main(["pool-test", *words]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "T4 is at output 4 in the vehicle file, where SERVO4_FUNCTION is 0" in said
    assert "waiting for the estimator" not in said, "it takes a minute"


@pytest.mark.parametrize("velocity_mps", [None, (0.0, 0.0, 0.0)], ids=["nothing", "a DVL of its own"])
def test_what_an_estimator_claims_is_asked_before_anything_starts(
    velocity_mps: tuple[float, float, float] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_up_s = 5.0  # on a busy machine
    monkeypatch.setattr(autopilot_vehicle, "ALIGNED_S", BOOT_S + set_up_s)
    monkeypatch.setattr(autopilot_vehicle, "LOOK_S", 0.3)
    autopilot = ArduSub(load_vehicle(vehicle_file("bluerov2-heavy")).thrusters, now_s=time.monotonic())
    autopilot.set_truth(AutopilotTruth(velocity_mps=velocity_mps), time.monotonic())
    said: list[str] = []
    opened: list[str] = []

    def opening(path: str, baud: int, clock: Clock) -> Line:
        opened.append(path)
        return open_line(path, baud, clock)

    monkeypatch.setattr(output_ports, "open_line", opening)
    with sending(autopilot) as address:
        found = ask_autopilot(vehicle_file("bluerov2-heavy"), address, said.append)
        assert found is (velocity_mps is not None)
        assert opened == [address], "a line may take its time, or serve one at a time"
    if velocity_mps is None:
        assert len(said) == 1
        assert said[0].startswith("waiting for the estimator of the autopilot, which started ")


def test_an_autopilot_that_does_not_answer_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(autopilot_vehicle, "PATIENCE_S", 0.2)
    made = tmp_path / "mine.yaml"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    assert main(["vehicle", "new", "mine", "--from", f"udpin:127.0.0.1:{port}", "--out", str(made)]) == 1
    assert "found no heartbeat of an ArduPilot, wanted an ArduSub that answers" in capsys.readouterr().err
    assert not made.exists()
