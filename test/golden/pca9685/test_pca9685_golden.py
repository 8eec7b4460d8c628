"""PCA9685 against the numbers of its data sheet."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import Operation, Pause, Write, WriteRead
from hindrax_core.testing import rehearse
from hindrax_core.vehicle import Output
from hindrax_drivers.devices.pca9685 import Pca9685

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
BURST = bytes.fromhex(CASES["burst"])


def eight(rate_Hz: float = 50.0, clock_Hz: float = 25e6) -> Pca9685:
    return Pca9685(range(8), [1500.0] * 8, Output(rate_Hz=rate_Hz, clock_Hz=clock_Hz))


@pytest.mark.parametrize("row", CASES["prescale"], ids=lambda row: f"{row['rate_Hz']} Hz of {row['clock_Hz']}")
def test_rate_and_counts(row: dict[str, Any]) -> None:
    chip = eight(row["rate_Hz"], row["clock_Hz"])
    assert chip.rate_Hz == pytest.approx(row["real_Hz"], abs=0.006)
    assert chip.step_us == pytest.approx(row["step_us"], abs=0.0006)
    for pulse, count in zip(CASES["pulses_us"], row["counts"], strict=True):
        (write,) = chip.write([pulse] * 8)
        assert isinstance(write, Write)
        assert write.data[1:] == (b"\x00\x00" + count.to_bytes(2, "little")) * 8
        assert chip.applied([pulse]) == (count * chip.step_us,)


def test_all_channels_are_one_burst_of_33_bytes() -> None:
    assert list(eight().write([1500.0] * 8)) == [Write(0x40, BURST)]


def test_set_up_states_what_the_data_sheet_wants_in_its_order() -> None:
    sleep, prescale, wake = (bytes.fromhex(CASES[key]) for key in ("sleep", "set_prescale", "wake"))
    transcript: list[tuple[Operation, bytes]] = [
        (WriteRead(0x40, b"\x00", 1), b"\x11"),
        (WriteRead(0x40, b"\xfe", 1), b"\x1e"),
        (Write(0x40, sleep), b""),
        (Write(0x40, prescale), b""),
        (Write(0x40, BURST), b""),
        (Write(0x40, wake), b""),
        (Pause(CASES["wake_s"]), b""),
        (Write(0x40, BURST), b""),
        (Write(0x40, wake), b""),
        (Write(0x40, b"\x01\x04"), b""),
        (WriteRead(0x40, b"\x00", 2), b"\x20\x04"),
        (WriteRead(0x40, b"\xfe", 1), prescale[1:]),
        (WriteRead(0x40, b"\x06", 32), BURST[1:]),
    ]
    identity = rehearse(eight().configure(), transcript)
    assert identity.text == "PCA9685 at 0x40: 8 channels, 50.03 Hz, 4.880 us per count"


def test_a_chip_that_runs_as_wanted_gets_neutral_first_and_does_not_sleep() -> None:
    transcript: list[tuple[Operation, bytes]] = [
        (WriteRead(0x40, b"\x00", 1), b"\x21"),
        (WriteRead(0x40, b"\xfe", 1), b"\x79"),
        (Write(0x40, BURST), b""),
        (Write(0x40, b"\x00\x20"), b""),
        (Write(0x40, b"\x01\x04"), b""),
        (WriteRead(0x40, b"\x00", 2), b"\x20\x04"),
        (WriteRead(0x40, b"\xfe", 1), b"\x79"),
        (WriteRead(0x40, b"\x06", 32), BURST[1:]),
    ]
    rehearse(eight().configure(), transcript)
