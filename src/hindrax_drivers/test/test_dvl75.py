"""The DVL-75 as a device: gates, time, supervision, settings. Sentences from outside are in test/golden/dvl75."""

import functools
import math
import operator
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S, Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.knobs import build
from hindrax_core.readings import BottomTrack, BottomVelocity, DeviceText, Echo, KalmanSupport, Position
from hindrax_drivers.devices.dvl75 import ENABLE_DELTAS, Dvl75
from hindrax_drivers.devices.dvl75_settings import DEFAULT_KNOBS, Dvl75Knobs, commands, wanted_settings


def sentence(body: str) -> bytes:
    return b"$%s*%02X\r\n" % (body.encode(), functools.reduce(operator.xor, body.encode()))


def delta(tu: int, dtu: int = 50_000, moved: str = "0.010,0.000,-0.005", confidence: int = 100) -> bytes:
    return sentence(f"DVPDL,{tu},{dtu},0.000000,0.000000,0.000000,{moved},{confidence}")


def started(knobs: Dvl75Knobs | None = None) -> Dvl75:
    driver = Dvl75(knobs or Dvl75Knobs())
    driver.start(Stamp(0))
    return driver


def readings(outputs: list[Output], kind: type = object) -> list[Any]:
    return [one.reading for one in outputs if isinstance(one, Stamped) and isinstance(one.reading, kind)]


def reasons(outputs: list[Output]) -> list[str]:
    return [one.reason for one in outputs if isinstance(one, Rejected)]


def troubles(outputs: Iterable[Output]) -> list[str]:
    return [one.text for one in outputs if isinstance(one, Trouble)]


def test_a_velocity_is_stamped_with_the_middle_of_its_interval() -> None:
    driver = started(Dvl75Knobs(latency_s=0.006))
    (stamped,) = (one for one in driver.feed(delta(10**6, 100_000), stamp_from_s(5.0)) if isinstance(one, Stamped))
    assert stamped.stamp == stamp_from_s(5.0 - 0.006 - 0.05)
    assert isinstance(stamped.reading, BottomVelocity)
    assert stamped.reading.velocity_mps == pytest.approx((0.1, 0.0, -0.05))


def test_stamps_follow_the_device_clock_and_not_the_arrivals() -> None:
    driver = started()
    stamps = []
    for index, late in enumerate((0, 3, 11, 1, 7, 0, 14)):
        arrival = Stamp((index * 50 + late) * 1_000_000 + NS_PER_S)
        stamps += [one.stamp for one in driver.feed(delta(10**6 + index * 50_000), arrival) if isinstance(one, Stamped)]
    assert [stamp - stamps[0] for stamp in stamps] == [index * 50_000_000 for index in range(7)]


@pytest.mark.parametrize(("span_us", "sigma"), [(50_000, 5.7735e-3), (200_000, 1.4434e-3)])
def test_sigma_holds_the_rounding_to_a_millimetre(span_us: int, sigma: float) -> None:
    (bare,) = readings(started(Dvl75Knobs(sigma_floor_mps=0.0)).feed(delta(10**6, span_us), Stamp(0)))
    (real,) = readings(started(Dvl75Knobs(sigma_floor_mps=0.01)).feed(delta(10**6, span_us), Stamp(0)))
    assert bare.sigma_mps == pytest.approx(sigma, rel=1e-3)
    assert real.sigma_mps == pytest.approx(math.hypot(sigma, 0.01), rel=1e-3)


@pytest.mark.parametrize(("confidence", "valid"), [(0, False), (49, False), (50, True), (100, True)])
def test_there_is_no_velocity_below_the_confidence_gate(confidence: int, valid: bool) -> None:
    (found,) = readings(started().feed(delta(10**6, moved="0.000,0.000,0.000", confidence=confidence), Stamp(0)))
    assert (found.velocity_mps is not None) is valid
    assert found.confidence == pytest.approx(confidence / 100)


def test_axis_signs_turn_the_vector() -> None:
    knobs = Dvl75Knobs(axis_sign=(1.0, -1.0, -1.0))
    (found,) = readings(started(knobs).feed(delta(10**6, moved="0.001,0.002,0.003"), Stamp(0)))
    assert found.velocity_mps == pytest.approx((0.02, -0.04, -0.06))


