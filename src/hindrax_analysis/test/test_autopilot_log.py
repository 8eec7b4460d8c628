"""Logs of ArduPilot and PX4, written here as the autopilots do: velocities in body axes, forces by the vehicle file."""

import math
import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from hindrax_analysis.records.ardupilot_log import CHANNELS, WRAP_S, read_starts
from hindrax_analysis.records.autopilot_log import read_log
from hindrax_analysis.records.autopilot_vehicle import logged_wiring, wired
from hindrax_analysis.records.recording import Recording, events, reason_to_skip
from hindrax_analysis.testing.ulog import ulog
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.errors import UsageError
from hindrax_core.rotation import matrix, rotate
from hindrax_core.signals import Supply, Thrust
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.assess.objections import Code

ROV = load_vehicle(default_vehicle())
VOLTS = 14.2
ATTITUDE = (0.1, -0.2, 3.1)
BODY = (0.4, -0.1, 0.05)
NORTH_EAST_DOWN = rotate(matrix(ATTITUDE), BODY)
RATES = (0.01, 0.02, 0.3)
PULSES = [1600, 1450, 1550, 1500, 1500, 1580, 0, 1420]
STEPS = 30


def tlog(
    start_ms: int = 0,
    flags: int | None = None,
    late_us: Callable[[int], int] = lambda _step: 0,
    system: int = 0,
) -> Iterator[bytes]:
    """Recorded telemetry: the time of receipt [us since 1970] before each packet."""
    link = ardupilotmega.MAVLink(None, srcSystem=system)
    for step in range(STEPS):
        at_ms = start_ms + 100 * step
        status = [] if flags is None else [ardupilotmega.MAVLink_ekf_status_report_message(flags, *[0.0] * 6)]
        for message in (
            *status,
            ardupilotmega.MAVLink_attitude_message(at_ms, *ATTITUDE, *RATES),
            ardupilotmega.MAVLink_local_position_ned_message(at_ms, 0.0, 0.0, 1.0, *NORTH_EAST_DOWN),
            ardupilotmega.MAVLink_servo_output_raw_message(1000 * at_ms % 2**32, 0, *PULSES),
            ardupilotmega.MAVLink_servo_output_raw_message(1000 * at_ms % 2**32, 1, *([1100] * 8)),
            ardupilotmega.MAVLink_scaled_pressure_message(at_ms, 1013.0 + 0.01 * step, 0.0, 2000),
            ardupilotmega.MAVLink_scaled_pressure2_message(at_ms, 1013.25 + 98.0665 * 0.02 * step, 0.0, 2000),
            ardupilotmega.MAVLink_sys_status_message(0, 0, 0, 0, round(1e3 * VOLTS), 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            yield struct.pack(">Q", 1_700_000_000_000_000 + 1000 * at_ms + late_us(step)) + message.pack(link)


FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
    "ATT": (1, "Qccc", "TimeUS,Roll,Pitch,Yaw", "<Qhhh"),
    "XKF1": (2, "QBfff", "TimeUS,C,VN,VE,VD", "<QBfff"),
    "IMU": (3, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ", "<QBfff"),
    "RCOU": (4, "QHHHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8", "<Q8H"),
    "BAT": (5, "QBf", "TimeUS,Inst,Volt", "<QBf"),
    "XKF4": (6, "QBI", "TimeUS,C,SS", "<QBI"),
    "BARO": (7, "QBf", "TimeUS,I,Press", "<QBf"),
    "PARM": (8, "QNf", "TimeUS,Name,Value", "<Q16sf"),
}
"""Messages of a DataFlash log: number, format, columns; format of Python."""


def packed(name: str, *values: float | bytes) -> bytes:
    return b"\xa3\x95" + bytes([FORMATS[name][0]]) + struct.pack(FORMATS[name][3], *values)


def dataflash(status: int = 0x1F, *, velocities: bool = True) -> Iterator[bytes]:
    for name, (number, kinds, columns, format_) in FORMATS.items():
        length = 3 + struct.calcsize(format_)
        yield packed("FMT", number, length, name.encode(), kinds.encode(), columns.encode())
    for step in range(STEPS):
        at_us = 1_000_000 + 100_000 * step
        yield packed("ATT", at_us, *(round(1e2 * math.degrees(angle)) for angle in ATTITUDE))
        yield packed("XKF4", at_us, 0, status)
        if velocities:
            yield packed("XKF1", at_us, 0, *NORTH_EAST_DOWN)
            yield packed("XKF1", at_us, 1, 9.0, 9.0, 9.0)
        yield packed("BARO", at_us, 0, 101_300.0 + step)
        yield packed("BARO", at_us, 1, 101_325.0 + 9806.65 * 0.02 * step)
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
    (one,) = read_log(file, vehicle)
    return one


def test_velocities_are_turned_into_body_axes(log: Path) -> None:
    found = read(log)
    moving = np.isfinite(found.velocity[:, 0])
    assert moving.sum() == STEPS
    assert found.velocity[moving][-1, :3].tolist() == pytest.approx(BODY, abs=1e-4)
    assert found.velocity[~moving][-1, 3:].tolist() == pytest.approx(RATES, abs=1e-6)
    tilted = np.isfinite(found.attitude[:, 0])
    assert found.attitude[tilted][-1, :2].tolist() == pytest.approx(ATTITUDE[:2], abs=1e-4)
    assert found.duration_s == pytest.approx(0.1 * (STEPS - 1), abs=1e-3)


def test_forces_are_those_of_the_curves_at_the_logged_voltage(log: Path) -> None:
    found = read(log)
    applied = AppliedWrench(ROV, VOLTS)
    pulses = [float(pulse) or 1500.0 for pulse in PULSES]
    assert found.wrench[-1].tolist() == pytest.approx(applied.wrench(applied.forces_N(pulses)), rel=1e-6)
    assert len(found.wrench_t) == STEPS
    assert any("14.2 to 14.2 V" in one for one in found.assumptions)
    # It was corrected, and feared all the same: a twentieth of the drag that no voltage could explain any more.
    assert found.supply is Supply.MEASURED
    thrusts = [one.reading for one in events(found, 0) if isinstance(one.reading, Thrust)]
    assert {one.supply for one in thrusts} == {Supply.MEASURED}


def test_without_thrusters_the_remedy_is_named(log: Path) -> None:
    with pytest.raises(UsageError, match=r"name (a vehicle file with thrusters|the vehicle by --vehicle: bluerov2, b)"):
        read_log(log, None)
    with pytest.raises(UsageError, match="name a vehicle file with thrusters"):
        read_log(log, replace(ROV, thrusters=()))


@pytest.mark.parametrize("ending", list(LOGS))
@pytest.mark.parametrize("content", [b"", b"hello", bytes(range(256)) * 40, b"\xa3\x95\x80" + b"\xff" * 400,
                                     b"ULog\x01\x12\x35\x01" + b"\xff" * 400, b"".join(ulog([]))])  # fmt: skip
def test_what_is_no_log_is_refused_in_one_sentence(tmp_path: Path, ending: str, content: bytes) -> None:
    file = tmp_path / f"x.{ending}"
    file.write_bytes(content)
    with pytest.raises(UsageError, match=r"x\.(bin|tlog|ulg): "):
        read(file)


@pytest.mark.parametrize("ending", [".bin", ".tlog", ".ulg"])
def test_what_is_no_log_is_not_sent_for_a_vehicle_file(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"x{ending}"
    file.write_bytes(b"\xff\xfe\x00garbage" * 9)
    with pytest.raises(UsageError, match=rf"x\{ending}: (found nothing that is known|is no log of ArduPilot)"):
        read_log(file, None)


def test_telemetry_of_a_few_bytes_is_refused_in_words_of_ours(tmp_path: Path) -> None:
    """Not in those of an exception: 'NoneType' object has no attribute '_instance_field'."""
    file = tmp_path / "x.tlog"
    heartbeat = ardupilotmega.MAVLink_heartbeat_message(12, 3, 128, 19, 4, 3)
    packed = heartbeat.pack(ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1))
    file.write_bytes(struct.pack(">Q", 1_700_000_000_000_000) + packed[:-6])
    with pytest.raises(UsageError, match=r"x\.tlog: is no log of ArduPilot, or is cut off \(\w+ of pymavlink\); copy"):
        read(file)


def test_a_log_that_was_cut_is_read_as_far_as_it_goes(log: Path) -> None:
    whole = log.read_bytes()
    log.write_bytes(whole[: len(whole) - 37])
    assert STEPS - 2 <= len(read(log).wrench_t) <= STEPS


def test_a_log_with_many_flipped_bits_is_refused_in_one_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What the headers show, the values have too."""
    damaged = bytearray(b"".join(dataflash()))
    for at in random.Random(1).sample(range(2000, len(damaged)), len(damaged) // 20):
        damaged[at] ^= 0x55
    file = tmp_path / "x.bin"
    file.write_bytes(damaged)
    with pytest.raises(UsageError, match=r"x\.bin: is damaged in \d+ places, with \d+ messages .* again$"):
        read(file)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("source", "scale"), [(1.0, 9800.0 / (1025.0 * 9.80665)), (2.0, 1.0)])
def test_a_descent_is_counted_in_the_water_of_the_vehicle_file(source: float, scale: float, tmp_path: Path) -> None:
    """In sea water an autopilot that knows of fresh water has 2.5 % too much; its range finder (2) has not."""
    told = {"BARO_SPEC_GRAV": 1.0, "EK3_SRC1_POSZ": source}
    parameters = b"".join(packed("PARM", 1_000_000, name.encode(), value) for name, value in told.items())
    file, sea = tmp_path / "x.bin", replace(ROV, water=replace(ROV.water, density_kgpm3=1025.0))
    file.write_bytes(b"".join(dataflash()) + parameters)
    found = read(file, sea)
    moved = found.velocity[np.isfinite(found.velocity[:, 0]), :3]
    world = moved @ np.array(matrix(ATTITUDE)).T
    north, east, down = NORTH_EAST_DOWN
    assert world == pytest.approx(np.tile([north, east, scale * down], (STEPS, 1)), abs=1e-3)
    assert any("vertical velocities are scaled by 0.975" in one for one in found.assumptions) == (scale != 1.0)


def test_a_kind_that_a_flipped_bit_has_made_costs_one_message(tmp_path: Path) -> None:
    """The index of pymavlink ends at the first kind that is not defined: half of a log was lost without a word."""
    content, file = bytearray(b"".join(dataflash())), tmp_path / "x.bin"
    file.write_bytes(content)
    whole = read(file)
    at = content.index(b"\xa3\x95" + bytes([FORMATS["RCOU"][0]]), len(content) // 2)
    content[at + 2] ^= 0x40
    file.write_bytes(content)
    found = read(file)
    assert len(found.wrench_t) == len(whole.wrench_t) - 1
    assert found.wrench_t[-1] == whole.wrench_t[-1]
    assert "the file is damaged in 1 place; what is no message there is left out" in found.assumptions


@pytest.mark.parametrize(("column", "said"), [(b"GyrX", b"GyqX"), (b"TimeUS,Roll", b"TimdUS,Roll")])
def test_a_column_that_a_flipped_bit_has_renamed_is_not_zero(column: bytes, said: bytes, tmp_path: Path) -> None:
    content, file = b"".join(dataflash()), tmp_path / "x.bin"
    file.write_bytes(content.replace(column, said, 1))
    found = read(file)
    rates = found.velocity[np.isfinite(found.velocity[:, 3]), 3:]
    assert len(rates) == 0 if column == b"GyrX" else rates == pytest.approx(np.tile(RATES, (STEPS, 1)), abs=1e-6)


def test_a_kind_whose_values_have_another_type_now_is_damaged(tmp_path: Path) -> None:
    content, file = b"".join(dataflash()), tmp_path / "x.bin"
    file.write_bytes(content.replace(b"QBfff\0", b"QBnnn\0"))
    with pytest.raises(UsageError, match=r"x\.bin: is damaged in \d+ places"):
        read(file)


def test_a_log_without_its_beginning_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "x.bin"
    file.write_bytes(b"".join(dataflash())[1000:])
    with pytest.raises(UsageError, match=r"x\.bin: found no message that is whole.* the beginning of a log"):
        read(file)


def test_a_pulse_that_no_output_has_costs_its_row_and_many_are_refused(tmp_path: Path) -> None:
    content, file = bytearray(b"".join(dataflash())), tmp_path / "x.bin"
    header = b"\xa3\x95" + bytes([FORMATS["RCOU"][0]])
    at = content.index(header, len(content) // 2)
    content[at + 3 + 8 + 1] ^= 0x40  # the high byte of C1
    file.write_bytes(content)
    found = read(file)
    assert len(found.wrench_t) == STEPS - 1
    assert any("1 row of pulses that no output has: damage" in one for one in found.assumptions)
    for _ in range(3):
        at = content.index(header, at + 1)
        content[at + 3 + 8 + 1] ^= 0x40
    file.write_bytes(content)
    with pytest.raises(UsageError, match=r"found a pulse of \d+ us, wanted"):
        read(file)


@pytest.mark.parametrize("modern", [False, True])
def test_a_log_of_an_older_px4_has_the_rates_of_its_gyroscopes(modern: bool, tmp_path: Path) -> None:
    """A log of release 1.6 without velocities was refused, although it holds rates; today's has both."""
    rows = [one for one in px4() if modern or one[0] != "vehicle_angular_velocity"]
    gyros = [
        ("sensor_combined", 0, (at[0], 0.5, 0.6, 0.7)) for name, instance, at in rows if name == "vehicle_attitude"
    ]
    file = tmp_path / "dive.ulg"
    file.write_bytes(b"".join(ulog([*gyros, *rows])))
    found = read(file)
    rates = found.velocity[np.isfinite(found.velocity[:, 3]), 3:]
    assert rates == pytest.approx(np.tile(RATES if modern else (0.5, 0.6, 0.7), (len(rates), 1)), abs=1e-6)
    assert len(rates) >= STEPS - 1


def test_a_log_of_px4_without_pulses_is_refused_with_what_can_be_done(tmp_path: Path) -> None:
    """As where it logs `actuator_motors` alone."""
    file = tmp_path / "x.ulg"
    file.write_bytes(b"".join(ulog([row for row in px4() if row[0] != "actuator_outputs"])))
    with pytest.raises(UsageError, match=r"wanted the pulses .*actuator_motors, shares of full throttle"):
        read(file)


def test_damage_of_a_log_of_px4_is_named(tmp_path: Path) -> None:
    content, file = b"".join(ulog(px4())), tmp_path / "x.ulg"
    half = len(content) // 2
    file.write_bytes(content[:half] + bytes(300) + content[half + 300 :])
    assert "the file is damaged; what pyulog could not read is left out" in read(file).assumptions


@pytest.mark.parametrize("bit", [0, 7])
def test_a_flipped_bit_of_a_time_is_no_start_of_the_autopilot(bit: int, tmp_path: Path) -> None:
    """One message 2 h or 9e9 s ahead of its neighbors made two records of one; of 1,798 such messages six."""
    file = tmp_path / "x.bin"
    file.write_bytes(b"".join(dataflash()))
    whole, content = read_starts(file), bytearray(file.read_bytes())
    header = b"\xa3\x95" + content[content.rindex(b"\xa3\x95") + 2 :][:1]
    at = content.rindex(header, 0, len(content) - 300)  # within the log, not at its end
    content[at + 3 + (7 if bit else 4)] ^= 1 << bit
    file.write_bytes(content)
    assert len(read_starts(file)) == len(whole) == 1


CONSTANT_POSITION = 1 << 7


@pytest.mark.parametrize("flags", [CONSTANT_POSITION | 0x1F, 0x01])
def test_a_velocity_that_nobody_measured_is_no_data(flags: int, tmp_path: Path) -> None:
    """An estimator without aiding goes on to write velocities; they were 0.4 m/s wrong at 0.8 m/s."""
    for ending, content in (("bin", dataflash(flags)), ("tlog", tlog(flags=flags))):
        file = tmp_path / f"dive.{ending}"
        file.write_bytes(b"".join(content))
        found = read(file)
        assert not np.isfinite(found.velocity[:, :3]).any()
        assert any("constant-position mode" in one for one in found.assumptions)
        assert np.isfinite(found.velocity[:, 3:]).all(axis=1).sum() == STEPS  # rates serve roll, pitch and yaw
        assert np.isfinite(found.attitude[:, 2]).sum() == STEPS  # and the water pressure serves heave


def test_a_log_without_velocities_has_rates_and_depths(tmp_path: Path) -> None:
    file = tmp_path / "dive.bin"
    file.write_bytes(b"".join(dataflash(velocities=False)))
    found = read(file)
    depth = found.attitude[np.isfinite(found.attitude[:, 2]), 2]
    assert depth[-1] - depth[0] == pytest.approx(0.02 * (STEPS - 1), abs=1e-3)  # of the sensor in the water
    assert "no velocities are logged" in found.assumptions[0]
    assert "surge" in reason_to_skip(found, 0)
    assert reason_to_skip(found, 5).code is Code.CONSTANT_THRUST


def test_telemetry_counts_the_time_of_the_autopilot_not_of_the_receipt(tmp_path: Path) -> None:
    """A receipt that wanders by 0.4 s made sway unidentifiable, and invented an inflow loss."""
    file = tmp_path / "dive.tlog"
    file.write_bytes(b"".join(tlog(late_us=lambda step: 400_000 * (step % 2))))
    found = read(file)
    for times in (found.wrench_t, found.velocity_t[np.isfinite(found.velocity[:, 0])]):
        assert np.diff(times) == pytest.approx(np.full(STEPS - 1, 0.1), abs=1e-3)


def test_the_time_of_the_outputs_begins_again_and_the_record_does_not(tmp_path: Path) -> None:
    """Microseconds of 32 bits: 71.6 minutes."""
    file = tmp_path / "dive.tlog"
    file.write_bytes(b"".join(tlog(start_ms=round(1e3 * WRAP_S) - 1000)))
    found = read(file)
    assert len(found.wrench_t) == STEPS
    assert found.duration_s == pytest.approx(0.1 * (STEPS - 1), abs=1e-3)


def test_each_start_of_the_autopilot_is_a_record(tmp_path: Path) -> None:
    file = tmp_path / "dive.tlog"
    file.write_bytes(b"".join([*tlog(start_ms=60_000), *tlog()]))
    found = read_log(file, ROV)
    assert [one.duration_s for one in found] == pytest.approx([2.9, 2.9], abs=1e-3)
    assert "the autopilot started 2 times: each is a record" in found[1].assumptions


def test_a_second_vehicle_of_the_network_is_left_out(tmp_path: Path) -> None:
    """A ground station records all vehicles into one file; mixed, their rates and outputs are those of neither."""
    file = tmp_path / "dive.tlog"
    both = zip(tlog(system=1), tlog(system=7, start_ms=900_000), strict=True)
    file.write_bytes(b"".join(packet for pair in both for packet in pair))
    (found,) = read_log(file, ROV)
    assert len(found.wrench_t) == STEPS
    assert found.duration_s == pytest.approx(2.9, abs=1e-3)
    assert "messages of other vehicles (MAVLink system 7) are left out" in found.assumptions


def test_a_message_without_a_time_before_all_others_is_no_start(tmp_path: Path) -> None:
    """A ground station that connects in mid-dive may record the supply first: its receipt is no time since power-up."""
    file = tmp_path / "dive.tlog"
    packets = list(tlog())
    file.write_bytes(b"".join([packets[-1][:8] + packets[6][8:], *packets]))
    (found,) = read_log(file, ROV)
    assert found.duration_s == pytest.approx(2.9, abs=1e-3)
    assert not any("started" in one for one in found.assumptions)


def test_a_dive_that_never_went_down_says_why_there_is_no_heave(tmp_path: Path) -> None:
    """At the surface and on the bench the pressure is that of the air in the hull, or does not change."""
    file = tmp_path / "dive.tlog"
    number = ardupilotmega.MAVLINK_MSG_ID_SCALED_PRESSURE2.to_bytes(3, "little")
    flat = [one for one in tlog(flags=CONSTANT_POSITION) if one[8 + 7 : 8 + 10] != number]
    file.write_bytes(b"".join(flat))
    found = read(file)
    assert not np.isfinite(found.attitude[:, 2]).any()
    assert "the pressure varies by less than 5 cm of water: heave cannot be identified" in found.assumptions


def test_channels_are_those_of_the_messages() -> None:
    assert hasattr(ardupilotmega.MAVLink_servo_output_raw_message(0, 0, *range(8)), f"servo{CHANNELS}_raw")


PARAMETERS = {"FRAME_CONFIG": 2.0} | {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 9)} | {"MOT_3_DIRECTION": -1.0}
SWAPPED = PARAMETERS | {"SERVO1_FUNCTION": 38.0, "SERVO6_FUNCTION": 33.0, "SERVO6_REVERSED": 1.0}


def with_parameters(parameters: dict[str, float]) -> bytes:
    records = [packed("PARM", 1_000_000, name.encode(), value) for name, value in parameters.items()]
    log = list(dataflash())
    return b"".join([*log[: len(FORMATS)], *records, *log[len(FORMATS) :]])


def test_a_log_of_parameters_alone_is_one_and_names_what_to_let_the_autopilot_log(tmp_path: Path) -> None:
    """LOG_BITMASK 0: it was called no log of ArduPilot."""
    file = tmp_path / "dive.bin"
    records = [packed("PARM", 1_000_000, name.encode(), value) for name, value in PARAMETERS.items()]
    file.write_bytes(b"".join([*list(dataflash())[: len(FORMATS)], *records]))
    assert logged_wiring([file]) is not None
    with pytest.raises(UsageError, match=r"wanted the velocities or rates .*; let the autopilot log it \(LOG_BITMASK"):
        read(file)
    with pytest.raises(UsageError, match="LOG_BITMASK"):
        read_log(file, None)


def test_the_wiring_of_an_ardusub_is_in_its_log(tmp_path: Path) -> None:
    file = tmp_path / "dive.bin"
    file.write_bytes(with_parameters(SWAPPED))
    plain = logged_wiring([file])
    assert plain is not None
    assert plain.turned == (3,), "SERVOn_REVERSED is none of a motor's, but where its pulses are scaled"
    file.write_bytes(with_parameters(SWAPPED | {"MOT_PWM_TYPE": 8.0}))
    wiring = logged_wiring([tmp_path / "not.csv", file])
    assert wiring is not None
    assert wiring.kind == "bluerov2-heavy"
    assert wiring.motors[1] == (5, True)  # motor 1 at output 6, which is reversed
    assert wiring.motors[6] == (0, False)
    assert wiring.turned == (1, 3)
    heavy = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")
    found = wired(heavy, wiring).thrusters
    assert [one.channel for one in found] == [5, 1, 2, 3, 4, 0, 6, 7]
    assert [one.name for one in found if one.reversed] == ["T1", "T3"]
    with pytest.raises(UsageError, match=r"has 6 thrusters, the autopilot drives 8"):
        wired(load_vehicle(default_vehicle().parent / "bluerov2.yaml"), wiring)
    few = {name: value for name, value in SWAPPED.items() if not name.startswith("SERVO8")}
    file.write_bytes(with_parameters(few | {"SERVO3_FUNCTION": math.nan}))
    cut = logged_wiring([file])
    assert cut is not None
    with pytest.raises(UsageError, match=r"drives 6 \(by its SERVOn_FUNCTION motors 1, 2, 4, 5, 6, 7\)"):
        wired(heavy, cut)
    for parameters in ({"SERVO1_FUNCTION": 33.0}, SWAPPED | {"FRAME_CONFIG": math.nan}):
        file.write_bytes(with_parameters(parameters))
        assert logged_wiring([file]) is None


@pytest.mark.parametrize(("name", "motors"), [("bluerov2", 6), ("bluerov2-heavy", 8)])
def test_vehicles_in_the_box_push_as_ardusubs_frames_do(name: str, motors: int) -> None:
    """AP_Motors6DOF: T1 135, T2 -135, T3 45, T4 -45 degrees of azimuth; T5 and up -90 degrees of elevation."""
    thrusters = load_vehicle(default_vehicle().parent / f"{name}.yaml").thrusters
    assert len(thrusters) == motors
    assert [one.azimuth_deg for one in thrusters[:4]] == [135.0, -135.0, 45.0, -45.0]
    assert {one.elevation_deg for one in thrusters[4:]} == {-90.0}
