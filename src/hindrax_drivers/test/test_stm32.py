"""The STM32 driver: rhythm, answers, patience, and what it makes of what it hears."""

import math
from collections.abc import Iterable
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.readings import AppliedPulses, Battery, DeviceText
from hindrax_drivers.devices.stm32 import Stm32

CHANNELS = (*range(8), 8, 9)
REST = (1500.0,) * 8 + (1100.0,) * 2
ARM = (1, 1, 400, 0, 1.0, *(0.0,) * 6)
DISARM = (1, 1, 400, 0, 0.0, *(0.0,) * 6)


def at(seconds: float) -> Stamp:
    return stamp_from_s(100.0 + seconds)


BOARD = common.MAVLink(None, srcSystem=1, srcComponent=1)
"""The controller, as others write its messages."""


def messages_of(outputs: Iterable[Output]) -> list[Any]:
    """Messages on the wire, as others decode them."""
    data = b"".join(output.data for output in outputs if isinstance(output, Send))
    return common.MAVLink(None).parse_buffer(data) or []


def commands_of(outputs: Iterable[Output]) -> list[tuple[Any, ...]]:
    """Of every COMMAND_LONG on the wire: whom it is for, the command, confirmation, its seven parameters."""
    commands = [one for one in messages_of(outputs) if one.get_type() == "COMMAND_LONG"]
    return [tuple(getattr(one, name) for name in one.get_fieldnames()) for one in commands]


def heartbeat(*, armed: bool = False) -> Any:
    return BOARD.heartbeat_encode(12, 0, 128 if armed else 0, 0, 4 if armed else 3)


def ack(result: int, system: int = 0, component: int = 0, command: int = 400) -> Any:
    return BOARD.command_ack_encode(command, result, 0, 0, system, component)


def text(severity: int, words: str) -> Any:
    return BOARD.statustext_encode(severity, words.encode())


def servo_output(*pulses_us: int) -> Any:
    return BOARD.servo_output_raw_encode(1, 0, *pulses_us)


def battery(volts: float, current_cA: int) -> Any:
    cells = [round(volts * 1e3)] + [65535] * 9
    return BOARD.battery_status_encode(0, 0, 0, 0x7FFF, cells, current_cA, -1, -1, -1)


def receive(device: Stm32, message: Any, seconds: float) -> list[Output]:
    return list(device.feed(bytes(message.pack(BOARD)), at(seconds)))


def started() -> Stm32:
    device = Stm32(CHANNELS)
    list(device.start(at(0.0)))
    return device


def ready() -> Stm32:
    device = started()
    receive(device, heartbeat(), 0.0)
    return device


def test_heartbeats_go_out_once_a_second() -> None:
    device = Stm32(CHANNELS)
    outputs = list(device.start(at(0.0)))
    for turn in range(1, 61):
        outputs += device.tick(at(turn * 0.05))
    beats = messages_of(outputs)
    assert [one.get_type() for one in beats] == ["HEARTBEAT"] * 4
    for beat in beats:
        assert (beat.type, beat.autopilot, beat.base_mode, beat.system_status) == (18, 8, 0, 4)


def test_identifies_itself_by_its_heartbeat() -> None:
    device = started()
    assert not device.ready
    outputs = receive(device, heartbeat(), 0.1)
    assert outputs == [Identity("MAVLink system 1 component 1, type 12")]
    assert device.ready
    assert receive(device, heartbeat(), 1.1) == []


def test_whoever_sends_other_messages_only_is_received_too() -> None:
    device = ready()
    for turn in range(1, 100):
        receive(device, servo_output(*[1500] * 16), turn * 0.1)
        assert not [one for one in device.tick(at(turn * 0.1)) if isinstance(one, Trouble)]
    assert device.ready


def test_is_not_ready_without_heartbeats_and_reports_it_once() -> None:
    device = ready()
    troubles = [output for turn in range(100) for output in device.tick(at(turn * 0.05)) if isinstance(output, Trouble)]
    assert len(troubles) == 1
    assert "no byte for 2.5 s" in troubles[0].text
    assert not device.ready