def test_a_sign_that_is_none_is_refused() -> None:
    with pytest.raises(UsageError, match="axis_sign: found"):
        build(Dvl75Knobs, {"axis_sign": [1.0, 0.5, 1.0]}, "dvl75")


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (delta(10**6, moved="9.999,0.000,0.000"), "DVPDL: range"),
        (delta(10**6, moved="0.000,0.000,-0.251"), "DVPDL: range"),
        (delta(10**6, 0), "DVPDL: range"),
        (delta(10**6, 19_999), "DVPDL: range"),
        (delta(10**6, 1_000_001), "DVPDL: range"),
        (delta(2**63), "DVPDL: range"),
        (delta(10**6, confidence=101), "DVPDL: range"),
        (delta(-1), "DVPDL: range"),
        (delta(10**6, moved="nan,0.000,0.000"), "DVPDL: number"),
        (delta(10**6, moved="1e-3,0.000,0.000"), "DVPDL: number"),
        (delta(10**6, moved=",0.000,0.000"), "DVPDL: number"),
        (delta(10**6, moved="0.000,0.000"), "DVPDL: fields"),
        (delta(10**6, moved="0.000,0.000,0.000,0.000"), "DVPDL: fields"),
        (delta(10**6)[:-8] + b"\r\n", "DVPDL: no checksum"),
        (sentence("GPGGA,1,2"), "sentence: unknown"),
        (b"0.001,0.002,100*79\n", "line: cut"),
        (b"12,34,5\n", "line: text"),
        (b"\x00\xfe\x80ab\n", "line: text"),
        (b"\xff" * 5000 + b"\n", "line: length"),
        (b"$" + b"1" * 5000 + b"\n", "sentence: length"),
        (sentence("DVEXT,T,X"), "DVEXT: fields"),
        (sentence("DVKFA,15"), "DVKFA: fields"),
        (b"IMU:1,2,3\r\n", "line: fields"),
    ],
)
def test_what_is_no_data_is_refused_with_the_reason(line: bytes, reason: str) -> None:
    driver = started()
    outputs = driver.feed(line, Stamp(0))
    assert reasons(outputs)[0] == reason
    assert not readings(outputs)
    assert len(readings(driver.feed(delta(10**6), Stamp(0)), BottomVelocity)) == 1


@pytest.mark.parametrize("span_us", [20_000, 1_000_000])
def test_the_shortest_and_the_longest_interval_are_accepted(span_us: int) -> None:
    assert len(readings(started().feed(delta(10**6, span_us), Stamp(0)), BottomVelocity)) == 1


def test_extended_data_may_end_without_an_empty_field() -> None:
    body = extended()[1:-5].decode()
    assert body.endswith(",1.4,")
    assert readings(started().feed(sentence(body.removesuffix(",")), Stamp(0)), BottomTrack)
    assert reasons(started().feed(sentence(body.removesuffix(",1.4,")), Stamp(0))) == ["DVEXT: fields"]


def test_a_sentence_that_lost_its_line_end_is_not_lost() -> None:
    outputs = started().feed(delta(10**6).rstrip() + delta(10**6 + 50_000), Stamp(0))
    assert len(readings(outputs, BottomVelocity)) == 2


def test_a_repeated_sentence_is_no_new_measurement() -> None:
    driver = started()
    driver.feed(delta(10**6), Stamp(0))
    outputs = driver.feed(delta(10**6), Stamp(50_000_000))
    assert reasons(outputs) == ["DVPDL: repeated"]
    assert not readings(outputs)


def test_a_batch_of_sentences_that_comes_again_is_no_new_measurement() -> None:
    driver, batch = started(), delta(10**6) + delta(10**6 + 50_000)
    assert len(readings(list(driver.feed(batch, stamp_from_s(1.0))), BottomVelocity)) == 2
    for second in (2.0, 3.0):
        outputs = list(driver.feed(batch, stamp_from_s(second)))
        assert readings(outputs, BottomVelocity) == []
        assert reasons(outputs) == ["DVPDL: repeated"] * 2


