"""Messages of an autopilot against frames of pymavlink, and what we send and emulate as pymavlink reads it."""

import itertools
import math
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from pymavlink.dialects.v20 import ardupilotmega

from hindrax_bringup.share_files import simulated_vehicle
from hindrax_control.navigation.navigator import Navigator
from hindrax_core.driver_interface import Send, Trouble
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Pressure
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.devices.ardusub import ArduSub as Sensor
from hindrax_drivers.devices.ardusub import ArduSubKnobs
from hindrax_drivers.protocols import ardupilot, mavlink
from hindrax_drivers.protocols.ardupilot import (
    FROM_AUTOPILOT,
    Attitude,
    Barometer,
    Distance,
    EstimatorStatus,
    LocalPosition,
    NamedFloat,
    ParameterValue,
    RawImu,
    ServoOutput,
    Supply,
    Version,
)
from hindrax_drivers.protocols.mavlink import Decoder, MavlinkFrame
from hindrax_sim.devices.ardupilot import firmware, wire

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
SITL = simulated_vehicle()
READ: dict[str, object] = {
    "attitude": Attitude(5000, (0.125, -0.25, 1.5), (0.5, -0.75, 0.0625)),
    "pressure": Barometer(5000, 2, 121325.0, 18.5),
    "supply": Supply(15.23, 4.12),
    "supply_unhealthy": Supply(15.23, 4.12, 0x08),
    "servos": ServoOutput(77, (*map(float, range(1500, 1508)), 1100.0, *(0.0,) * 7)),
    "distance": Distance(9, 2.15, 25, 1.0),
    "parameter": ParameterValue("FRAME_CONFIG", 2.0),
    "version": Version((4, 5, 1)),
    "estimator": EstimatorStatus(129),
    "gain": NamedFloat("PilotGain", 0.25),
    "position": LocalPosition(9, (1.5, -2.5, 0.75), (0.25, -0.5, 0.125)),
}


def read(name: str) -> Any:
    (frame,) = Decoder(FROM_AUTOPILOT).feed(bytes.fromhex(CASES[name]), Stamp(1))
    assert isinstance(frame, MavlinkFrame)
    return frame.message


def judged(data: bytes) -> Any:
    (found,) = ardupilotmega.MAVLink(None).parse_buffer(data)
    return found


@pytest.mark.parametrize("name", READ)
def test_a_message_is_read_in_si_units(name: str) -> None:
    assert read(name) == READ[name]


def test_inertial_samples_are_of_mg_mrad_per_s_and_mgauss() -> None:
    found: RawImu = read("raw_imu")
    assert found.boot_us == 12_345_678
    assert found.force_mps2 == pytest.approx((0.117680, -0.333426, -9.816457), abs=1e-6)
    assert found.rate_radps == pytest.approx((0.1, -0.2, 0.3))
    assert found.field_T == pytest.approx((17.5e-6, 0.0, -13.8e-6))
    assert found.temperature_C == 25.12
    assert math.isnan(read("raw_imu_without_temperature").temperature_C)


def test_the_outputs_from_17_on_are_none_of_the_thrusters() -> None:
    assert read("servos_from_17") is None


def test_what_is_not_measured_is_no_number() -> None:
    found: Supply = read("supply_unmeasured")
    assert math.isnan(found.voltage_V)
    assert math.isnan(found.current_A)


def test_what_we_send_is_read_by_pymavlink() -> None:
    sticks = judged(mavlink.encode(ardupilot.manual_control((100, -200, 620, 300, -40, 25), 7), 0, 255))
    assert (sticks.get_srcSystem(), sticks.target, sticks.buttons, sticks.buttons2) == (255, 7, 0, 0)
    assert (sticks.x, sticks.y, sticks.z, sticks.r) == (100, -200, 620, 300)
    assert (sticks.enabled_extensions, sticks.s, sticks.t) == (3, -40, 25)
    test = judged(mavlink.encode(mavlink.command_long(209, [3, 1, 1622, 0.5, 0, 2], 0, 7), 0, 255))
    assert (test.target_system, test.target_component, test.command) == (7, 1, 209)
    assert (test.param1, test.param2, test.param3, test.param4, test.param6) == (3, 1, 1622, 0.5, 2)
    asked = judged(mavlink.encode(ardupilot.read_parameter("SERVO16_FUNCTION", 7), 0, 255))
    assert (asked.target_system, asked.param_index, asked.param_id) == (7, -1, "SERVO16_FUNCTION")
    beat = judged(mavlink.encode(ardupilot.beat(6), 0, 255))
    assert (beat.type, beat.autopilot, beat.base_mode) == (6, 8, 0)


