"""The PCA9685 emulator by its data sheet (NXP rev. 4), register by register."""

import pytest

from hindrax_sim.devices.emulator import NackError
from hindrax_sim.devices.pca9685 import Pca9685

FAR = 10.0


def read(chip: Pca9685, register: int, count: int = 1) -> bytes:
    chip.write(bytes([register]), FAR)
    return chip.read(count, FAR)


def running(clock_error: float = 0.0) -> Pca9685:
    """50 Hz, awake with auto-increment, channel 0 at count 307."""
    chip = Pca9685(clock_error=clock_error)
    for data in ("0030", "fe79", "0020"):
        chip.write(bytes.fromhex(data), 0.0)
    chip.write(bytes.fromhex("0600003301"), 1.0)
    return chip


def test_values_at_power_on() -> None:
    chip = Pca9685()
    assert read(chip, 0x00) == b"\x11"
    assert read(chip, 0x01) == b"\x04"
    assert read(chip, 0x02) == b"\xe2"
    assert read(chip, 0x05) == b"\xe0"
    assert read(chip, 0xFE) == b"\x1e"
    assert read(chip, 0x09) == b"\x10"
    assert chip.pulses_us() == (None,) * 16


def test_pulse_follows_counts_and_oscillator() -> None:
    assert running().pulse_us(0) == pytest.approx(307 * 122 / 25.0)
    assert running(clock_error=0.03).pulse_us(0) == pytest.approx(307 * 122 / 25.75)
    assert running().rate_Hz == pytest.approx(50.03, abs=0.003)


def test_a_high_output_enable_line_puts_all_channels_low_and_loses_no_register() -> None:
    chip = running()
    before = chip.pulses_us()
    chip.enable(FAR, low=False)
    assert chip.pulses_us() == (None,) * 16
    assert chip.changes[-1].now_s == FAR
    chip.write(bytes.fromhex("0600003301"), FAR)
    assert chip.pulses_us() == (None,) * 16, "a write changes nothing at the pins"
    chip.enable(FAR + 1.0, low=True)
    assert chip.pulses_us() == before


def test_without_auto_increment_all_bytes_go_to_one_register() -> None:
    chip = Pca9685()
    chip.write(b"\x06\x01\x02\x03", 0.0)
    assert read(chip, 0x06, 2) == b"\x03\x03"
    assert read(chip, 0x07) == b"\x00"


def test_auto_increment_wraps_from_the_last_channel_to_the_first_register() -> None:
    chip = running()
    chip.write(b"\x44\x07\x00\x21", FAR)
    assert read(chip, 0x00) == b"\x21"


def test_prescaler_only_while_asleep_and_not_below_three() -> None:
    chip = running()
    chip.write(b"\xfe\x10", FAR)
    assert (read(chip, 0xFE), list(chip.violations)) == (b"\x79", ["wrote PRE_SCALE while awake: it is ignored"])
    chip.write(b"\x00\x30", FAR)
    chip.write(b"\xfe\x01", FAR)
    assert read(chip, 0xFE) == b"\x03"


def test_outputs_stay_low_after_sleep_until_restart_or_a_channel_write() -> None:
    chip = running()
    chip.write(b"\x00\x30", FAR)
    assert chip.pulse_us(0) is None
    assert read(chip, 0x00) == b"\xb0"
    chip.write(b"\x00\x20", FAR)
    assert chip.pulse_us(0) is None
    chip.write(b"\x00\xa0", FAR + 0.001)
    assert chip.pulse_us(0) == pytest.approx(1498.2, abs=0.1)
    assert read(chip, 0x00) == b"\x20"


def test_full_on_and_full_off_are_no_pulses() -> None:
    chip = running()
    chip.write(b"\x09\x10", FAR)
    assert chip.pulse_us(0) is None
    chip.write(b"\x06\x00\x10\x33\x01", FAR)
    assert chip.pulse_us(0) is None


def test_a_pulse_may_cross_the_end_of_the_period() -> None:
    chip = running()
    chip.write(b"\x06\x00\x0f\x33\x00", FAR)
    assert chip.pulse_us(0) == pytest.approx(307 * 122 / 25.0)


def test_all_channels_at_once() -> None:
    chip = running()
    chip.write(b"\xfa\x00\x00\x33\x01", FAR)
    assert chip.pulses_us() == pytest.approx((1498.2,) * 16, abs=0.1)
    assert read(chip, 0xFA, 4) == bytes(4)


def test_all_call_until_it_is_switched_off() -> None:
    chip = Pca9685()
    chip.all_call.write(b"\x00\x31", 0.0)
    assert read(chip, 0x00) == b"\x31"
    chip.write(b"\x00\x30", 0.0)
    with pytest.raises(NackError):
        chip.all_call.write(b"\x00\x31", 0.0)
    with pytest.raises(NackError):
        chip.all_call.read(1, 0.0)


def test_software_reset() -> None:
    chip = running()
    with pytest.raises(NackError):
        chip.general_call.write(b"\x07", FAR)
    chip.general_call.write(b"\x06", FAR)
    assert (read(chip, 0x00), chip.pulse_us(0)) == (b"\x11", None)


def test_external_clock_is_taken_only_asleep_and_sticks() -> None:
    chip = Pca9685(external_Hz=24.576e6)
    chip.write(b"\x00\x70", 0.0)
    chip.write(b"\xfe\x1d", 0.0)
    chip.write(b"\x00\x60", 0.0)
    assert chip.rate_Hz == 200.0
    chip.write(b"\x00\x30", 0.0)
    chip.write(b"\x00\x20", 0.0)
    assert read(chip, 0x00) == b"\x60"
    late = running()
    late.write(b"\x00\x60", FAR)
    assert read(late, 0x00) == b"\x20"


def test_changes_are_logged_once_with_their_time() -> None:
    chip = running()
    chip.write(bytes.fromhex("0600003301"), 2.0)
    chip.write(bytes.fromhex("0600003401"), 3.0)
    assert [change.now_s for change in chip.changes] == [0.0, 1.0, 3.0]


def test_what_the_data_sheet_forbids_is_noted() -> None:
    chip = Pca9685()
    chip.write(b"\x00\x20", 0.0)
    chip.write(bytes.fromhex("0600003301"), 0.0004)
    chip.write(bytes.fromhex("0600000000"), 1.0)
    chip.write(b"\x60\x00", 1.0)
    found = " / ".join(chip.violations)
    assert "0.000400 s after waking" in found
    assert "channel 0: ON and OFF are both 0" in found
    assert "reserved register 0x60" in found