def test_intervals_do_not_overlap() -> None:
    driver = started()
    driver.feed(delta(10**6), Stamp(0))
    assert reasons(driver.feed(delta(10**6 + 50_000, 70_000), Stamp(50_000_000))) == ["DVPDL: overlap"]
    assert len(readings(driver.feed(delta(10**6 + 100_000), Stamp(100_000_000)))) == 1


def test_the_same_extended_data_twice_are_a_device_that_hangs() -> None:
    line = sentence("DVEXT,F,X,3333,1.0,2.0,3.0,-7,0,0,0,0,0,0,0.1,1,0,0,0,25,25,25,25,F,F,F,F,0,0,0,0,-1,-1,-1,-1,")
    outputs = started().feed(line + line, Stamp(0))
    assert len(readings(outputs, BottomTrack)) == 1
    assert reasons(outputs) == ["DVEXT: repeated"]


def test_a_restart_of_the_device_is_reported_and_measuring_goes_on() -> None:
    driver = started()
    driver.feed(delta(10**9), stamp_from_s(1.0))
    outputs = driver.feed(delta(400_000), stamp_from_s(3.0))
    assert len(readings(outputs, BottomVelocity)) == 1
    assert "has restarted" in troubles(outputs)[0]
    (stamped,) = (one for one in outputs if isinstance(one, Stamped))
    assert abs(stamped.stamp - stamp_from_s(3.0)) < 40_000_000
    assert troubles(driver.feed(delta(450_000), stamp_from_s(3.05))) == [], "told once"


def test_no_stamp_is_before_the_last_one_even_across_a_restart_of_the_device() -> None:
    driver = started()
    (first,) = (one for one in driver.feed(delta(10**9), stamp_from_s(1.0)) if isinstance(one, Stamped))
    late = driver.feed(delta(2_000_000, 1_000_000), stamp_from_s(1.1))  # its middle would be at 0.6 s
    (second,) = (one for one in late if isinstance(one, Stamped))
    assert "has restarted" in troubles(late)[0]
    assert second.stamp == first.stamp


def test_stamps_follow_a_host_whose_clock_was_set_back() -> None:
    driver = started()
    driver.feed(delta(10**6), stamp_from_s(100.0))
    outputs = driver.feed(delta(10**6 + 50_000), stamp_from_s(50.0))
    (stamped,) = (one for one in outputs if isinstance(one, Stamped))
    assert stamp_from_s(49.9) < stamped.stamp < stamp_from_s(50.0)
    assert "the host's was set back" in troubles(outputs)[0]


def test_a_line_that_is_opened_again_is_that_of_a_device_that_nobody_knows_yet() -> None:
    driver = started()
    assert [one.text for one in driver.feed(delta(10**9), stamp_from_s(1.0)) if isinstance(one, Identity)]
    assert driver.ready
    driver.feed(delta(10**9 + 50_000)[:20], stamp_from_s(1.05))
    driver.start(stamp_from_s(9.0))
    assert not driver.ready
    assert troubles(driver.tick(stamp_from_s(9.1))) == []
    outputs = driver.feed(delta(10**6), stamp_from_s(10.0))
    assert [one.text for one in outputs if isinstance(one, Identity)] == ["Cerulean DVL-75"]
    assert (troubles(outputs), reasons(outputs), len(readings(outputs, BottomVelocity))) == ([], [], 1)


def test_extended_data_have_the_time_at_which_their_first_byte_was_sent() -> None:
    line, driver = extended(), started(Dvl75Knobs(baud=115_200))
    stamped, _ = (one for one in driver.feed(line, stamp_from_s(5.0)) if isinstance(one, Stamped))
    assert stamped.stamp == pytest.approx(stamp_from_s(5.0 - len(line) * 10 / 115_200), abs=1000)


def test_a_tracker_650_gives_altitude_too_and_its_plain_delta_is_not_counted_twice() -> None:
    driver = started()
    body = "10000,50000,0.000000,0.000000,0.000000,0.001,0.002,0.003,100"
    outputs = driver.feed(sentence(f"DVPDX,{body},2,1.5,-0.5,1.250") + sentence(f"DVPDL,{body}"), Stamp(0))
    assert [type(one) for one in readings(outputs)] == [BottomVelocity, Echo]
    assert reasons(outputs) == []
    assert readings(outputs, Echo) == [Echo(1.25, 1.0)]
    assert [one.text for one in outputs if isinstance(one, Identity)] == ["Cerulean Tracker 650"]
    assert reasons(outputs) == []