def test_the_emulated_autopilot_speaks_as_pymavlink_reads() -> None:
    board = firmware.ArduSub((), now_s=0.0)
    end = ardupilotmega.MAVLink(None, srcSystem=255, srcComponent=190)
    found: dict[str, Any] = {}
    for number in (1, 27, 30, 36, 65, 137, 148, 193):
        order = end.command_long_encode(1, 1, 512, 0, number, 0, 0, 0, 0, 0, 0).pack(end)
        for one in ardupilotmega.MAVLink(None).parse_buffer(board.receive(bytes(order), 0.1 * number)):
            found[one.get_type()] = one
    for one in ardupilotmega.MAVLink(None).parse_buffer(board.step(20.0)):
        found[one.get_type()] = one
    assert found["COMMAND_ACK"].result == 0
    assert found["SYS_STATUS"].voltage_battery == 14800
    assert found["RAW_IMU"].zacc == pytest.approx(-1000, abs=12)
    assert found["SCALED_PRESSURE2"].press_abs == pytest.approx(1013.25, abs=1.5)
    assert found["RC_CHANNELS"].chan6_raw == 1500
    assert found["NAMED_VALUE_FLOAT"].name == "PilotGain"
    assert len(found) == 11


def test_the_emulator_has_the_layouts_of_pymavlink() -> None:
    for number, layout in wire.LAYOUTS.items():
        theirs = ardupilotmega.mavlink_map[number]
        assert (layout.extra, layout.fields.size) == (theirs.crc_extra, theirs.unpacker.size), theirs.msgname


def barometers(
    knobs: ArduSubKnobs, noise_Pa: Mapping[int, float], seconds: float = 5.0, times: int = 1, air_hPa: float = 1013.0
) -> list[Any]:
    """What the sensor makes of an autopilot whose barometers, by number, have so much noise; 20 pressures a second.

    Each is sent so many `times` before the next is measured.
    """
    sensor, end, draws = Sensor(knobs), ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1), random.Random(1)
    beat = bytes(end.heartbeat_encode(12, 3, 0, 0, 4).pack(end))
    made = {1: end.scaled_pressure_encode, 2: end.scaled_pressure2_encode}
    asked, outputs, measured = set[int](), list(sensor.start(stamp_from_s(0.0))), dict[int, float]()
    for step in range(int(20 * seconds)):
        now = stamp_from_s(0.05 * (step + 1))
        outputs += sensor.feed(beat, now) if step % 20 == 0 else ()
        outputs += sensor.feed(
            bytes(end.raw_imu_encode(50_000 * step, 0, 0, -1000, step % 2, *(0,) * 5).pack(end)), now
        )
        outputs += sensor.tick(now)
        for one in outputs:
            if isinstance(one, Send) and (order := judged(one.data)).get_type() == "COMMAND_LONG":
                asked.add(int(order.param1))
                outputs += sensor.feed(bytes(end.command_ack_encode(order.command, 0).pack(end)), now)
        outputs = [one for one in outputs if not isinstance(one, Send)]
        for number, sigma in noise_Pa.items():
            if {1: ardupilot.SCALED_PRESSURE, 2: ardupilot.SCALED_PRESSURE2}[number] in asked:
                if step % times == 0 or number not in measured:
                    measured[number] = air_hPa + 10.0 * number + draws.gauss(0.0, sigma / 100.0)
                outputs += sensor.feed(bytes(made[number](50 * step, measured[number], 0.0, 2000).pack(end)), now)
    return outputs


def test_the_pressure_of_a_depth_sensor_that_is_not_healthy_is_none() -> None:
    """ArduSub goes on sending the last one."""
    sensor, end = Sensor(ArduSubKnobs(barometer=2)), ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    sensor.start(stamp_from_s(0.0))
    sensor.feed(bytes(end.heartbeat_encode(12, 3, 0, 0, 4).pack(end)), stamp_from_s(0.1))
    found: list[str] = []
    for step, health in enumerate((8, 8, 0, 0, 8)):
        for made in (
            end.sys_status_encode(8, 8, health, 0, 15000, 100, -1, *(0,) * 6),
            end.scaled_pressure2_encode(100 * step, 1013.0 + step, 0.0, 2000),
        ):
            outputs = sensor.feed(bytes(made.pack(end)), stamp_from_s(0.2 + step))
            found += [one.text if isinstance(one, Trouble) else type(one).__name__ for one in outputs]
    ill = "ardusub: the depth sensor is not healthy, it says: no depth; check the sensor, its cable and its supply"
    wanted = [
        "Stamped",
        "Stamped",
        ill,
        "Rejected",
        "Rejected",
        "ardusub: the depth sensor is healthy again",
        "Stamped",
    ]
    assert found == wanted


