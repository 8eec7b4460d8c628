"""The Ping1D as a device: waking, orders, gates, time, supervision."""

import math
import struct
from collections.abc import Callable, Iterable
from dataclasses import astuple
from typing import Any

import pytest

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.readings import DeviceText, Echo, EchoProfile, Reading, SonarHealth
from hindrax_drivers.devices.ping1d import HEALTH, HELLO, Ping1d
from hindrax_drivers.devices.ping1d_settings import DEFAULT_KNOBS, Ping1dKnobs, device_settings
from hindrax_drivers.protocols import ping_protocol as protocol
from hindrax_drivers.protocols.ping_protocol import encode, request

INFORMATION = encode(protocol.DEVICE_INFORMATION, bytes([1, 2, 3, 28, 0, 0]))
START, LENGTH = 100, 4900
HEALTH_PAYLOADS = dict(zip(HEALTH, (b"\x07", *(struct.pack("<H", one) for one in (4987, 3612, 2850))), strict=True))
ASK_HEALTH = b"".join(map(request, HEALTH))


def distance(number: int, mm: int = 2000, percent: int = 100) -> bytes:
    return encode(protocol.DISTANCE, struct.pack("<IHHIIII", mm, percent, 50, number, START, LENGTH, 2))


def profile(number: int, mm: int = 2000, percent: int = 100, strength: bytes = b"\x01\x02\x03") -> bytes:
    head = struct.pack("<IHHIIIIH", mm, percent, 50, number, START, LENGTH, 2, len(strength))
    return encode(protocol.PROFILE, head + strength)


def obedient(sent: bytes) -> bytes:
    """Answers of an obedient device: an ack for a command, the value set for a query."""
    answers, ordered = b"", b""
    while sent:
        length, message = struct.unpack_from("<HH", sent, 2)
        payload, sent = sent[8 : 8 + length], sent[10 + length :]
        wanted = int.from_bytes(payload, "little")
        if message != protocol.GENERAL_REQUEST:
            answers += encode(protocol.ACK, struct.pack("<H", message))
            ordered = payload
        elif wanted == protocol.DEVICE_INFORMATION:
            answers += INFORMATION
        elif wanted in HEALTH:
            answers += encode(wanted, HEALTH_PAYLOADS[wanted])
        elif ordered:
            answers += encode(wanted, ordered)
        if message == protocol.CONTINUOUS_START:
            answers += profile(1)
    return answers


def sends(outputs: Iterable[Output]) -> list[Send]:
    return [one for one in outputs if isinstance(one, Send)]


def troubles(outputs: Iterable[Output]) -> list[str]:
    return [one.text for one in outputs if isinstance(one, Trouble)]


def stamped(outputs: Iterable[Output]) -> list[Stamped[Reading]]:
    """All of them readings."""
    found = list(outputs)
    only = [one for one in found if isinstance(one, Stamped)]
    assert only == found
    return only


def readings(outputs: Iterable[Output]) -> list[Any]:
    return [one.reading for one in outputs if isinstance(one, Stamped)]


def set_up(driver: Ping1d, device: Callable[[bytes], bytes] = obedient) -> list[Output]:
    """Let driver and device talk until neither has anything to say; returns all outputs."""
    stamp = Stamp(0)
    outputs = list(driver.start(stamp))
    waiting = sends(outputs)
    while waiting:
        answers = [driver.feed(device(one.data), stamp) for one in waiting]
        waiting = [send for each in answers for send in sends(each)]
        outputs += [one for each in answers for one in each]
    return outputs


def ready(knobs: Ping1dKnobs = DEFAULT_KNOBS) -> Ping1d:
    driver = Ping1d(knobs)
    set_up(driver)
    assert driver.ready
    return driver


def test_start_wakes_the_device_and_asks_who_it_is() -> None:
    assert Ping1d().start(Stamp(0)) == [Send(HELLO, wake=True)]
    assert request(5) + request(4) == HELLO


def test_orders_are_given_one_by_one_and_proved() -> None:
    driver = Ping1d(Ping1dKnobs(mode_auto=True))
    outputs = set_up(driver)
    names = ("speed of sound", "mode", "ping interval", "ping enable", "continuous start")
    orders = [order.frames for order in device_settings(Ping1dKnobs())]
    assert [one.data for one in sends(outputs)][1:] == [*orders, ASK_HEALTH]
    assert tuple(order.name for order in device_settings(Ping1dKnobs())) == names
    assert troubles(outputs) == []
    assert [one.text for one in outputs if isinstance(one, Identity)]
    assert driver.ready
    assert driver.round_trip_s == 0.0