def test_a_tracker_650_that_has_lost_the_bottom_gives_no_altitude() -> None:
    body = "10000,50000,0.000000,0.000000,0.000000,0.000,0.000,0.000,20"
    outputs = started().feed(sentence(f"DVPDX,{body},2,1.5,-0.5,1.250"), Stamp(0))
    assert [type(one) for one in readings(outputs)] == [BottomVelocity]


def test_a_tracker_650_that_shows_the_plain_delta_first_gives_altitude_all_the_same() -> None:
    driver = started()
    body = "10000,50000,0.000000,0.000000,0.000000,0.001,0.002,0.003,100"
    stand = sentence(f"DVPDX,{body},2,1.5,-0.5,1.250")
    outputs = driver.feed(sentence(f"DVPDL,{body}") + stand + stand, Stamp(0))
    assert [type(one) for one in readings(outputs)] == [BottomVelocity, Echo]
    velocity, echo = (one for one in outputs if isinstance(one, Stamped))
    assert velocity.stamp == echo.stamp
    assert reasons(outputs) == ["DVPDX: repeated"]


def test_text_with_and_without_a_checksum() -> None:
    outputs = started().feed(b"$DVTXT,Lost lock, searching\n" + sentence("DVTXT,Hello") + b"Booting v1.2\n", Stamp(7))
    assert [one.text for one in readings(outputs, DeviceText)] == ["Lost lock, searching", "Hello", "Booting v1.2"]


def test_what_is_recognized_without_a_reading_is_no_reject() -> None:
    driver = started()
    retweet = b"IMU:1.0,0.0,0.0,0.0,0.01,0.02,0.03,1.0,2.0,3.0,0.05\r\n"
    assert driver.feed(sentence("DVKFC,24577,1,0.1") + retweet, Stamp(0)) == []


def test_a_new_start_forgets_half_a_line() -> None:
    driver = started()
    driver.feed(b"$half", Stamp(0))
    driver.start(Stamp(1))
    assert reasons(driver.feed(delta(10**6), Stamp(2))) == []


def test_no_verified_sentence_is_a_reject() -> None:
    driver, outputs = started(), list[Output]()
    minimum = sentence("GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W")
    kalman = sentence("DVKFA,15,42,0.05,1.5,2")
    for turn in range(2):
        outputs += driver.feed(
            delta(10**6 + turn * 50_000) + kalman + minimum + extended(place=f"44.9,-93.{turn}"), Stamp(turn)
        )
        outputs += driver.feed(sentence("DVTXT,Hello") + sentence("DVNVM,Model=DVL-75,"), Stamp(turn))
    assert reasons(outputs) == []


GPS = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"


def test_what_a_gps_at_the_dvl_states_is_no_reject_and_no_other_device() -> None:
    driver = started()
    minimum = sentence("GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W")
    assert driver.feed(b"GPS:" + GPS + b"GPS:" + minimum, Stamp(0)) == []
    assert reasons(driver.feed(GPS, Stamp(1))) == ["sentence: unknown"], "a GPS on the wrong port"
    assert reasons(driver.feed(b"GPS:" + GPS.replace(b"47\r", b"48\r") + GPS, Stamp(2))) == [
        "sentence: checksum",
        "sentence: unknown",
    ]
    assert readings(driver.feed(b"GPS:" + delta(10**6), Stamp(3)), BottomVelocity)
    assert readings(driver.feed(b"GPS:" + extended(), Stamp(4)), BottomTrack)


def extended(calibration: str = "3333", place: str = "0,0", gains: str = "25,25,25,25") -> bytes:
    beams = "T,T,T,T,0.1,0.2,0.3,0.4,1.1,1.2,-1,1.4"
    head = f"DVEXT,T,A,{calibration},1.0,2.0,3.0,0,0,1.5,0.1,0.2,{place},0.05,1,0,0,0"
    return sentence(f"{head},{gains},{beams},")


@pytest.mark.parametrize("digits", ["", "3", "33333", "3-33", "N/A"])
def test_calibration_digits_that_are_none_cost_no_altitude(digits: str) -> None:
    track, _ = readings(started().feed(extended(digits), Stamp(0)))
    assert (track.altitude_m, track.imu_calibration) == (1.5, digits)


