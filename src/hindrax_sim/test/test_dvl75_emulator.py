"""The emulated DVL-75 against its pages."""

import functools
import math
import operator
import re
from itertools import pairwise

import pynmea2
import pytest

from hindrax_sim.devices.dvl75 import BOOT_TEXT, Dvl75, DvlSettings, DvlTruth
from hindrax_sim.devices.dvl75_sentences import over_ground

ON = DvlSettings(deltas=True)
STILL = DvlTruth()


def emitted(device: Dvl75, start_s: float, stop_s: float, truth: DvlTruth = STILL) -> list[str]:
    """Lines of a span of time, each checked for its checksum."""
    data = b""
    for index in range(round((stop_s - start_s) / 0.005) + 1):
        device.set_truth(truth, 0.0)
        data += device.step(start_s + index * 0.005)
    lines = data.decode("ascii").split("\r\n")
    assert lines.pop() == ""
    for line in lines:
        if line.startswith("$"):
            body, _, digits = line[1:].partition("*")
            assert functools.reduce(operator.xor, body.encode()) == int(digits, 16)
    return lines


def deltas(lines: list[str]) -> list[list[float]]:
    return [[float(part) for part in re.split(r"[,*]", line)[1:10]] for line in lines if line.startswith("$DVPDL")]


def test_from_the_factory_there_is_extended_data_and_no_delta() -> None:
    tags = {line[:6] for line in emitted(Dvl75(), 0.0, 2.0)}
    assert tags == {"$DVEXT"}


def test_extended_data_has_34_values_and_an_empty_field() -> None:
    for line in emitted(Dvl75(), 0.0, 2.0):
        fields = line.partition("*")[0].split(",")[1:]
        assert (len(fields), fields[-1]) == (35, "")


def test_deltas_are_the_way_in_the_interval_whose_length_and_end_are_reported() -> None:
    found = deltas(emitted(Dvl75(settings=ON, noise_mps=0.0), 0.0, 3.0, DvlTruth((0.4, -0.2, 0.1))))
    tail = found[12:]
    assert all(one[1] == 50_000 for one in tail)
    assert all(later[0] - earlier[0] == later[1] for earlier, later in pairwise(found))
    for one in tail:
        assert one[5:8] == pytest.approx([0.02, -0.01, 0.005], abs=0.00051)
        assert one[8] == 100


def test_each_delta_is_rounded_by_itself_so_small_ways_are_lost_without_noise() -> None:
    found = deltas(emitted(Dvl75(settings=ON, noise_mps=0.0), 0.0, 10.0, DvlTruth((0.0049, 0.0, 0.0))))
    assert sum(one[5] for one in found) == 0.0


def test_with_noise_the_rounding_errors_average_out() -> None:
    found = deltas(emitted(Dvl75(settings=ON, noise_mps=0.01), 0.0, 200.0, DvlTruth((0.009, 0.0, 0.0))))
    tail = found[20:]
    assert sum(one[5] for one in tail) / (0.05 * len(tail)) == pytest.approx(0.009, abs=0.001)


def test_the_device_s_clock_runs_at_its_own_rate() -> None:
    found = deltas(emitted(Dvl75(settings=ON, drift_ppm=200.0), 0.0, 100.0))
    assert (found[-1][0] - found[0][0]) * 1e-6 == pytest.approx(100.02, abs=0.06)


def test_searching_it_states_zeros_with_confidence_zero() -> None:
    lines = emitted(Dvl75(settings=ON), 0.0, 3.0, DvlTruth((1.0, 1.0, 1.0), altitude_m=None))
    assert all(one[5:] == [0.0, 0.0, 0.0, 0.0] for one in deltas(lines))
    assert any("-0.000" in line for line in lines if line.startswith("$DVPDL"))
    extended = [line.split(",") for line in lines if line.startswith("$DVEXT")]
    assert all(fields[1] == "F" and fields[9] == "0.00" and int(fields[7]) < 0 for fields in extended)


@pytest.mark.parametrize("altitude", [0.09, 75.1])
def test_there_is_no_lock_out_of_reach(altitude: float) -> None:
    assert all(one[8] == 0 for one in deltas(emitted(Dvl75(settings=ON), 0.0, 3.0, DvlTruth(altitude_m=altitude))))


