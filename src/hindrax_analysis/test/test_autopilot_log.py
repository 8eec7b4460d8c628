"""Logs of ArduPilot and PX4, written here as the autopilots do: velocities in body axes, forces by the vehicle file."""

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from ulog import ulog

from hindrax_analysis.records.autopilot_log import CHANNELS, read_log
from hindrax_analysis.records.recording import Recording
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.errors import UsageError
from hindrax_core.rotation import matrix, rotate
from hindrax_core.vehicle import Vehicle, load_vehicle

ROV = load_vehicle(default_vehicle())
VOLTS = 14.2
ATTITUDE = (0.1, -0.2, 3.1)
BODY = (0.4, -0.1, 0.05)
NORTH_EAST_DOWN = rotate(matrix(ATTITUDE), BODY)
RATES = (0.01, 0.02, 0.3)
PULSES = [1600, 1450, 1550, 1500, 1500, 1580, 0, 1420]
STEPS = 30


def tlog() -> Iterator[bytes]:
    """Recorded telemetry: the time of receipt [us since 1970] before each packet."""
    link = ardupilotmega.MAVLink(None)
    for step in range(STEPS):
        at_ms = 100 * step
        for message in (
            ardupilotmega.MAVLink_attitude_message(at_ms, *ATTITUDE, *RATES),
            ardupilotmega.MAVLink_local_position_ned_message(at_ms, 0.0, 0.0, 1.0, *NORTH_EAST_DOWN),
            ardupilotmega.MAVLink_servo_output_raw_message(1000 * at_ms, 0, *PULSES),
            ardupilotmega.MAVLink_servo_output_raw_message(1000 * at_ms, 1, *([1100] * 8)),
            ardupilotmega.MAVLink_sys_status_message(0, 0, 0, 0, round(1e3 * VOLTS), 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            yield struct.pack(">Q", 1_700_000_000_000_000 + 1000 * at_ms) + message.pack(link)


FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
    "ATT": (1, "Qccc", "TimeUS,Roll,Pitch,Yaw", "<Qhhh"),
    "XKF1": (2, "QBfff", "TimeUS,C,VN,VE,VD", "<QBfff"),
    "IMU": (3, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ", "<QBfff"),
    "RCOU": (4, "QHHHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8", "<Q8H"),
    "BAT": (5, "QBf", "TimeUS,Inst,Volt", "<QBf"),
}
"""Messages of a DataFlash log: number, format, columns; format of Python."""


def packed(name: str, *values: float | bytes) -> bytes:
    return b"\xa3\x95" + bytes([FORMATS[name][0]]) + struct.pack(FORMATS[name][3], *values)


def dataflash() -> Iterator[bytes]:
    for name, (number, kinds, columns, format_) in FORMATS.items():
        length = 3 + struct.calcsize(format_)
        yield packed("FMT", number, length, name.encode(), kinds.encode(), columns.encode())
    for step in range(STEPS):
        at_us = 1_000_000 + 100_000 * step
        yield packed("ATT", at_us, *(round(1e2 * math.degrees(angle)) for angle in ATTITUDE))
        yield packed("XKF1", at_us, 0, *NORTH_EAST_DOWN)
        yield packed("XKF1", at_us, 1, 9.0, 9.0, 9.0)
        yield packed("IMU", at_us, 0, *RATES)
        yield packed("RCOU", at_us, *PULSES)
        yield packed("BAT", at_us, 0, VOLTS)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """w, x, y, z of angles that are applied z-y-x. Fossen 2011 eq. 2.75 and following."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle / 2.0), math.sin(angle / 2.0)) for angle in (roll, pitch, yaw))
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy)  # fmt: skip


def px4() -> Iterator[tuple[str, int, tuple[float, ...]]]:
    """Two drivers of outputs: the thrusters are at the second. Velocities come once more where they are not valid."""
    for step in range(STEPS):
        at_us = 1_000_000 + 100_000 * step
        late_us = at_us + 7_000
        yield "vehicle_attitude", 0, (late_us, at_us, *quaternion(*ATTITUDE))
        yield "vehicle_local_position", 0, (late_us, at_us, *NORTH_EAST_DOWN, True, True)
        yield "vehicle_local_position", 0, (late_us, at_us + 1000, 9.0, 9.0, 9.0, False, True)
        yield "vehicle_local_position", 0, (late_us, at_us - 1000, 9.0, 9.0, 9.0, True, True)
        yield "vehicle_angular_velocity", 0, (late_us, at_us, *RATES)
        yield "actuator_outputs", 0, (at_us, *[1500] * 16)
        yield "actuator_outputs", 1, (at_us, *(PULSES if step else [1500] * 8), *[0] * 8)
        yield "battery_status", 0, (at_us, VOLTS)
        yield "battery_status", 1, (at_us, 11.0)


LOGS: dict[str, Callable[[], Iterator[bytes]]] = {"tlog": tlog, "bin": dataflash, "ulg": lambda: ulog(px4())}


@pytest.fixture(params=list(LOGS))
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    file = tmp_path / f"dive.{request.param}"
    file.write_bytes(b"".join(LOGS[request.param]()))
    return file


def read(file: Path, vehicle: Vehicle = ROV) -> Recording:
    return read_log(file, vehicle)


def test_velocities_are_turned_into_body_axes(log: Path) -> None:
    found = read(log)
    moving = found.velocity[:, 0] == found.velocity[:, 0]
    assert moving.sum() == STEPS
    assert found.velocity[moving][-1, :3].tolist() == pytest.approx(BODY, abs=1e-4)
    assert found.velocity[~moving][-1, 3:].tolist() == pytest.approx(RATES, abs=1e-6)
    assert found.attitude[-1, :2].tolist() == pytest.approx(ATTITUDE[:2], abs=1e-4)
    assert found.duration_s == pytest.approx(0.1 * (STEPS - 1), abs=1e-3)


def test_forces_are_those_of_the_curves_at_the_logged_voltage(log: Path) -> None:
    found = read(log)
    applied = AppliedWrench(ROV, VOLTS)
    pulses = [float(pulse) or 1500.0 for pulse in PULSES]
    assert found.wrench[-1].tolist() == pytest.approx(applied.wrench(applied.forces_N(pulses)), rel=1e-6)
    assert len(found.wrench_t) == STEPS
    assert any("14.2 to 14.2 V" in one for one in found.assumptions)


def test_without_thrusters_the_remedy_is_named(log: Path) -> None:
    with pytest.raises(UsageError, match="name a vehicle file with thrusters"):
        read_log(log, None)


@pytest.mark.parametrize("ending", list(LOGS))
@pytest.mark.parametrize("content", [b"", b"hello", bytes(range(256)) * 40, b"\xa3\x95\x80" + b"\xff" * 400,
                                     b"ULog\x01\x12\x35\x01" + b"\xff" * 400, b"".join(ulog([]))])  # fmt: skip
def test_what_is_no_log_is_refused_in_one_sentence(tmp_path: Path, ending: str, content: bytes) -> None:
    file = tmp_path / f"x.{ending}"
    file.write_bytes(content)
    with pytest.raises(UsageError, match=r"x\.(bin|tlog|ulg): "):
        read(file)


def test_a_log_that_was_cut_is_read_as_far_as_it_goes(log: Path) -> None:
    whole = log.read_bytes()
    log.write_bytes(whole[: len(whole) - 37])
    assert STEPS - 2 <= len(read(log).wrench_t) <= STEPS


def test_channels_are_those_of_the_messages() -> None:
    assert hasattr(ardupilotmega.MAVLink_servo_output_raw_message(0, 0, *range(8)), f"servo{CHANNELS}_raw")