def test_a_field_of_a_beam_that_is_no_number_costs_itself() -> None:
    (track,) = readings(started().feed(extended(gains="25,,25,x"), Stamp(0)), BottomTrack)
    assert [beam.range_m for beam in track.beams] == [1.1, 1.2, None, 1.4]
    assert [math.isnan(beam.gain_dB) for beam in track.beams] == [False, True, False, True]


def test_the_place_is_that_of_the_extended_data_and_else_that_of_the_recommended_minimum() -> None:
    driver = started()
    minimum = sentence("GPRMC,123519,A,4807.038,S,01131.000,W,022.4,084.4,230394,003.1,W")
    (first,) = readings(driver.feed(minimum, Stamp(0)))
    assert (first.latitude_deg, first.longitude_deg) == pytest.approx((-48.1173, -11.516666667))
    assert readings(driver.feed(extended(place="44.9,-93.5"), Stamp(1)), Position) == [Position(44.9, -93.5, True)]
    assert readings(driver.feed(minimum, Stamp(2))) == []
    for place in (",", "91,0", "0,-181", "x,1"):
        assert [type(one) for one in readings(driver.feed(extended(place=place), Stamp(3)))] == [BottomTrack]


def test_a_recommended_minimum_may_end_after_the_place() -> None:
    place = "GPRMC,123519,A,4807.038,N,01131.000,E"
    (found,) = readings(started().feed(sentence(place), Stamp(0)))
    assert (found.latitude_deg, found.longitude_deg) == pytest.approx((48.1173, 11.516666667))
    assert reasons(started().feed(sentence(place.removesuffix(",E")), Stamp(0))) == ["GPRMC: fields"]


def test_numbers_for_a_kalman_filter_come_in_their_order() -> None:
    outputs = started().feed(sentence("DVKFA,15,42,0.05,1.5,[A],-2") + sentence("DVKFA,0x0000000F,43,0.1"), Stamp(0))
    first, second = readings(outputs, KalmanSupport)
    assert (first.version, first.sequence, first.interval_s, first.groups[::2]) == (15, 42, 0.05, (1.5, -2.0))
    assert math.isnan(first.groups[1])
    assert second == KalmanSupport(15, 43, 0.1, ())


def test_no_attitude_is_accepted_beyond_a_turn() -> None:
    zeros = "0,0.0,0.00,0.0,0.0,0.0,0.0,0.05,1,0,0,0,25,25,25,25,F,F,F,F,0,0,0,0,-1,-1,-1,-1,"
    assert readings(started().feed(sentence(f"DVEXT,F,X,3333,1.0,2.0,359.9,{zeros}"), Stamp(0)), BottomTrack)
    assert reasons(started().feed(sentence(f"DVEXT,F,X,3333,181.0,2.0,0.0,{zeros}"), Stamp(0))) == ["DVEXT: range"]
    assert reasons(started().feed(sentence(f"DVEXT,T,X,3333,1.0,2.0,0.0,{zeros}"), Stamp(0))) == ["DVEXT: range"]
    assert reasons(started().feed(sentence(f"DVEXT,Q,X,3333,1.0,2.0,0.0,{zeros}"), Stamp(0))) == ["DVEXT: flag"]


def attitude(roll_deg: float, pitch_deg: float, heading_deg: float) -> bytes:
    zeros = "0,0.0,0.00,0.0,0.0,0.0,0.0,0.05,1,0,0,0,25,25,25,25,F,F,F,F,0,0,0,0,-1,-1,-1,-1,"
    return sentence(f"DVEXT,F,X,3333,{roll_deg},{pitch_deg},{heading_deg},{zeros}")


@pytest.mark.parametrize("angles", [(180.5, 0, 0), (0, -180.5, 0), (0, 0, 360.5), (0, 0, -0.5)])
def test_every_angle_has_its_limit(angles: tuple[float, float, float]) -> None:
    assert reasons(started().feed(attitude(*angles), Stamp(0))) == ["DVEXT: range"]


@pytest.mark.parametrize("angles", [(180, -180, 360), (-180, 180, 0)])
def test_angles_at_their_limits_are_accepted(angles: tuple[float, float, float]) -> None:
    assert len(readings(started().feed(attitude(*angles), Stamp(0)), BottomTrack)) == 1


