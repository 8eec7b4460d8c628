"""The rules of the thruster controller. Plain asserts: CPython runs this through pytest, MicroPython as it is."""

from __future__ import annotations

from hindrax_mcu import mavlink
from hindrax_mcu.controller import Controller
from hindrax_mcu.failsafe import Failsafe

NEUTRAL = [1500] * 8 + [1100] * 2
FULL = [1900] * 10


def armed() -> Failsafe:
    failsafe = Failsafe(8, 2, 0)
    failsafe.override(NEUTRAL, 7000)
    assert failsafe.arm(7000) == ""
    failsafe.override(FULL, 7000)
    return failsafe


def test_boots_disarmed_at_neutral() -> None:
    failsafe = Failsafe(8, 2, 0)
    assert failsafe.step(0) == NEUTRAL
    assert not failsafe.armed
    assert failsafe.reason == "boot"


def test_overrides_move_no_thruster_while_disarmed_but_switch_the_lights() -> None:
    failsafe = Failsafe(8, 2, 0)
    failsafe.override(FULL, 100)
    assert failsafe.step(100) == [1500] * 8 + [1900] * 2


def test_arms_only_after_neutral_and_only_while_the_host_talks() -> None:
    failsafe = Failsafe(8, 2, 0)
    assert failsafe.arm(8000) == "no override from the host"
    failsafe.override(NEUTRAL, 6900)
    assert failsafe.arm(6999) == "neutral for 6999 of 7000 ms"
    assert failsafe.arm(7000) == ""
    assert failsafe.step(7000) == NEUTRAL


def test_does_not_arm_while_an_override_is_away_from_neutral() -> None:
    failsafe = Failsafe(8, 2, 0)
    for pulse in (1100, 1474, 1526, 1700):
        failsafe.override([1500] * 3 + [pulse] + [1500] * 4 + [1900, 1900], 7000)
        assert failsafe.arm(7000) == f"override 4 is {pulse} us"
        assert failsafe.step(7000)[:8] == [1500] * 8
    failsafe.override([1475, 1525] * 4 + [1900, 1900], 7100)
    assert failsafe.arm(7100) == ""


def test_neutral_counts_again_after_a_disarm() -> None:
    failsafe = armed()
    failsafe.disarm("asked", 9000)
    failsafe.override(FULL, 10000)
    assert failsafe.step(10000)[:8] == NEUTRAL[:8]
    assert failsafe.arm(10000) == "neutral for 1000 of 7000 ms"


def test_silence_is_neutral_then_disarmed() -> None:
    failsafe = armed()
    assert failsafe.step(7299) == FULL
    assert failsafe.step(7300)[:8] == NEUTRAL[:8]
    assert failsafe.silent(7300)
    failsafe.override(FULL, 7400)
    assert failsafe.step(7400) == FULL
    assert failsafe.step(9399)[:8] == NEUTRAL[:8]
    assert failsafe.armed
    assert failsafe.step(9400) == NEUTRAL
    assert not failsafe.armed
    assert failsafe.reason == "no override for 2000 ms"


def test_released_and_impossible_channels_are_neutral_and_never_the_last_value() -> None:
    failsafe = armed()
    for value in (0, 65535, 65534, 3, 799, 2201, 40000):
        failsafe.override([value] * 10, 7050)
        assert failsafe.step(7050) == NEUTRAL
        failsafe.override(FULL, 7050)
    failsafe.override([1600], 7100)
    expected = list(NEUTRAL)
    expected[0] = 1600
    assert failsafe.step(7100) == expected


def test_pulses_are_clamped() -> None:
    failsafe = armed()
    failsafe.override([1000, 2000] * 4, 7050)
    assert failsafe.step(7050)[:8] == [1100, 1900] * 4


