"""A vehicle file behind an autopilot at an address: what is kept, what is left out, what is no address."""

from pathlib import Path

import pytest

from hindrax_bringup.share_files import default_vehicle, vehicle_file
from hindrax_cli.autopilot_vehicle import behind_autopilot
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle


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


def test_a_vehicle_with_another_output_may_be_flown_by_an_autopilot_too() -> None:
    vehicle = load_vehicle(behind_autopilot(default_vehicle(), "/dev/ttyACM0")[0])
    assert vehicle.output.device == "ardusub"
    assert vehicle.output_channels() == tuple(range(8))


@pytest.mark.parametrize("address", ["", "127.0.0.1:5760", "http://127.0.0.1"])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match=r"--autopilot: found .*, wanted an address such as udpin:"):
        behind_autopilot(default_vehicle(), address)