def test_a_setting_is_followed_by_a_question_for_it_unless_pings_answer_it_or_nothing_does() -> None:
    for continuous, number in ((True, protocol.CONTINUOUS_START), (False, protocol.CONTINUOUS_STOP)):
        *others, last = device_settings(Ping1dKnobs(continuous=continuous))
        assert last.frames == encode(number, struct.pack("<H", protocol.PROFILE))
        assert all(one.frames == encode(one.message, one.payload) + request(one.proof) for one in others)


def test_range_and_gain_are_ordered_by_hand_only() -> None:
    by_hand = Ping1dKnobs(mode_auto=False, range_start_m=40.0, range_length_m=60.0, gain=3)
    frames = b"".join(order.frames for order in device_settings(by_hand))
    assert encode(protocol.SET_RANGE, struct.pack("<II", 40_000, 60_000)) in frames
    assert encode(protocol.SET_GAIN, b"\x03") in frames


def test_the_time_between_pings_is_ordered_in_milliseconds() -> None:
    frames = b"".join(order.frames for order in device_settings(Ping1dKnobs(interval_s=10.0)))
    assert encode(protocol.SET_INTERVAL, struct.pack("<H", 10_000)) in frames


def test_a_silent_device_is_woken_again_and_again() -> None:
    driver = Ping1d()
    driver.start(Stamp(0))
    outputs = [one for index in range(1, 31) for one in driver.tick(stamp_from_s(index * 0.1))]
    assert len(sends(outputs)) == 10
    assert all(one.wake for one in sends(outputs))
    assert ["no byte" in one for one in troubles(outputs)] == [True]
    assert not driver.ready


def test_a_stranger_is_reported_and_never_ordered_about() -> None:
    driver = Ping1d()
    driver.start(Stamp(0))
    outputs = driver.feed(encode(protocol.DEVICE_INFORMATION, bytes([2, 1, 1, 0, 0, 0])), Stamp(0))
    assert "found device type 2, wanted 1" in troubles(outputs)[0]
    assert not sends(outputs)
    assert not readings(driver.feed(distance(1), Stamp(0)))
    assert driver.feed(encode(protocol.DEVICE_INFORMATION, bytes([2, 1, 1, 0, 0, 0])), Stamp(1)) == []
    driver.feed(INFORMATION, Stamp(2))
    driver.start(Stamp(3))
    again = driver.feed(encode(protocol.DEVICE_INFORMATION, bytes([2, 1, 1, 0, 0, 0])), Stamp(4))
    assert "found device type 2, wanted 1" in troubles(again)[0], "the cable was changed again"


def test_the_round_trip_is_from_the_last_question_to_its_answer() -> None:
    driver = Ping1d(Ping1dKnobs(continuous=False, interval_s=0.1))
    assert driver.round_trip_s is None
    driver.start(stamp_from_s(1.0))
    (order,) = sends(driver.feed(INFORMATION, stamp_from_s(1.04)))
    assert driver.round_trip_s == pytest.approx(0.04)
    driver.feed(obedient(order.data), stamp_from_s(1.06))
    assert driver.round_trip_s == pytest.approx(0.02)
    driver = ready(Ping1dKnobs(continuous=False, interval_s=0.1))
    (_,) = sends(driver.tick(stamp_from_s(0.2)))
    driver.feed(distance(1), stamp_from_s(0.23))
    driver.feed(distance(2), stamp_from_s(0.3))
    assert driver.round_trip_s == pytest.approx(0.03), "nobody asked for the second"


def test_an_order_without_answer_is_repeated_then_given_then_left() -> None:
    driver = Ping1d(Ping1dKnobs(tries=3, answer_s=0.3))
    driver.start(Stamp(0))
    first = sends(driver.feed(INFORMATION, Stamp(0)))
    outputs = []
    for index in range(1, 10):
        driver.feed(encode(protocol.TEXT, b""), stamp_from_s(index * 0.1))
        outputs += driver.tick(stamp_from_s(index * 0.1))
    assert sends(outputs)[:2] == first * 2
    assert troubles(outputs) == [
        "Ping: speed of sound after 3 tries: found no answer, wanted 1484000; check the firmware"
    ]


def test_a_device_that_only_acknowledges_is_accepted() -> None:
    driver = Ping1d(Ping1dKnobs(continuous=False, answer_s=0.3))
    driver.start(Stamp(0))
    driver.feed(INFORMATION, Stamp(0))
    outputs = []
    for index in range(1, 40):
        stamp = stamp_from_s(index * 0.1)
        for order in device_settings(Ping1dKnobs(continuous=False)):
            outputs += driver.feed(encode(protocol.ACK, struct.pack("<H", order.message)), stamp)
        outputs += driver.tick(stamp)
        if driver.ready:
            break
    assert troubles(outputs) == []
    assert driver.ready


