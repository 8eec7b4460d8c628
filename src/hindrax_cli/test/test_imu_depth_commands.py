"""`hindrax imu` and `hindrax depth` against emulated sensors behind the mock's socket."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap_ros2.writer import Writer

from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine.calibration import calibration
from hindrax_core.bus_operations import Transaction
from hindrax_core.events import Stamp, to_s
from hindrax_core.readings import Pressure
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.imu_calibration import Correction
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.icm20948 import Icm20948
from hindrax_sim.devices.imu.imu_signal import ImuTruth, SensorErrors
from hindrax_sim.devices.ms5837 import Ms5837
from hindrax_sim.testing.mock_wires import jumping_bus

FIELD_T = np.array([20e-6, 5e-6, -15e-6])
GRAVITY = np.array([0.0, 0.0, 9.80665])
IRON_T = (12e-6, -8e-6, 5e-6)
OFFSET_mps2 = (0.2, -0.1, 0.15)


def turning(seconds: float) -> ImuTruth:
    """All round, slowly."""
    a, b, c = 0.43 * seconds, 0.31 * seconds, 0.17 * seconds
    roll = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    pitch = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    yaw = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    turn = roll @ pitch @ yaw
    return ImuTruth(tuple((turn @ GRAVITY).tolist()), (0.1, 0.0, 0.0), tuple((turn @ FIELD_T).tolist()))


class Bench:
    """Sensors on a bus."""

    def __init__(self, motion: Callable[[float], ImuTruth], air_Pa: float) -> None:
        self.port = ""
        self.imu = Icm20948(2, SensorErrors(hard_iron_T=IRON_T, accel_offset_mps2=OFFSET_mps2))
        self.pressure = Ms5837(seed=2)
        self.pressure.set_truth(Pressure(air_Pa, 20.0), 0.0)
        self._motion, self._wires = motion, VirtualI2c()
        for address, part in ((0x68, self.imu), (0x0C, self.imu.magnetometer), (0x76, self.pressure)):
            self._wires.attach(address, part)

    def transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        self.imu.set_truth(self._motion(to_s(now)), to_s(now))
        return self._wires.transfer(transaction, now)


@pytest.fixture
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    motion, air_Pa = getattr(request, "param", (turning, 98_765.0))
    one = Bench(motion, air_Pa)
    with jumping_bus(tmp_path / "i2c", one.transfer) as one.port:
        yield one


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    return hindrax_file(tmp_path)


def test_a_live_turn_finds_iron_and_offset_and_keeps_them(
    bench: Bench, vehicle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--port", bench.port, "--vehicle", str(vehicle), "--seconds", "40", "--write", "--json"]
    assert main(["imu", "calibrate", *words]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["written"]
    kept = load_vehicle(vehicle).sensors["icm20948"].calibration
    assert kept["mag_offset_T"] == pytest.approx(IRON_T, abs=0.3e-6)
    assert kept["accel_offset_mps2"] == pytest.approx(OFFSET_mps2, abs=0.02)
    assert kept["accel_matrix"] == pytest.approx((1, 0, 0, 0, 1, 0, 0, 0, 1), abs=0.01)
    assert "# The Hindrax: what it is." in vehicle.read_text()


@pytest.mark.parametrize("bench", [(lambda _: ImuTruth(), 98_765.0)], indirect=True)
def test_without_a_turn_it_states_what_is_missing(
    bench: Bench, vehicle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = vehicle.read_text()
    words = ["--port", bench.port, "--vehicle", str(vehicle), "--seconds", "5", "--write"]
    assert main(["imu", "calibrate", *words]) == 1
    assert "turn the vehicle about" in capsys.readouterr().out
    assert vehicle.read_text() == before


@pytest.mark.parametrize("bench", [(lambda _: ImuTruth(), 98_765.0)], indirect=True)
def test_the_self_test_is_run_and_given(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["imu", "self-test", "--port", bench.port]) == 0
    assert "self test passed" in capsys.readouterr().out
    bench.imu.hang(True)
    assert main(["imu", "self-test", "--port", bench.port, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["passed"] is False


def test_the_tare_is_the_air_pressure_and_is_kept(
    bench: Bench, vehicle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--port", bench.port, "--vehicle", str(vehicle)]
    assert main(["depth", "tare", *words]) == 0
    assert "not saved" in capsys.readouterr().out
    assert load_vehicle(vehicle).water.surface_pressure_Pa == 101325.0
    assert main(["depth", "tare", *words, "--write", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["surface_pressure_Pa"] == pytest.approx(98_765.0, abs=15.0)
    assert load_vehicle(vehicle).water.surface_pressure_Pa == report["surface_pressure_Pa"]
    assert load_vehicle(vehicle).water.density_kgpm3 == 1000.0


@pytest.mark.parametrize("bench", [(turning, 150_000.0)], indirect=True)
def test_a_tare_under_water_is_refused(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["depth", "tare", "--port", bench.port]) == 1
    printed = capsys.readouterr().err
    assert "wanted air pressure" in printed
    assert "surface first" in printed


def test_nobody_there_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["depth", "tare", "--port", f"mock:{tmp_path}/nobody"]) == 1
    assert "no mock hardware answers" in capsys.readouterr().err


LINE = "=" * 80
VECTOR = f"{LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
IMU = "geometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n" + VECTOR
FIELD = "geometry_msgs/Vector3 magnetic_field\n" + VECTOR


def test_a_recorded_turn_does_as_well_as_a_live_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The bag holds only the fields that are used: messages are read by the schema inside it."""
    vector = dict(zip("xyz", (0.0, 0.0, 0.0), strict=True))
    with (tmp_path / "turn.mcap").open("wb") as stream:
        writer = Writer(stream)
        imu = writer.register_msgdef("sensor_msgs/msg/Imu", IMU)
        field = writer.register_msgdef("sensor_msgs/msg/MagneticField", FIELD)
        for turn in range(600):
            truth = turning(turn * 0.1)
            force = dict(zip("xyz", np.add(truth.specific_force_mps2, OFFSET_mps2).tolist(), strict=True))
            iron = dict(zip("xyz", np.add(truth.field_T, IRON_T).tolist(), strict=True))
            both = {"angular_velocity": vector, "linear_acceleration": force}
            writer.write_message("/hindrax/icm20948/data_raw", imu, both, log_time=turn)
            writer.write_message("/hindrax/icm20948/mag", field, {"magnetic_field": iron}, log_time=turn)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    assert main(["imu", "calibrate", "--bag", str(tmp_path / "turn.mcap"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["calibration"]
    assert found["mag_offset_T"] == pytest.approx(IRON_T, abs=1e-9)
    assert found["accel_offset_mps2"] == pytest.approx(OFFSET_mps2, abs=1e-6)


def test_a_second_calibration_builds_on_the_first() -> None:
    rng = np.random.default_rng(1)
    directions = rng.standard_normal((400, 3))
    unit = directions / np.linalg.norm(directions, axis=1)[:, None]
    first = Correction((1e-6, 2e-6, 3e-6), (1.1, 0.0, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0))
    raw = (45e-6 * unit) * np.array([1.2, 1.0, 0.9]) + np.array([5e-6, -4e-6, 2e-6])
    half = [first.apply(*row) for row in raw.tolist()]
    found, _ = calibration([], half, first.entries("mag", "T"))
    assert found["mag_offset_T"] == pytest.approx((5e-6, -4e-6, 2e-6), abs=1e-8)