def test_channels_follow_the_vehicle_file() -> None:
    device = Stm32((3, 0))
    (message,) = messages_of([device.override((1600.4, 1399.6), at(0.0))])
    assert message.get_type() == "RC_CHANNELS_OVERRIDE"
    assert (message.target_system, message.target_component) == (1, 1)
    pulses_us = tuple(getattr(message, f"chan{number}_raw") for number in range(1, 19))
    # RC_CHANNELS_OVERRIDE: 65535 leaves one of the first eight as it is, 0 one of the others
    assert pulses_us == (1400, 65535, 65535, 1600) + (65535,) * 4 + (0,) * 10


def test_overrides_are_repeated_at_50_hz_but_not_for_long() -> None:
    device = ready()
    device.override(REST, at(0.0))
    spoken = {turn: messages_of(device.tick(at(turn * 0.01))) for turn in range(1, 100)}
    times = [turn for turn, sent in spoken.items() if "RC_CHANNELS_OVERRIDE" in [one.get_type() for one in sent]]
    assert times == [2, 4, 6, 8, 10, 12, 14, 16, 18]


def test_arming_waits_for_the_answer() -> None:
    device = ready()
    assert commands_of([device.arm(at(0.0))]) == [ARM]
    assert not device.armed
    assert receive(device, ack(0), 0.01) == []
    assert (device.armed, device.refusal) == (True, "")
    assert commands_of([device.disarm(at(1.0))]) == [DISARM]
    receive(device, ack(0), 1.01)
    assert not device.armed


def test_frames_are_counted_in_a_byte() -> None:
    """The sequence is byte 4 of a frame of MAVLink 2."""
    device = ready()
    sent = [device.override(REST, at(0.001 * turn)).data[4] for turn in range(300)]
    assert sent == [turn % 256 for turn in range(1, 301)], "the heartbeat of its start was number 0"


def test_before_its_start_it_is_not_there() -> None:
    device = Stm32(CHANNELS)
    assert (device.ready, device.armed, device.asking, device.refusal) == (False, False, False, "")


def test_a_refusal_brings_its_reason() -> None:
    device = ready()
    device.arm(at(0.0))
    receive(device, text(4, "not armed: neutral for 3 of 7000 ms"), 0.01)
    (trouble,) = receive(device, ack(1), 0.01)
    assert trouble == Trouble(at(0.01), "stm32: does not arm: not armed: neutral for 3 of 7000 ms")
    assert (device.armed, device.refusal) == (False, "not armed: neutral for 3 of 7000 ms")
    device.disarm(at(0.1))
    assert receive(device, ack(4), 0.2) == [Trouble(at(0.2), "stm32: does not disarm: answered with result 4")]


def test_a_command_without_answer_is_repeated_then_given_up() -> None:
    device = ready()
    device.arm(at(0.0))
    outputs = [output for turn in range(1, 30) for output in device.tick(at(turn * 0.05))]
    assert commands_of(outputs) == [(*ARM[:3], again, *ARM[4:]) for again in (1, 2)]
    assert [output.text for output in outputs if isinstance(output, Trouble)] == [
        "stm32: no answer to 3 requests; check line and firmware"
    ]
    assert device.refusal == "no answer to 3 requests"


def test_in_progress_is_no_refusal_and_is_waited_for() -> None:
    device = ready()
    device.arm(at(0.0))
    assert receive(device, ack(5), 0.15) == []
    assert device.asking
    assert messages_of(device.tick(at(0.3))) == []
    assert receive(device, ack(0), 0.34) == []
    assert (device.armed, device.refusal) == (True, "")


def test_an_answer_to_another_host_is_not_ours() -> None:
    device = ready()
    device.arm(at(0.0))
    for system, component in ((255, 190), (1, 190), (255, 191)):
        assert receive(device, ack(4, system, component), 0.1) == []
        assert device.asking
    assert receive(device, ack(0, 1, 191), 0.1) == []
    assert device.armed


STRANGERS = [(255, 190), (1, 191), (1, 154), (2, 1)]
"""A ground station, a program on our own computer, a gimbal of this vehicle, another vehicle's autopilot."""