def test_a_value_other_than_ordered_is_reported() -> None:
    def stubborn(sent: bytes) -> bytes:
        return obedient(sent).replace(encode(1206, b"\x32\x00"), encode(1206, b"\x64\x00"))

    driver = Ping1d(Ping1dKnobs(tries=2, interval_s=0.05))
    outputs = set_up(driver, stubborn)
    for index in range(1, 10):
        for send in sends(sent := driver.tick(stamp_from_s(index * 0.1))):
            sent += driver.feed(stubborn(send.data), stamp_from_s(index * 0.1))
        outputs += sent
    assert "Ping: ping interval after 2 tries: found 100, wanted 50; check the firmware" in troubles(outputs)


def test_a_refusal_is_reported_with_the_device_s_words_and_the_rest_goes_on() -> None:
    def refusing(sent: bytes) -> bytes:
        nack = encode(protocol.NACK, struct.pack("<H", protocol.SET_INTERVAL) + b"too fast\0")
        return nack if sent[4:6] == struct.pack("<H", protocol.SET_INTERVAL) else obedient(sent)

    driver = Ping1d()
    assert troubles(set_up(driver, refusing)) == ["Ping: ping interval refused (too fast)"]
    assert driver.ready
    late = driver.feed(encode(protocol.NACK, struct.pack("<H", 1300)), Stamp(0))
    assert troubles(late) == ["Ping: message 1300 refused (no reason given)"]


@pytest.mark.parametrize("refused", [True, False], ids=["refused", "unanswered"])
def test_a_sonar_without_a_continuous_mode_is_polled(refused: bool) -> None:
    def without(sent: bytes) -> bytes:
        if sent[4:6] != struct.pack("<H", protocol.CONTINUOUS_START):
            return obedient(sent)
        return encode(protocol.NACK, sent[4:6] + b"unsupported") if refused else b""

    driver = Ping1d(Ping1dKnobs(tries=1, answer_s=0.3, interval_s=0.1))
    outputs = set_up(driver, without)
    found: list[Echo] = []
    for index in range(1, 31):
        stamp = stamp_from_s(index * 0.1)
        sent = driver.tick(stamp)
        outputs += sent
        asked = [one.data for one in sends(sent) if one.data == request(protocol.DISTANCE)]
        found += [one for _ in asked for one in readings(driver.feed(distance(index), stamp)) if isinstance(one, Echo)]
    assert driver.ready
    assert len(found) > 20
    (trouble,) = troubles(outputs)
    assert trouble.startswith("Ping: continuous start")


def test_supply_and_temperatures_are_asked_for_now_and_then() -> None:
    driver = Ping1d(Ping1dKnobs(continuous=False))
    (health,) = readings(set_up(driver))
    assert isinstance(health, SonarHealth)
    assert astuple(health) == pytest.approx((7, 4.987, 36.12, 28.5))
    asked = 0
    for index in range(1, 251):
        driver.feed(distance(index), stamp_from_s(index * 0.1))
        asked += sum(one.data == ASK_HEALTH for one in sends(driver.tick(stamp_from_s(index * 0.1))))
    assert asked == 2


def test_a_part_of_the_health_that_a_firmware_does_not_know_is_left_out() -> None:
    driver = ready(Ping1dKnobs(continuous=False))
    nack = encode(protocol.NACK, struct.pack("<H", protocol.BOARD_cC))
    assert troubles(driver.feed(nack, Stamp(0))) == ["Ping: message 1214 refused (no reason given)"]
    driver.feed(distance(1), stamp_from_s(9.9))
    (asked,) = [one for one in sends(driver.tick(stamp_from_s(10.0))) if len(one.data) > 30]
    assert asked.data == b"".join(map(request, HEALTH[:-1]))
    (health,) = readings(driver.feed(obedient(asked.data), stamp_from_s(10.0)))
    assert math.isnan(health.board_C)
    assert health.processor_C == pytest.approx(36.12)


def test_a_supply_that_sags_is_reported_once() -> None:
    driver = ready(Ping1dKnobs(continuous=False))
    low = encode(protocol.SUPPLY_mV, struct.pack("<H", 4200)) + encode(protocol.BOARD_cC, struct.pack("<H", 2500))
    assert troubles(driver.feed(low + low, Stamp(0))) == [
        "Ping: supply 4.20 V, wanted 4.5 to 5.5 V; check cable and regulator"
    ]


