"""Our MAVLink against frames that pymavlink made, and against pymavlink itself."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega, common

from hindrax_core.events import Stamp
from hindrax_core.readings import AppliedPulses, Battery
from hindrax_drivers.protocols.mavlink import (
    CommandAck,
    Decoder,
    Heartbeat,
    MavlinkFrame,
    Message,
    Sent,
    StatusText,
    channels_override,
    command_long,
    encode,
    heartbeat,
)
from hindrax_drivers.protocols.mavlink_definitions import LAYOUTS

NOW = Stamp(5)
CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())["frames"]
WIRES = {name: bytes.fromhex(case["wire"].replace("00*24", "00 " * 24)) for name, case in CASES.items()}
SENT: dict[str, Sent] = {
    "heartbeat": heartbeat(18, 8, 4),
    "override_neutral": channels_override((1500,) * 8 + (0,) * 8),
    "override_mixed": channels_override((1100, 1900, 1500, 1500, 1500, 1500, 65535, 65535) + (0,) * 8),
    "arm": command_long(400, [1.0]),
}
READ: dict[str, Message | None] = {
    "heartbeat": Heartbeat(18, armed=False, autopilot=8),
    "override_neutral": None,
    "override_mixed": None,
    "arm": None,
    "ack": CommandAck(400, 0, 0, 0),
    "servo_output": AppliedPulses((1100.0, 1900.0, 1500.0, 1500.0, 1500.0, 1500.0) + (0.0,) * 10),
}
U16 = st.integers(0, 65535)
TARGET = st.permutations([1, 2, 190, 255]).map(lambda ids: (ids[0], ids[1]))
"""System and component, which differ."""


def only(data: bytes) -> Message:
    (frame,) = Decoder().feed(data, NOW)
    assert isinstance(frame, MavlinkFrame)
    assert isinstance(frame.message, Message)
    return frame.message


def sender(component: int = 1) -> Any:
    return common.MAVLink(None, srcSystem=1, srcComponent=component)


@pytest.mark.parametrize("name", SENT)
def test_encodes_to_the_very_bytes(name: str) -> None:
    case = CASES[name]
    assert case["component"] == 191
    assert encode(SENT[name], case["sequence"]) == WIRES[name]


@pytest.mark.parametrize("name", CASES)
def test_decodes_the_very_bytes(name: str) -> None:
    (frame,) = Decoder().feed(WIRES[name], NOW)
    assert isinstance(frame, MavlinkFrame)
    assert (frame.system, frame.component, frame.sequence) == (1, CASES[name]["component"], CASES[name]["sequence"])
    assert frame.message == READ[name]


@given(st.integers(0, 255), st.integers(0, 255))
def test_heartbeat_of_pymavlink(kind: int, base_mode: int) -> None:
    theirs = sender()
    wire = bytes(theirs.heartbeat_encode(kind, 3, base_mode, 7, 4).pack(theirs))
    assert only(wire) == Heartbeat(kind, base_mode >= 128, 3, 7)


@given(st.lists(U16, min_size=16, max_size=16), st.integers(0, 255))
def test_override_as_pymavlink(pulses: list[int], sequence: int) -> None:
    theirs = sender(191)
    theirs.seq = sequence
    wire = bytes(theirs.rc_channels_override_encode(1, 1, *pulses).pack(theirs))
    assert encode(channels_override(pulses), sequence) == wire


@given(st.integers(0, 2**32 - 1), st.lists(U16, min_size=16, max_size=16))
def test_servo_output_as_pymavlink(time_us: int, pulses: list[int]) -> None:
    theirs = sender()
    wire = bytes(theirs.servo_output_raw_encode(time_us, 0, *pulses).pack(theirs))
    assert only(wire) == AppliedPulses(tuple(map(float, pulses)))


@given(U16, st.floats(width=32, allow_nan=False), st.integers(0, 255))
def test_command_as_pymavlink(command: int, parameter: float, confirmation: int) -> None:
    theirs = sender(191)
    wire = bytes(theirs.command_long_encode(1, 1, command, confirmation, parameter, *(0.0,) * 6).pack(theirs))
    assert encode(command_long(command, [parameter], confirmation), 0) == wire


@example([14800], -1)
@example([14800], 0)
@given(st.lists(st.integers(0, 5000), min_size=1, max_size=10), st.integers(-1, 32767))
def test_battery_of_pymavlink(cells: list[int], current: int) -> None:
    theirs = sender()
    padded = cells + [65535] * (10 - len(cells))
    wire = bytes(theirs.battery_status_encode(0, 0, 0, 0x7FFF, padded, current, -1, -1, -1).pack(theirs))
    found = only(wire)
    assert isinstance(found, Battery)
    assert found.voltage_V == sum(cells) / 1e3
    assert math.isnan(found.current_A) if current < 0 else found.current_A == current / 100.0


@given(st.integers(0, 7), st.text(st.characters(min_codepoint=1, max_codepoint=126), max_size=50))
def test_status_text_of_pymavlink(severity: int, text: str) -> None:
    theirs = sender()
    wire = bytes(theirs.statustext_encode(severity, text.encode()).pack(theirs))
    assert only(wire) == StatusText(severity, text)


def test_signed_frames_are_refused() -> None:
    theirs = sender()
    theirs.signing.secret_key, theirs.signing.sign_outgoing = bytes(32), True
    signed = bytes(theirs.heartbeat_encode(12, 0, 0, 0, 3).pack(theirs))
    events = list(Decoder().feed(signed + bytes(64), NOW))
    assert not any(isinstance(event, MavlinkFrame) for event in events)
    assert [getattr(event, "reason", "") for event in events] == ["signed, or of a later version"]


def test_layouts_are_pymavlink_s() -> None:
    theirs = ardupilotmega.mavlink_map
    for number, (extra, longest) in LAYOUTS.items():
        assert (extra, longest) == (theirs[number].crc_extra, theirs[number].unpacker.size), number


@given(TARGET)
def test_the_target_of_an_answer_as_pymavlink(target: tuple[int, int]) -> None:
    theirs = sender()
    wire = bytes(theirs.command_ack_encode(400, 5, 0, 0, *target).pack(theirs))
    assert only(wire) == CommandAck(400, 5, *target)