def test_time_that_a_simulator_loses_is_no_gap_in_flight() -> None:
    """A SITL that gets no processor for 0.65 s makes up for 0.1 s of it; its samples go on as if nothing had been."""
    sensor, end = Sensor(ArduSubKnobs(barometer=1)), ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    navigator = Navigator(load_vehicle(SITL))
    sensor.start(stamp_from_s(0.0))
    states, told = [], []
    for step in range(800):
        now = stamp_from_s(0.01 * step + (0.55 if step > 500 else 0.0))
        sample = end.raw_imu_encode(10_000 * step, 0, 0, -1000, step % 2, *(0,) * 5)
        beat = end.heartbeat_encode(12, 3, 0, 0, 4)
        outputs = [*(sensor.feed(bytes(beat.pack(end)), now) if step % 100 == 0 else ()), *sensor.tick(now)]
        for one in (*outputs, *sensor.feed(bytes(sample.pack(end)), now)):
            told += [one.text] if isinstance(one, Trouble) and "clock" in one.text else []
            states += [navigator.step(one, "autopilot")] if isinstance(one, Stamped) else []
    (began,) = {state.reading.consistency.began for state in states if state}
    assert began < stamp_from_s(0.1)
    assert told == ["ardusub: its clock lost 0.55 s, as that of a simulator on a busy computer, or the link got slower"]


def test_a_pressure_that_is_sent_twice_is_measured_once() -> None:
    found = [one for one in barometers(ArduSubKnobs(barometer=1), {1: 5.0}, times=2) if isinstance(one, Stamped)]
    pressures = [one for one in found if isinstance(one.reading, Pressure)]
    assert len(pressures) == pytest.approx(5.0 * 10, abs=10)
    assert all(sooner.reading != later.reading for sooner, later in itertools.pairwise(pressures))


def test_a_pressure_that_stays_is_passed_on_now_and_then() -> None:
    found = [one for one in barometers(ArduSubKnobs(barometer=1), {1: 0.0}) if isinstance(one, Stamped)]
    stamps_s = [1e-9 * one.stamp for one in found if isinstance(one.reading, Pressure)]
    assert max(later - sooner for sooner, later in itertools.pairwise(stamps_s)) == pytest.approx(0.3, abs=0.051)


@pytest.mark.parametrize("barometer", [None, 1])
def test_a_barometer_that_gives_no_pressure_of_water_is_named_once(barometer: int | None) -> None:
    # An ArduSub 4.5.7 in a SITL that starts 584 m above the sea, which is where sim_vehicle.py starts it by default.
    outputs = barometers(ArduSubKnobs(barometer=barometer), {1: 5.0, 2: 5.0}, air_hPa=-57619.9)
    assert not [one for one in outputs if isinstance(one, Stamped) and isinstance(one.reading, Pressure)]
    (told,) = (one.text for one in outputs if isinstance(one, Trouble))
    assert f"barometer {barometer or 2} gives -57" in told
    assert "-L RATBeach" in told


@pytest.mark.parametrize(
    ("barometer", "noise_Pa", "wanted_hPa", "said"),
    [
        (None, {1: 5.0, 2: 20.0}, 1033.0, ""),  # a BlueROV2: the second is the Bar30
        (None, {1: 5.0, 2: 2000.0}, None, "barometer 2 has a noise of"),  # a SITL: the second is none of depth
        (None, {1: 5.0}, None, "barometer 2 is silent"),  # a Bar30 that died; or a board without a barometer of its own
        (1, {2: 5.0}, None, "barometer 1 is silent: no depth; check the depth sensor"),
        (1, {1: 5.0, 2: 2000.0}, 1023.0, ""),
        (2, {1: 5.0, 2: 2000.0}, 1033.0, ""),  # who names one gets it
    ],
)
def test_depth_is_by_the_second_barometer_or_the_one_that_is_named_and_never_by_another(
    barometer: int | None, noise_Pa: Mapping[int, float], wanted_hPa: float | None, said: str
) -> None:
    outputs = barometers(ArduSubKnobs(barometer=barometer), noise_Pa)
    read = [one.reading for one in outputs if isinstance(one, Stamped)]
    pressures_hPa = [one.pressure_Pa / 100.0 for one in read if isinstance(one, Pressure)]
    if wanted_hPa is None:
        assert not pressures_hPa
    else:
        assert pressures_hPa[-1] == pytest.approx(wanted_hPa, abs=80.0 if barometer == 2 else 1.0)
    told = [one.text for one in outputs if isinstance(one, Trouble)]
    assert [said in one and (barometer == 1 or "barometer:=1" in one) for one in told] == ([True] if said else []), told