def test_a_supply_that_sags_from_the_beginning_is_reported() -> None:
    def sagging(sent: bytes) -> bytes:
        return obedient(sent).replace(encode(protocol.SUPPLY_mV, HEALTH_PAYLOADS[protocol.SUPPLY_mV]), low)

    low = encode(protocol.SUPPLY_mV, struct.pack("<H", 4200))
    assert ["supply 4.20 V" in text for text in troubles(set_up(Ping1d(), sagging))] == [True]


def test_a_corrupt_length_does_not_delay_the_echoes_behind_it() -> None:
    driver = ready(Ping1dKnobs(continuous=False))
    corrupt = struct.pack("<2sHHBB", b"BR", 1000, protocol.PROFILE, 0, 0)
    stamps = []
    for index in range(1, 4):
        arrival = stamp_from_s(float(index))
        stamps += [one.stamp for one in driver.feed(corrupt + distance(index), arrival) if isinstance(one, Stamped)]
    assert [round(one * 1e-9) for one in stamps] == [1, 2, 3]


def test_a_stream_of_profiles_gives_echoes_and_a_profile_when_asked() -> None:
    driver = ready()
    assert [type(one) for one in readings(driver.feed(profile(2), Stamp(0)))] == [Echo]
    assert driver.request_profile() == []
    assert [type(one) for one in readings(driver.feed(profile(3), Stamp(0)))] == [Echo, EchoProfile]
    assert [type(one) for one in readings(driver.feed(profile(4), Stamp(0)))] == [Echo]


def test_polled_it_is_asked_once_per_interval_and_again_when_it_does_not_answer() -> None:
    driver = ready(Ping1dKnobs(continuous=False, interval_s=0.1, answer_s=0.3))
    asked = []
    for index in range(1, 101):
        stamp = stamp_from_s(index * 0.01)
        for send in sends(driver.tick(stamp)):
            asked.append((index, send.data))
            if index < 50:
                driver.feed(distance(index), stamp)
    assert [index for index, _ in asked] == [10, 20, 30, 40, 50, 80]
    assert {data for _, data in asked} == {request(protocol.DISTANCE)}
    assert driver.request_profile() == [Send(request(protocol.PROFILE))]


def test_polled_for_profiles_it_is_asked_for_profiles() -> None:
    driver = ready(Ping1dKnobs(continuous=False, interval_s=0.1, profile=True))
    assert [one.data for one in sends(driver.tick(stamp_from_s(0.1)))] == [request(protocol.PROFILE)]
    assert [type(one) for one in readings(driver.feed(profile(2), stamp_from_s(0.1)))] == [Echo, EchoProfile]


def test_an_echo_is_stamped_with_the_moment_of_the_reflection() -> None:
    driver = ready(Ping1dKnobs(continuous=False, speed_of_sound_mps=1500.0))
    (one,) = stamped(driver.feed(distance(7, mm=2000), stamp_from_s(10.0)))
    on_wire = 34 * 10 / 115200
    rest_of_scan = (2 * 5.0 - 2.0) / 1500.0
    assert abs(one.stamp - stamp_from_s(10.0 - on_wire - rest_of_scan)) <= 1
    assert one.reading == Echo(2.0, 1.0, 7)


def test_an_echo_is_older_by_the_latency_that_was_measured() -> None:
    now, stamps = stamp_from_s(10.0), []
    for latency_s in (0.0, 0.125):
        (echo,) = stamped(ready(Ping1dKnobs(continuous=False, latency_s=latency_s)).feed(distance(7), now))
        stamps.append(echo.stamp)
    assert stamps[0] - stamps[1] == 125_000_000


def test_stamps_never_go_back_when_messages_arrive_at_once() -> None:
    stamps = [
        one.stamp
        for one in stamped(
            ready(Ping1dKnobs(continuous=False)).feed(distance(7, mm=3000) + distance(8, mm=500), Stamp(10**9))
        )
    ]
    assert stamps == sorted(stamps)
    assert len(stamps) == 2


def test_a_host_clock_set_back_is_followed() -> None:
    driver = ready(Ping1dKnobs(continuous=False))
    driver.feed(distance(7), stamp_from_s(1000.0))
    (one,) = stamped(driver.feed(distance(8), stamp_from_s(500.0)))
    assert stamp_from_s(499.9) < one.stamp < stamp_from_s(500.0)


