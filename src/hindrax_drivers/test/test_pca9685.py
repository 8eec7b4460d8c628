"""PCA9685 driver: what it refuses, and that it says what it achieved."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.bus_operations import DeviceError, Operation, Write, WriteRead
from hindrax_core.testing import rehearse
from hindrax_core.vehicle import Output, load_vehicle
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of

VEHICLE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"
CLOCKS = st.floats(23e6, 27e6)
RATES = st.floats(40.0, 400.0)
PULSES = st.lists(st.floats(1100.0, 1900.0), min_size=3, max_size=3)


def chip(channels: Sequence[int] = (0, 1, 2), *, rate_Hz: float = 200.0, clock_Hz: float = 25e6) -> Pca9685:
    return Pca9685(channels, [1500.0] * len(channels), Output(rate_Hz=rate_Hz, clock_Hz=clock_Hz))


@given(CLOCKS, RATES, PULSES)
def test_applied_is_what_the_written_counts_make(clock_Hz: float, rate_Hz: float, pulses: list[float]) -> None:
    made = chip(clock_Hz=clock_Hz, rate_Hz=rate_Hz)
    (write,) = made.write(pulses)
    assert isinstance(write, Write)
    counts = [int.from_bytes(write.data[at + 2 : at + 4], "little") for at in (1, 5, 9)]
    assert made.applied(pulses) == pytest.approx([count * made.step_us for count in counts])
    assert made.applied(pulses) == pytest.approx(pulses, abs=made.step_us / 2 + 1e-9)


@given(CLOCKS, RATES)
def test_no_rate_is_faster_than_a_speed_controller_follows(clock_Hz: float, rate_Hz: float) -> None:
    assert chip(clock_Hz=clock_Hz, rate_Hz=rate_Hz).rate_Hz <= 400.0


@pytest.mark.parametrize("rate_Hz", [400.5, 23.5, float("nan")])
def test_rates_out_of_range_are_refused(rate_Hz: float) -> None:
    for allowed_Hz in (24.0, 400.0):
        chip(rate_Hz=allowed_Hz)
    with pytest.raises(ValueError, match=r"output\.rate_Hz"):
        chip(rate_Hz=rate_Hz)


@pytest.mark.parametrize("channels", [(), (0, 0, 1), (16,), (-1,)])
def test_channels_that_collide_are_refused(channels: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="output channels"):
        chip(channels)


@pytest.mark.parametrize("pulse", [0.0, -1.0, 1e9])
def test_a_pulse_that_cannot_be_made_is_refused(pulse: float) -> None:
    with pytest.raises(ValueError, match=r"wanted more than 0 and less than 5079\.04 us"):  # 4096 counts of 31 / 25 MHz
        list(chip().write([pulse, 1500.0, 1500.0]))


@pytest.mark.parametrize("counts", [1, 4095])
def test_the_shortest_and_the_longest_pulse_of_the_chip_can_be_made(counts: int) -> None:
    made = chip()
    assert made.applied([counts * made.step_us]) == pytest.approx((counts * 31.0 / 25.0,))


def test_every_channel_wants_a_pulse() -> None:
    with pytest.raises(ValueError, match="shorter"):
        list(chip().write([1500.0, 1500.0]))


def test_channels_out_of_order_and_with_gaps_are_still_one_burst() -> None:
    (write,) = chip((5, 2), rate_Hz=50.0).write([1900.0, 1100.0])
    assert isinstance(write, Write)
    off = "00000010"
    assert write.data == bytes.fromhex("0e" + "0000e100" + off + off + "00008501")
    transcript = [
        (WriteRead(0x40, b"\x00", 2), b"\x20\x04"),
        (WriteRead(0x40, b"\xfe", 1), b"\x79"),
        (WriteRead(0x40, b"\x0e", 16), write.data[1:]),
    ]
    rehearse(chip((5, 2), rate_Hz=50.0).check([1900.0, 1100.0]), transcript)


def test_the_vehicle_file_gives_thrusters_then_lights() -> None:
    (neutral,) = pca9685_of(load_vehicle(VEHICLE), [1500.0] * 8 + [1100.0] * 2).neutral()
    assert isinstance(neutral, Write)
    assert len(neutral.data) == 41
    assert neutral.data[1:] == b"\x00\x00\xba\x04" * 8 + b"\x00\x00\x77\x03" * 2


def test_an_external_clock_is_chosen_while_asleep() -> None:
    made = Pca9685([0], [1500.0], Output(clock_Hz=24.576e6, external_clock=True))
    burst = b"\x06\x00\x00\xcd\x04"
    transcript: list[tuple[Operation, bytes | DeviceError]] = [
        (WriteRead(0x40, b"\x00", 1), b"\x11"),
        (WriteRead(0x40, b"\xfe", 1), b"\x1e"),
        (Write(0x40, b"\x00\x30"), b""),
        (Write(0x40, b"\x00\x70"), b""),
        (Write(0x40, b"\xfe\x1d"), b""),
        (Write(0x40, burst), b""),
        (Write(0x40, b"\x00\x60"), DeviceError("stop here")),
    ]
    with pytest.raises(DeviceError, match="stop here"):
        rehearse(made.configure(), transcript)


def test_a_chip_that_lost_its_settings_is_found_out() -> None:
    transcript = [(WriteRead(0x40, b"\x00", 2), b"\x11\x04"), (WriteRead(0x40, b"\xfe", 1), b"\x1e")]
    with pytest.raises(DeviceError, match="PRE_SCALE are 11 04 1e, wanted 20 04 1e: another device, or its supply"):
        rehearse(chip().check([1500.0] * 3), transcript)
