"""The firmware's frames against pymavlink, which is written by others."""

import pytest
from hindrax_mcu import mavlink
from hindrax_mcu.controller import Controller
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

PULSE = st.integers(0, 65535)


def decoded(data: bytes) -> list[common.MAVLink_message]:
    return common.MAVLink(None).parse_buffer(data) or []


def host() -> common.MAVLink:
    return common.MAVLink(None, srcSystem=1, srcComponent=191)


def test_what_the_controller_states_is_mavlink() -> None:
    controller = Controller(8, 2, 0)
    controller.millivolts = 14800
    messages = {message.get_type(): message for message in decoded(controller.step(0))}
    assert set(messages) == {"HEARTBEAT", "SERVO_OUTPUT_RAW", "BATTERY_STATUS", "STATUSTEXT"}
    assert messages["HEARTBEAT"].base_mode == 0
    assert messages["HEARTBEAT"].system_status == common.MAV_STATE_STANDBY
    assert messages["SERVO_OUTPUT_RAW"].servo8_raw == 1500
    assert messages["SERVO_OUTPUT_RAW"].servo9_raw == 1100
    assert messages["BATTERY_STATUS"].voltages == [14800] + [65535] * 9
    assert messages["BATTERY_STATUS"].current_battery == -1
    assert messages["STATUSTEXT"].text == "boot"


def test_what_a_host_states_is_understood() -> None:
    controller, sender = Controller(8, 2, 0), host()
    pulses = [1100, 1900, 1500, 1600, 1700, 1800, 1400, 1300, 1750, 1250]
    neutral = sender.rc_channels_override_encode(1, 1, *[1500] * 8).pack(sender)
    override = sender.rc_channels_override_encode(1, 1, *pulses).pack(sender)
    arm = sender.command_long_encode(1, 1, 400, 0, 1.0, 0, 0, 0, 0, 0, 0).pack(sender)
    answers = decoded(controller.receive(neutral + arm + override, 7000))
    assert [(one.get_type(), one.command, one.result) for one in answers] == [("COMMAND_ACK", 400, 0)]
    (heartbeat, *_) = [one for one in decoded(controller.step(7000)) if one.get_type() == "HEARTBEAT"]
    assert heartbeat.base_mode & common.MAV_MODE_FLAG_SAFETY_ARMED
    assert controller.pulses == pulses


def test_a_command_it_does_not_know_is_answered() -> None:
    sender = host()
    reboot = sender.command_long_encode(1, 1, 246, 0, 1.0, 0, 0, 0, 0, 0, 0).pack(sender)
    (answer,) = decoded(Controller(8, 2, 0).receive(reboot, 0))
    assert (answer.command, answer.result) == (246, common.MAV_RESULT_UNSUPPORTED)


@given(st.integers(0, 2**32 - 1), st.lists(PULSE, min_size=1, max_size=16))
def test_servo_output(now_us: int, pulses: list[int]) -> None:
    (message,) = decoded(mavlink.frame(36, mavlink.servo_output(now_us, pulses), 7, 1, 1))
    assert message.time_usec == now_us
    assert [getattr(message, f"servo{index + 1}_raw") for index in range(len(pulses))] == pulses


@given(st.lists(PULSE, min_size=18, max_size=18), st.integers(0, 255))
def test_override_arrives_channel_by_channel(channels: list[int], sequence: int) -> None:
    sender = host()
    sender.seq = sequence
    data = sender.rc_channels_override_encode(1, 1, *channels).pack(sender)
    ((system, message, payload),) = mavlink.Parser().feed(data)
    assert (system, message) == (1, 70)
    found = [int.from_bytes(payload[at : at + 2], "little") for at in (*range(0, 16, 2), *range(18, 38, 2))]
    assert found == channels


@given(st.binary(max_size=300), st.binary(max_size=300).filter(lambda tail: b"\xfd" not in tail), st.integers(1, 50))
def test_garbage_never_raises_and_hides_no_frame(before: bytes, after: bytes, size: int) -> None:
    sender = host()
    arm = sender.command_long_encode(1, 1, 400, 0, 1.0, 0, 0, 0, 0, 0, 0).pack(sender)
    # What follows ends the wait of a false start in the garbage, as the next frames of a living line do.
    data = before + arm + after + bytes(64)
    parser, found = mavlink.Parser(), []
    for start in range(0, len(data), size):
        found += parser.feed(data[start : start + size])
    assert [message for _, message, _ in found] == [76]


@pytest.mark.parametrize("text", ["", "neutral", "x" * 80])
def test_status_text(text: str) -> None:
    (message,) = decoded(mavlink.frame(253, mavlink.status_text(4, text), 0, 1, 1))
    assert (message.severity, message.text) == (4, text[:50])