UNSURE = ", wanted 50 %; nothing there, or nearer than it can see?"


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (distance(2, percent=49), f"distance: confidence 49 %{UNSURE}"),
        (distance(2, percent=101), "distance: range"),
        (distance(2, mm=0), "distance: range"),
        (distance(2, mm=5001), "distance: range"),
        (distance(2, mm=0xFFFFFFFF), "distance: range"),
        (encode(protocol.DISTANCE_SIMPLE, struct.pack("<IB", 140_001, 100)), "distance: range"),
        (encode(protocol.DISTANCE_SIMPLE, struct.pack("<IB", 1000, 10)), f"distance: confidence 10 %{UNSURE}"),
        (encode(protocol.PROFILE, struct.pack("<IHHIIIIH", 2000, 100, 50, 2, 0, 5000, 2, 9)), "profile: count"),
        (distance(2)[:-1] + b"\x00", "frame: checksum"),
    ],
)
def test_what_is_not_plausible_is_refused_with_the_reason(frame: bytes, reason: str) -> None:
    outputs = ready(Ping1dKnobs(continuous=False)).feed(frame, Stamp(0))
    assert [one.reason for one in outputs if isinstance(one, Rejected)] == [reason]
    assert not readings(outputs)


def test_a_ping_seen_before_is_no_new_measurement() -> None:
    driver = ready()
    assert len(readings(driver.feed(profile(2) + profile(2), Stamp(0)))) == 1


def test_lost_pings_are_reported_now_and_then() -> None:
    driver = ready()
    outputs = [*driver.feed(profile(2), Stamp(0)), *driver.feed(profile(6), Stamp(0))]
    outputs += driver.feed(profile(9), stamp_from_s(1.0))
    assert troubles(outputs) == ["Ping: 3 pings lost before number 6"]


def test_the_ping_number_may_pass_its_end() -> None:
    driver = ready()
    driver.feed(profile(0xFFFFFFFF), Stamp(0))
    outputs = driver.feed(profile(0), Stamp(0))
    assert len(readings(outputs)) == 1
    assert troubles(outputs) == []


def test_a_restarted_sonar_is_set_up_again() -> None:
    driver = ready()
    driver.feed(profile(500), Stamp(0))
    outputs = driver.feed(profile(3), Stamp(0))
    assert "has restarted (ping 500, then 3)" in troubles(outputs)[0]
    assert sends(outputs) == [Send(HELLO, wake=True)]
    assert readings(outputs) == []
    assert not driver.ready


def test_silence_while_measuring_is_reported_and_answered_by_a_new_start() -> None:
    driver = ready()
    outputs = [one for index in range(1, 15) for one in driver.tick(stamp_from_s(index * 0.1))]
    assert ["no byte" in one for one in troubles(outputs)] == [True]
    assert sends(outputs)[0] == Send(HELLO, wake=True)


def test_a_sonar_that_hangs_is_reported_and_set_up_again() -> None:
    driver = ready()
    outputs = []
    for index in range(1, 15):
        outputs += [*driver.feed(profile(2), stamp_from_s(index * 0.1)), *driver.tick(stamp_from_s(index * 0.1))]
    assert len(readings(outputs)) == 1
    assert troubles(outputs) == ["Ping: no new ping for 1 s although it answers; setting it up again"]
    assert sends(outputs)[0] == Send(HELLO, wake=True)


def test_silence_amid_the_orders_starts_anew_instead_of_telling_each_order() -> None:
    driver = Ping1d(Ping1dKnobs(tries=3))
    driver.start(Stamp(0))
    driver.feed(INFORMATION, Stamp(0))
    outputs = [one for index in range(1, 60) for one in driver.tick(stamp_from_s(index * 0.1))]
    assert sends(outputs)[-1] == Send(HELLO, wake=True)
    assert len(troubles(outputs)) <= 2


def test_text_of_the_device_is_passed_on() -> None:
    outputs = ready().feed(encode(protocol.TEXT, b"hello\0"), Stamp(5))
    assert outputs == [Stamped(Stamp(5), DeviceText("hello"))]


@pytest.mark.parametrize("before", [b"junk" + distance(1)[:5], distance(1)[:-1] + b"\xff", b"BR\0\0\0\0BR"])
def test_a_new_start_forgets_half_a_frame_and_what_was_given_of_a_false_one(before: bytes) -> None:
    driver = Ping1d()
    driver.start(Stamp(0))
    driver.feed(before, Stamp(1))
    driver.start(Stamp(2))
    assert driver.feed(bytes(64) + INFORMATION, Stamp(3))[0] == Rejected(Stamp(3), "frame: garbage", bytes(64))
