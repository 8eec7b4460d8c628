"""`identify` over logs of PX4 and ArduSub."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from identify_desk import Desk, desk, force_at

from hindrax_analysis import api
from hindrax_analysis.coefficients_file import read_coefficients
from hindrax_analysis.testing.ulog import ulog
from hindrax_cli.command_line import main
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.vehicle import Drag, Vehicle, load_vehicle
from hindrax_tools import ardusub

__all__ = ["desk"]
"""A fixture of all tests."""

# ---- logs of autopilots


def px4_log(vehicle: Vehicle, surge: Drag, mass_kg: float) -> Iterator[tuple[str, int, tuple[float, ...]]]:
    """Surge of a vehicle whose battery sags from 16.5 V to 13.5 V, heading north-east: 150 s of a log of PX4."""
    rng, v, step_s = np.random.default_rng(5), 0.0, 0.05
    for step in range(3000):
        at_us, volts = 50_000 * step, 16.5 - 0.001 * step
        pulses = ardusub.outputs("surge", (0.5, -0.5, 0.25, -0.25, -0.4, 0.4)[step // 80 % 6])
        if step % 100 == 0:  # 5 s: the curves are made for a voltage, and it falls slowly
            applied = AppliedWrench(vehicle, volts - 0.05)
        v += step_s * (applied.wrench(applied.forces_N(pulses))[0] - surge.k_q * abs(v) * v - surge.k_l * v) / mass_kg
        seen, late_us = math.sqrt(0.5) * (v + rng.normal(0.0, 0.01)), at_us + 50_000
        yield "vehicle_attitude", 0, (late_us, late_us, math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8))
        yield "vehicle_local_position", 0, (late_us, late_us, seen, seen, 0.0, True, True)
        yield "actuator_outputs", 0, (at_us, *pulses, *[0] * 8)
        yield "battery_status", 0, (at_us, volts)


def test_a_log_of_px4_is_identified_at_the_logged_voltage(desk: Desk) -> None:
    vehicle, file = load_vehicle(ardusub.HEAVY), desk.folder / "dive.ulg"
    water = vehicle.hydrodynamics
    assert water is not None
    file.write_bytes(b"".join(ulog(px4_log(vehicle, water.surge, vehicle.mass_kg + water.added_mass[0]))))
    document = desk.identified(file, "--vehicle", ardusub.HEAVY)
    assert list(document["motions"]) == ["surge"], "rounding in sway was taken for motion"
    assert "joint" not in document, "pitch by the thrusters below the center was counted, in a log without rates"
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    true = {"k_q": {"value": water.surge.k_q}, "k_l": {"value": water.surge.k_l}}
    assert force_at(surge, 0.5) == pytest.approx(force_at(true, 0.5), rel=0.03)
    assert any("13.5 to 16.5 V" in one for one in document["assumptions"])


@pytest.mark.parametrize(("frame", "count", "x_m"), [(1, 6, 0.0), (2, 8, 0.25)])
def test_the_file_of_a_simulator_is_of_what_it_simulates(
    frame: int, count: int, x_m: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SIM_Submarine: vertical thrusters at 0.25 m along both axes, or abeam; no thrust is lost, added mass is none."""
    log, made = tmp_path / "sitl.bin", tmp_path / "mine.yaml"
    outputs = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, count + 1)}
    log.write_bytes(dataflash_of_yaw({"FRAME_CONFIG": float(frame), "SIM_BUOYANCY": 1.0} | outputs))
    assert main(["vehicle", "new", "mine", "--from", str(log), "--out", str(made)]) == 0
    (shown,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  ./hindrax vehicle show "))
    assert main(["vehicle", "show", *shown.split()[3:]]) == 0, "the next command finds the file where --out put it"
    vehicle = load_vehicle(made)
    assert (vehicle.name, vehicle.losses, len(vehicle.thrusters)) == ("mine", False, count)
    assert vehicle.thrusters[4].position_m == (x_m, 0.25, 0.0)
    assert vehicle.measuring("velocity") == ("estimator",)


def test_the_log_of_an_ardusub_says_which_vehicle_it_is_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`identify dive.bin` and no other file; and the vehicle file that `vehicle new --from` makes of it."""
    log = tmp_path / "dive.bin"
    parameters = {"FRAME_CONFIG": 2.0, "MOT_4_DIRECTION": -1.0} | {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 9)}
    log.write_bytes(dataflash_of_yaw(parameters))
    assert main(["identify", str(log)]) in (0, 1)
    told = capsys.readouterr().err
    assert "the log's frame belongs to bluerov2-heavy, whose hull is assumed" in told
    assert "name no outputs" not in told
    of_library = api.identify(log, vehicle=load_vehicle(ardusub.HEAVY)).vehicle
    assert [one.name for one in of_library.thrusters if one.reversed] == ["T4"]
    made = tmp_path / "mine.yaml"
    assert main(["vehicle", "new", "mine", "--from", str(log), "--out", str(made)]) == 0
    vehicle = load_vehicle(made)
    assert vehicle.name == "mine"
    assert [one.name for one in vehicle.thrusters if one.reversed] == ["T4"]
    assert "simulator" not in told + capsys.readouterr().err + made.read_text()
    log.write_bytes(dataflash_of_yaw(parameters | {"SIM_BUOYANCY": 1.0}))
    capsys.readouterr()
    assert main(["identify", str(log), "--vehicle", "bluerov2-heavy"]) in (0, 1)
    told = " ".join(capsys.readouterr().err.split())
    assert "ArduPilot's simulator, whose thrust, levers and water are not those of bluerov2-heavy" in told
    assert "`./hindrax vehicle new NAME --from LOG` makes the file of its vehicle" in told
    assert main(["identify", str(log), "--coefficients", str(tmp_path / "sitl.yaml")]) in (0, 1)
    assert "ArduPilot's simulator, whose own vehicle is assumed" in " ".join(capsys.readouterr().err.split())
    assert read_coefficients(tmp_path / "sitl.yaml").conditions.vehicle == "ardusub-sitl"
    log.write_bytes(dataflash_of_yaw({"FRAME_CONFIG": 5.0}))
    assert main(["vehicle", "new", "other", "--from", str(log), "--out", str(tmp_path / "o.yaml")]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "found FRAME_CONFIG 5, wanted an ArduSub with the frame 1" in told
    assert "describe its thrusters by hand (docs/how-to/new-vehicle.md" in told
    assert "ten questions" not in told, "they know no such frame"
    assert main(["identify", str(log)]) == 2
    assert "name no outputs (SERVOn_FUNCTION): the outputs of the vehicle file are assumed" in (
        told := capsys.readouterr().err
    )
    assert "FRAME_CONFIG is 5, wanted one of a vehicle in the box, 1 (bluerov2), 2 (" in told


def dataflash_of_yaw(parameters: dict[str, float]) -> bytes:
    """A DataFlash log of an ArduSub without a DVL that yaws: parameters, attitude, rates and pulses."""
    formats = {
        "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
        "PARM": (1, "QNf", "TimeUS,Name,Value", "<Q16sf"),
        "ATT": (2, "Qccc", "TimeUS,Roll,Pitch,Yaw", "<Qhhh"),
        "IMU": (3, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ", "<QBfff"),
        "RCOU": (4, "Q" + "H" * 8, "TimeUS," + ",".join(f"C{n}" for n in range(1, 9)), "<Q8H"),
    }

    def packed(name: str, *values: float | bytes) -> bytes:
        return b"\xa3\x95" + bytes([formats[name][0]]) + struct.pack(formats[name][3], *values)

    log = [
        packed("FMT", number, 3 + struct.calcsize(layout), name.encode(), kinds.encode(), columns.encode())
        for name, (number, kinds, columns, layout) in formats.items()
    ]
    log += [packed("PARM", 1_000_000, name.encode(), value) for name, value in parameters.items()]
    for step in range(400):
        at_us, turning = 1_000_000 + 50_000 * step, 1 if step // 80 % 2 else -1
        log.append(packed("ATT", at_us, 0, 0, 0))
        log.append(packed("IMU", at_us, 0, 0.0, 0.0, 0.5 * turning))
        log.append(packed("RCOU", at_us, *(1500 + 80 * turning * side for side in (-1, 1, -1, 1)), *[1500] * 4))
    return b"".join(log)