@pytest.mark.parametrize(
    ("signs", "wanted_deg"),
    [
        ((1.0, 1.0, 1.0), (10, 20, 30)),
        ((-1.0, 1.0, 1.0), (-10, 20, 30)),
        ((1.0, -1.0, 1.0), (10, -20, 30)),
        ((1.0, 1.0, -1.0), (10, 20, 330)),
    ],
)
def test_each_angle_has_the_sign_that_the_vehicle_gives_it(
    signs: tuple[float, float, float], wanted_deg: tuple[float, float, float]
) -> None:
    (track,) = readings(started(Dvl75Knobs(attitude_sign=signs)).feed(attitude(10, 20, 30), Stamp(0)), BottomTrack)
    found = (track.roll_rad, track.pitch_rad, track.heading_rad)
    assert [math.degrees(angle) for angle in found] == pytest.approx(wanted_deg)


def run(
    driver: Dvl75, seconds: float, line: Callable[[int], bytes] | None = None, start_s: float = 0.0
) -> list[Output]:
    """Tick at 10 Hz; `line(index)` gives the bytes before each tick."""
    outputs: list[Output] = []
    for index in range(round(seconds * 10)):
        stamp = stamp_from_s(start_s + index * 0.1)
        outputs += driver.feed(line(index), stamp) if line else []
        outputs += driver.tick(stamp)
    return outputs


def test_silence_is_reported_once_per_episode() -> None:
    driver = started()
    outputs = run(driver, 10.0)
    assert ["no byte for 1 s" in one for one in troubles(outputs)] == [True, False]
    assert [one.data for one in outputs if isinstance(one, Send)] == [ENABLE_DELTAS] * 3
    assert not driver.ready
    assert troubles(run(driver, 10.0, lambda i: delta(10**6 + i * 100_000), 10.0)) == []
    assert driver.ready
    assert "no byte for 1 s" in troubles(run(driver, 5.0, None, 20.0))[0]
    assert not driver.ready


def test_foreign_talk_is_reported_and_nothing_is_sent_to_the_stranger() -> None:
    driver = started()
    outputs = run(driver, 20.0, lambda _: b"\x80\x13\x00\xff\n")
    assert ["check line speed and device" in one for one in troubles(outputs)] == [True]
    assert not [one for one in outputs if isinstance(one, Send)]
    assert not driver.ready


def test_a_device_that_only_passes_a_gps_on_is_no_stranger() -> None:
    assert troubles(run(started(), 20.0, lambda _: b"GPS:" + GPS)) == []


def test_deltas_are_asked_for_a_few_times_and_then_given_up() -> None:
    driver = started(Dvl75Knobs(enable_tries=3))
    outputs = run(driver, 30.0, lambda _: sentence("DVKFA,15,1,0.05"))
    assert [one.data for one in outputs if isinstance(one, Send)] == [ENABLE_DELTAS] * 3
    assert ["no $DVPDL after 3 requests" in one for one in troubles(outputs)] == [True]
    assert not driver.ready
    run(driver, 1.0, lambda i: delta(10**6 + i * 100_000), 30.0)
    assert driver.ready


def test_deltas_are_asked_for_again_after_the_same_time() -> None:
    driver = started(Dvl75Knobs(enable_tries=3, enable_after_s=1.0))
    asked_s = [turn / 8 for turn in range(60) if any(isinstance(one, Send) for one in outputs_at(driver, turn / 8))]
    assert asked_s == [1.0, 2.0, 3.0]


def outputs_at(driver: Dvl75, time_s: float) -> list[Output]:
    driver.feed(sentence("DVKFA,15,1,0.05"), stamp_from_s(time_s))
    return driver.tick(stamp_from_s(time_s))


def test_the_clock_of_a_device_may_begin_at_zero() -> None:
    driver = started()
    assert not driver.ready
    assert len(readings(driver.feed(delta(0), Stamp(0)), BottomVelocity)) == 1
    assert driver.ready


def test_deltas_that_come_are_not_asked_for() -> None:
    outputs = run(started(), 30.0, lambda i: delta(10**6 + i * 100_000))
    assert not [one for one in outputs if isinstance(one, Send)]


