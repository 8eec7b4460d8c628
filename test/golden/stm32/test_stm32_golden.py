"""Our MAVLink against frames that pymavlink made, and against pymavlink itself."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega, common

from hindrax_core.events import Stamp
from hindrax_drivers.protocols.mavlink import (
    _LAYOUTS,
    BatteryStatus,
    ChannelsOverride,
    CommandAck,
    CommandLong,
    Decoder,
    Heartbeat,
    MavlinkFrame,
    Message,
    ServoOutput,
    StatusText,
    encode,
)

NOW = Stamp(5)
CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())["frames"]
WIRES = {name: bytes.fromhex(case["wire"].replace("00*24", "00 " * 24)) for name, case in CASES.items()}
SAID: dict[str, Message] = {
    "heartbeat": Heartbeat(type=18, autopilot=8, base_mode=0, system_status=4),
    "override_neutral": ChannelsOverride((1500,) * 8),
    "override_mixed": ChannelsOverride((1100, 1900, 1500, 1500, 1500, 1500)),
    "arm": CommandLong(400, 1.0),
    "ack": CommandAck(400, 0),
    "servo_output": ServoOutput(1_000_000, (1100, 1900, 1500, 1500, 1500, 1500)),
}
U16 = st.integers(0, 65535)
TARGET = st.permutations([1, 2, 190, 255]).map(lambda ids: (ids[0], ids[1]))
"""System and component, which differ."""


def only(data: bytes) -> Message:
    (frame,) = Decoder().feed(data, NOW)
    assert isinstance(frame, MavlinkFrame)
    assert frame.message is not None
    return frame.message


def sender() -> Any:
    return common.MAVLink(None, srcSystem=1, srcComponent=1)


@pytest.mark.parametrize("name", CASES)
def test_encodes_to_the_very_bytes(name: str) -> None:
    case = CASES[name]
    assert encode(SAID[name], case["sequence"], component=case["component"]) == WIRES[name]


@pytest.mark.parametrize("name", CASES)
def test_decodes_the_very_bytes(name: str) -> None:
    (frame,) = Decoder().feed(WIRES[name], NOW)
    assert isinstance(frame, MavlinkFrame)
    assert (frame.system, frame.component, frame.sequence) == (1, CASES[name]["component"], CASES[name]["sequence"])
    assert frame.message is not None
    assert encode(frame.message, frame.sequence, frame.system, frame.component) == WIRES[name]


@given(st.lists(U16, min_size=18, max_size=18), st.integers(0, 255), TARGET)
def test_override_as_pymavlink(pulses: list[int], sequence: int, target: tuple[int, int]) -> None:
    theirs = sender()
    theirs.seq = sequence
    wire = bytes(theirs.rc_channels_override_encode(*target, *pulses).pack(theirs))
    assert encode(ChannelsOverride(tuple(pulses), *target), sequence, component=1) == wire
    assert only(wire) == ChannelsOverride(tuple(pulses), *target)


@given(st.integers(0, 2**32 - 1), st.lists(U16, min_size=16, max_size=16))
def test_servo_output_as_pymavlink(time_us: int, pulses: list[int]) -> None:
    theirs = sender()
    wire = bytes(theirs.servo_output_raw_encode(time_us, 0, *pulses).pack(theirs))
    assert only(wire) == ServoOutput(time_us, tuple(pulses))
    assert encode(ServoOutput(time_us, tuple(pulses)), 0, component=1) == wire


@given(U16, st.floats(width=32, allow_nan=False), st.integers(0, 255), TARGET)
def test_command_as_pymavlink(command: int, parameter: float, confirmation: int, target: tuple[int, int]) -> None:
    theirs = sender()
    wire = bytes(theirs.command_long_encode(*target, command, confirmation, parameter, *(0.0,) * 6).pack(theirs))
    assert only(wire) == CommandLong(command, parameter, confirmation, *target)
    assert encode(CommandLong(command, parameter, confirmation, *target), 0, component=1) == wire


@example([14800], -1)
@example([14800], 0)
@given(st.lists(st.integers(0, 5000), min_size=1, max_size=10), st.integers(-1, 32767))
def test_battery_of_pymavlink(cells: list[int], current: int) -> None:
    theirs = sender()
    padded = cells + [65535] * (10 - len(cells))
    wire = bytes(theirs.battery_status_encode(0, 0, 0, 0x7FFF, padded, current, -1, -1, -1).pack(theirs))
    assert only(wire) == BatteryStatus(sum(cells) / 1e3, None if current < 0 else current / 100.0)


@given(st.integers(0, 7), st.text(st.characters(min_codepoint=1, max_codepoint=126), max_size=50))
def test_status_text_of_pymavlink(severity: int, text: str) -> None:
    theirs = sender()
    wire = bytes(theirs.statustext_encode(severity, text.encode()).pack(theirs))
    assert only(wire) == StatusText(severity, text)
    assert encode(StatusText(severity, text), 0, component=1) == wire
    assert only(encode(StatusText(severity, 50 * "!" + text), 0)) == StatusText(severity, 50 * "!")


def test_our_battery_is_understood_by_pymavlink() -> None:
    theirs, cells = sender(), [14800] + [65535] * 9
    wire = bytes(theirs.battery_status_encode(0, 0, 0, 0x7FFF, cells, 1234, -1, -1, -1).pack(theirs))
    assert encode(BatteryStatus(14.8, 12.34), 0, component=1) == wire
    unknown = bytes(sender().battery_status_encode(0, 0, 0, 0x7FFF, cells, -1, -1, -1, -1).pack(sender()))
    assert encode(BatteryStatus(14.8, None), 0, component=1) == unknown


def test_signed_frames_are_refused() -> None:
    theirs = sender()
    theirs.signing.secret_key, theirs.signing.sign_outgoing = bytes(32), True
    signed = bytes(theirs.heartbeat_encode(12, 0, 0, 0, 3).pack(theirs))
    events = list(Decoder().feed(signed + bytes(64), NOW))
    assert not any(isinstance(event, MavlinkFrame) for event in events)
    assert [getattr(event, "reason", "") for event in events] == ["signed, or of a later version"]


@pytest.mark.parametrize("number", [number for number in _LAYOUTS if number in ardupilotmega.mavlink_map])
def test_layouts_are_pymavlink_s(number: int) -> None:
    theirs = ardupilotmega.mavlink_map[number]
    extra, longest = _LAYOUTS[number]
    assert extra == theirs.crc_extra
    assert longest == theirs.unpacker.size


def test_every_layout_is_one_of_pymavlink() -> None:
    assert not _LAYOUTS.keys() - ardupilotmega.mavlink_map.keys()


def test_the_target_of_an_answer_as_pymavlink() -> None:
    theirs = sender()
    wire = bytes(theirs.command_ack_encode(400, 5, 0, 0, 255, 190).pack(theirs))
    assert only(wire) == CommandAck(400, 5, 255, 190)
    assert encode(CommandAck(400, 5, 255, 190), 0, component=1) == wire