def test_messages_take_their_time_on_the_wire() -> None:
    device = Dvl75(settings=ON)
    device.set_truth(DvlTruth(), 0.0)
    took_s = 76 * 10 / 115200
    assert device.step(0.0) == b""
    assert device.step(0.95 * took_s) == b""
    assert device.step(1.05 * took_s).startswith(b"$DVPDL")


def test_what_was_reported_before_the_first_step_was_received_by_nobody() -> None:
    device = Dvl75(settings=ON)
    device.set_truth(DvlTruth(), 0.0)
    assert device.step(500.0) == b""
    assert len(emitted(device, 500.005, 501.0)) < 50


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_commands_end_with_lf_and_may_have_cr(end: bytes) -> None:
    device = Dvl75()
    device.receive(b"SEND-DVP", 0.0)
    assert device.receive(b"DL ON" + end, 0.0) == b""
    assert device.settings.deltas


def test_configuration_shows_the_settings() -> None:
    device = Dvl75()
    device.receive(b"SET-SPEED-OF-SOUND 1500\nSET-VELOCITY-ADJUSTMENT 1.01\nSEND-DVEXT OFF\n", 0.0)
    for question in (b"CONFIGURATION\n", b"?\n", b"?what\n"):
        answer = device.receive(question, 0.0).decode()
        for pair in ("Model=DVL-75", "Speed of sound=1500.0", "Velocity adjustment=1.010", "DVEXT messages=OFF"):
            assert pair in answer
        assert re.search(r",\*[0-9A-F]{2}\r\n$", answer)


@pytest.mark.parametrize(
    "command", [b"SET-SPEED-OF-SOUND 1099", b"SET-SPEED-OF-SOUND fast", b"SEND-DVPDL MAYBE", b"DANCE", b"SEND-DVPDL"]
)
def test_bad_commands_change_nothing_and_are_reported_to_be_bad(command: bytes) -> None:
    device = Dvl75()
    assert device.receive(command + b"\n", 0.0) == b"Unrecognized command\r\n"
    assert device.settings == DvlSettings()


def sentences(device: Dvl75, tag: str) -> list[list[str]]:
    return [line.partition("*")[0].split(",") for line in emitted(device, 0.0, 3.0) if line.startswith(tag)]


def reported(device: Dvl75, *commands: str) -> Dvl75:
    for command in commands:
        assert device.receive(f"{command}\n".encode(), 0.0) == b"", command
    return device


def test_declination_and_offset_turn_the_heading() -> None:
    turned = reported(Dvl75(), "DECLINATION 5.5", "HEADING-OFFSET 90")
    assert {fields[6] for fields in sentences(turned, "$DVEXT")} == {"95.5"}


def test_the_orientation_of_the_head_turns_the_deltas() -> None:
    device = reported(Dvl75(settings=ON, noise_mps=0.0), "SET-SENSOR-ORIENTATION 0, 0, 90")
    for one in deltas(emitted(device, 0.0, 3.0, DvlTruth((0.4, 0.0, 0.0))))[12:]:
        assert one[5:8] == pytest.approx([0.0, 0.02, 0.0], abs=0.00051)


def test_a_position_moves_with_the_vehicle_and_is_read_by_another_program() -> None:
    device = reported(Dvl75(), "SET-POSITION 44.96,-93.51", "SEND-GPRMC ON", "SEND-DVEXT OFF")
    lines = emitted(device, 0.0, 100.0, DvlTruth((0.5, 0.0, 0.0)))
    found = [pynmea2.parse(line, check=True) for line in lines]
    assert {one.sentence_type for one in found} == {"RMC"}
    assert (found[0].latitude, found[0].longitude) == pytest.approx((44.96, -93.51), abs=1e-5)
    assert found[-1].status == "A"
    assert (found[-1].latitude - 44.96) * 111_319 == pytest.approx(0.5 * 99.5, abs=0.5)