def test_frames_survive_garbage_and_pieces() -> None:
    head = b"\xfd\xff\x00noise\xfd\xfd\x03"
    wire = head + mavlink.frame(mavlink.COMMAND_LONG, bytes(28) + b"\x90\x01\x01\x01\x00", 5, 1, 191) + b"\xfd"
    for size in (1, 2, 7, 100):
        parser = mavlink.Parser()
        found = []
        for start in range(0, len(wire), size):
            found += parser.feed(wire[start : start + size])
        assert [(system, message) for system, message, _ in found] == [(1, mavlink.COMMAND_LONG)]
        assert found[0][2][28:30] == b"\x90\x01"


def test_a_damaged_frame_is_not_obeyed() -> None:
    good = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, b"\xdc\x05" * 8 + b"\x01\x01" + bytes(20), 0, 1, 191)
    for place in range(len(good)):
        bad = bytearray(good)
        bad[place] ^= 0x10
        assert mavlink.Parser().feed(bytes(bad)) == []
    assert len(mavlink.Parser().feed(good)) == 1


def test_controller_talks_and_obeys() -> None:
    controller = Controller(8, 2, 0)
    assert controller.step(0).count(b"\xfd") >= 3
    override = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, b"\x6c\x07" * 8 + b"\x01\x01" + bytes(20), 0, 1, 191)
    arm = mavlink.frame(mavlink.COMMAND_LONG, b"\x00\x00\x80\x3f" + bytes(24) + b"\x90\x01\x01\x01", 1, 1, 191)
    neutral = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, b"\xdc\x05" * 8 + b"\x01\x01" + bytes(20), 0, 1, 191)
    refused = controller.receive(neutral + arm, 1000)
    assert b"not armed: neutral for 1000 of 7000 ms" in refused
    assert b"not armed: override 1 is 1900 us" in controller.receive(override + arm, 7000)
    accepted = controller.receive(neutral + arm, 7000)
    assert accepted[7:10] == b"\x4d\x00\x00"
    controller.receive(override, 7000)
    controller.step(7000)
    assert controller.pulses == [1900] * 8 + [1100] * 2
    assert b"no override: neutral" in controller.step(7300)
    assert controller.pulses == NEUTRAL


def test_commands_for_others_are_not_obeyed() -> None:
    controller = Controller(8, 2, 0)
    override = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, b"\x6c\x07" * 8 + b"\x02\x01" + bytes(20), 0, 1, 191)
    assert controller.receive(override, 8000) == b""
    assert controller.failsafe.arm(8000) == "no override from the host"
    arm = mavlink.frame(mavlink.COMMAND_LONG, b"\x00\x00\x80\x3f" + bytes(24) + b"\x90\x01\x02\x01", 1, 1, 191)
    assert controller.receive(arm, 8000) == b""


def test_other_systems_are_not_obeyed() -> None:
    controller = Controller(8, 2, 0)
    neutral = b"\xdc\x05" * 8 + b"\x01\x01" + bytes(20)
    arm = b"\x00\x00\x80\x3f" + bytes(24) + b"\x90\x01\x01\x01"
    for system, obeyed in ((255, False), (2, False), (0, False), (1, True)):
        talk = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, neutral, 0, system, 190)
        answer = controller.receive(talk + mavlink.frame(mavlink.COMMAND_LONG, arm, 1, system, 190), 8000)
        assert (bool(answer), controller.failsafe.armed) == (obeyed, obeyed)
    disarm = mavlink.frame(mavlink.COMMAND_LONG, bytes(28) + b"\x90\x01\x01\x01", 2, 255, 190)
    assert controller.receive(disarm, 8100) == b""
    assert controller.failsafe.armed


def test_numbers_that_are_no_number_do_not_arm() -> None:
    controller = Controller(8, 2, 0)
    override = mavlink.frame(mavlink.RC_CHANNELS_OVERRIDE, b"\xdc\x05" * 8 + b"\x01\x01" + bytes(20), 0, 1, 191)
    nan = mavlink.frame(mavlink.COMMAND_LONG, b"\x00\x00\xc0\x7f" + bytes(24) + b"\x90\x01\x01\x01", 1, 1, 191)
    controller.receive(override + nan, 8000)
    assert not controller.failsafe.armed