def test_start_asks_for_the_configuration_and_sets_nothing() -> None:
    assert Dvl75().start(Stamp(0)) == [Send(b"\nCONFIGURATION\n")]


CURRENT = {"DVPDL messages": "OFF", "DVEXT messages": "on", "Speed of sound": "1484", "Velocity adjustment": "1.000"}


def orders(current: dict[str, str], always: bool = False, knobs: Dvl75Knobs = DEFAULT_KNOBS) -> tuple[bytes, ...]:
    return commands(current, wanted_settings(knobs), always)


def test_only_settings_that_differ_are_sent() -> None:
    assert orders(CURRENT) == (b"SEND-DVPDL ON\n",)
    assert orders(CURRENT, knobs=Dvl75Knobs(speed_of_sound_mps=1500.0))[1:] == (b"SET-SPEED-OF-SOUND 1500.0\n",)
    assert orders({**CURRENT, "DVPDL messages": "ON"}) == ()


@pytest.mark.parametrize(("found", "sent"), [("1.0004", False), ("0.9996", False), ("1.001", True), ("0.5", True)])
def test_a_number_is_the_same_where_its_last_digit_is(found: str, sent: bool) -> None:
    current = {**CURRENT, "DVPDL messages": "ON", "Velocity adjustment": found}
    assert orders(current) == ((b"SET-VELOCITY-ADJUSTMENT 1.000\n",) if sent else ())


def test_all_settings_are_sent_on_request_and_to_a_device_that_did_not_report() -> None:
    wanted = (
        b"SEND-DVPDL ON\n",
        b"SEND-DVEXT ON\n",
        b"SET-SPEED-OF-SOUND 1484.0\n",
        b"SET-VELOCITY-ADJUSTMENT 1.000\n",
    )
    assert orders(CURRENT, always=True) == wanted
    assert orders({}) == wanted


def test_a_tracker_650_is_asked_for_the_sentence_that_has_its_altitude() -> None:
    """It knows no SEND-DVEXT. Page "Commands Accepted by the Tracker 650"."""
    wanted = wanted_settings(Dvl75Knobs(), "Tracker 650")
    assert commands({**CURRENT, "Model": "Tracker 650", "DVPDX messages": "OFF"}, wanted) == (
        b"SEND-DVPDL ON\n",
        b"SEND-DVPDX ON\n",
    )


def test_an_orientation_is_the_same_with_semicolons() -> None:
    """OmniTrack turns the semicolons of $DVNVM into the commas of the command, and so do we."""
    key = "Sensor Orientation"
    assert commands({key: "0.0;0.0;90.0"}, {key: "0,0,90"}) == ()
    assert commands({key: "0.0;0.0;90.0"}, {key: "0,0,0"}) == (b"SET-SENSOR-ORIENTATION 0,0,0\n",)


@pytest.mark.parametrize(
    ("model", "on", "off"),
    [
        ("DVL-75", b"MANUAL-MODE 0.001,10.0,0.5,56,0.1,50,20.6,-0.671,100,100\n", b"MANUAL-MODE OFF\n"),
        ("Tracker 650", b"SET-POOL-MODE ON\n", b"SET-POOL-MODE OFF\n"),
    ],
)
def test_each_model_has_its_own_word_for_the_pool(model: str, on: bytes, off: bytes) -> None:
    """BlueOS-Cerulean-DVL, POOL_MODE_COMMAND; Tracker 650, "Commands Accepted", SET-POOL-MODE."""
    assert commands({"Model": model}, {"Pool Mode": "ON"}) == (on,)
    assert commands({"Model": model}, {"Pool Mode": "OFF"}) == (off,)


def test_a_device_that_reckons_with_another_speed_of_sound_is_reported_with_the_remedy() -> None:
    driver = started(Dvl75Knobs(speed_of_sound_mps=1500.0))
    outputs = driver.feed(sentence("DVNVM,Model=DVL-75,Speed of sound=1484.0,Firmware=Jan 1 2022,"), Stamp(0))
    assert troubles(outputs) == ["DVL speed of sound: found 1484.0, wanted 1500.0; run ./hindrax dvl setup"]
    assert outputs[0] == Identity("Cerulean DVL-75, firmware Jan 1 2022")