def test_a_calibration_is_kept_and_deleted() -> None:
    device = reported(Dvl75(), "VOID-IMU-CAL")
    assert {fields[3] for fields in sentences(device, "$DVEXT")} == {"0000"}
    reported(device, "GRAB-IMU-CAL")
    assert device.settings.imu_calibrated


def test_kalman_support_and_the_words_of_a_gps_come_when_switched_on() -> None:
    device = reported(Dvl75(), "SEND-DVKFA ON", "RETWEET-GPS ON")
    lines = emitted(device, 0.0, 3.0)
    assert [line.split(",")[2] for line in lines if line.startswith("$DVKFA")][:3] == ["0", "1", "2"]
    assert [line for line in lines if line.startswith("GPS:$GPGGA")]


def test_a_line_speed_is_kept_and_the_pool_is_set_by_ten_numbers() -> None:
    device = reported(Dvl75(), "BAUD-RATE 57600", "MANUAL-MODE 0.001,10.0,0.5,56,0.1,50,20.6,-0.671,100,100")
    device.power_cycle(1.0)
    assert (device.settings.baud, device.settings.pool_mode) == (57600, True)
    assert not reported(device, "MANUAL-MODE OFF").settings.pool_mode
    for command in (b"SET-POOL-MODE ON\n", b"MANUAL-MODE 1,2,3\n", b"BAUD-RATE 1\n"):
        assert device.receive(command, 0.0) == b"Unrecognized command\r\n"


@pytest.mark.parametrize("command", [b"SET-SIDE-TRACKING ON", b"HOST-ADDRESS 192.168.2.2:27000"])
def test_other_commands_of_the_page_are_taken_without_a_word(command: bytes) -> None:
    assert Dvl75().receive(command + b"\n", 0.0) == b""


def test_a_position_of_a_gps_is_taken_without_a_word() -> None:
    line = b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n"
    assert Dvl75().receive(line, 0.0) == b""


def test_pause_resume_and_reboot() -> None:
    device = Dvl75(settings=ON)
    emitted(device, 0.0, 1.0)
    device.receive(b"PAUSE\n", 1.0)
    emitted(device, 1.0, 1.2)
    assert emitted(device, 1.2, 2.0) == []
    device.receive(b"RESUME\n", 2.0)
    assert emitted(device, 2.0, 3.0)
    device.receive(b"REBOOT\n", 3.0)
    lines = emitted(device, 3.0, 5.0)
    assert lines[0].encode() + b"\r\n" == BOOT_TEXT
    assert 0 < deltas(lines)[0][0] < 1e6


def test_a_power_cycle_keeps_what_is_in_flash() -> None:
    device = Dvl75()
    device.receive(b"SEND-DVPDL ON\n", 0.0)
    device.power_cycle(1.0)
    assert device.settings.deltas


def test_faults_of_its_own() -> None:
    device = Dvl75(settings=ON)
    before = deltas(emitted(device, 0.0, 2.0))[-1][0]
    device.jump_clock(1000.0)
    assert deltas(emitted(device, 2.0, 2.2))[-1][0] - before == pytest.approx(1000.2e6, abs=0.06e6)
    device.saturate(True)
    assert deltas(emitted(device, 2.2, 3.0))[-1][5] == 9.999
    device.disguise(True)
    emitted(device, 3.0, 3.1)
    assert {line[:6] for line in emitted(device, 3.1, 4.0)} == {"$GPGGA"}
    assert device.receive(b"?\n", 4.0) == b""


def test_velocity_over_ground_turns_with_the_attitude() -> None:
    east = DvlTruth((1.0, 0.0, 0.0), (0.0, 0.0, 0.5 * math.pi))
    assert over_ground(east) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    nose_up = DvlTruth((1.0, 0.0, 0.0), (0.0, 0.5, 0.0))
    assert over_ground(nose_up) == pytest.approx((math.cos(0.5), 0.0, math.sin(0.5)), abs=1e-12)
    rolled = DvlTruth((0.0, 1.0, 0.0), (0.5, 0.0, 0.0))
    assert over_ground(rolled) == pytest.approx((0.0, math.cos(0.5), -math.sin(0.5)), abs=1e-12)