@pytest.mark.parametrize(("system", "component"), STRANGERS)
def test_what_others_say_changes_nothing_and_is_no_reject(system: int, component: int) -> None:
    device = ready()
    receive(device, heartbeat(armed=True), 0.5)
    wire = common.MAVLink(None, srcSystem=system, srcComponent=component)
    frames = (
        wire.heartbeat_encode(6, 8, 0, 0, 4),
        wire.param_request_list_encode(1, 1),
        wire.system_time_encode(1, 2),
        wire.statustext_encode(2, b"critical"),
        wire.command_ack_encode(400, 4),
        wire.servo_output_raw_encode(0, 0, *[1900] * 16),
        wire.rc_channels_override_encode(1, 1, *[1900] * 8),
    )
    assert list(device.feed(b"".join(bytes(one.pack(wire)) for one in frames), at(0.6))) == []
    assert (device.armed, device.identity) == (True, "MAVLink system 1 component 1, type 12")


def test_a_line_on_which_only_others_speak_is_not_the_controller() -> None:
    device, wire = ready(), common.MAVLink(None, srcSystem=255, srcComponent=190)
    troubles = []
    for turn in range(1, 100):
        list(device.feed(bytes(wire.heartbeat_encode(6, 8, 0, 0, 4).pack(wire)), at(turn * 0.1)))
        troubles += [one.text for one in device.tick(at(turn * 0.1)) if isinstance(one, Trouble)]
    assert not device.ready
    assert ["wanted MAVLink 2 of system 1, component 1" in text for text in troubles] == [True]


def test_messages_that_the_controller_has_beyond_ours_are_no_rejects() -> None:
    device, wire = ready(), common.MAVLink(None, srcSystem=1, srcComponent=1)
    assert list(device.feed(bytes(wire.attitude_encode(0, 0.1, 0.2, 0.3, 0, 0, 0).pack(wire)), at(0.1))) == []


def test_an_answer_to_nobody_changes_nothing() -> None:
    device = ready()
    assert receive(device, ack(0), 0.0) == []
    assert receive(device, ack(0, command=176), 0.0) == []
    assert not device.armed


def test_a_controller_that_disarms_by_itself_is_noticed() -> None:
    device = ready()
    receive(device, heartbeat(armed=True), 0.5)
    assert device.armed
    (trouble,) = receive(device, heartbeat(), 1.5)
    assert isinstance(trouble, Trouble)
    assert "has disarmed itself" in trouble.text


def test_what_it_receives_becomes_readings() -> None:
    device = ready()
    (stamped,) = receive(device, servo_output(*range(1500, 1516)), 0.2)
    assert stamped == Stamped(at(0.2), AppliedPulses(tuple(float(pulse) for pulse in range(1500, 1510))))
    for current_A in (3.5, 0.0):
        received = receive(device, battery(14.8, round(current_A * 100)), 0.2)
        assert received == [Stamped(at(0.2), Battery(14.8, current_A))]
    (stamped,) = receive(device, battery(14.8, -1), 0.2)
    assert isinstance(stamped, Stamped)
    assert isinstance(stamped.reading, Battery)
    assert math.isnan(stamped.reading.current_A)
    for severity in (5, 6):  # notice and info; 4 is a warning
        assert receive(device, text(severity, "boot"), 0.2) == [Stamped(at(0.2), DeviceText("boot"))]
    assert receive(device, text(3, "hot"), 0.2) == [Trouble(at(0.2), "stm32: hot")]


def test_damage_is_refused() -> None:
    device = ready()
    damaged = bytearray(servo_output(*[1900] * 8, *[0] * 8).pack(BOARD))
    damaged[20] ^= 1
    (first, *_) = list(device.feed(bytes(damaged) + bytes(64), at(0.1)))
    assert isinstance(first, Rejected)
    assert first.reason == "checksum"


def test_a_reconnection_begins_anew() -> None:
    device = ready()
    receive(device, heartbeat(armed=True), 0.5)
    device.override(REST, at(0.5))
    list(device.start(at(0.6)))
    assert (device.ready, device.armed) == (False, False)
    assert messages_of(device.tick(at(0.61))) == []


@pytest.mark.parametrize("channels", [(), (1, 1), (16,), (-1,)])
def test_channels_that_collide_are_refused(channels: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"output channels: found .*, wanted different ones from 0 to 15$"):
        Stm32(channels)
