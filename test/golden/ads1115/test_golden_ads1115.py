"""ADS1115 against the numbers of its data sheet, behind a power sense module."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Battery
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.ads1115 import Ads1115, Ads1115Knobs

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
LOW = (WriteRead(0x48, b"\x02", 2), bytes.fromhex(CASES["low_threshold"]))
HIGH = (WriteRead(0x48, b"\x03", 2), bytes.fromhex(CASES["high_threshold"]))


def conversion(settings: str, value: str, again: str) -> list[tuple[Operation, bytes]]:
    return [
        (Write(0x48, b"\x01" + bytes.fromhex(settings)), b""),
        (Pause(0.009), b""),
        (WriteRead(0x48, b"\x01", 2), bytes.fromhex(settings)),
        (WriteRead(0x48, b"\x00", 2), bytes.fromhex(value)),
        (WriteRead(0x48, b"\x00", 2), bytes.fromhex(again)),
    ]


def look(voltage: str, current: str) -> list[tuple[Operation, bytes]]:
    """Table 8: single shots (OS, MODE) of AIN3 and AIN2 against ground, 4.096 V, 128 a second, no comparator."""
    return [*conversion("f383", voltage, voltage), *conversion("e383", current, current)]


@pytest.mark.parametrize("row", CASES["samples"], ids=lambda row: row["what"])
def test_a_sample(row: dict[str, Any]) -> None:
    (stamped,) = rehearse(Ads1115(Ads1115Knobs()).cycle(Stamp(0)), look(row["voltage"], row["current"]))
    assert isinstance(stamped, Stamped)
    assert isinstance(stamped.reading, Battery)
    assert stamped.reading.voltage_V == pytest.approx(row["voltage_V"])
    assert stamped.reading.current_A == pytest.approx(row["current_A"], abs=1e-9)


@pytest.mark.parametrize(
    ("voltage", "current", "reason"),
    [
        (("7fff", "7fff"), ("0a50", "0a50"), "end of the scale"),
        (("2a0c", "2a0c"), ("7fff", "7fff"), "end of the scale"),
        (("2a0c", "2a0d"), ("0a50", "0a50"), "two reads differ"),
        (("2a0c", "2a0c"), ("0a50", "0a51"), "two reads differ"),
    ],
)
def test_what_is_no_measurement_is_rejected(voltage: tuple[str, str], current: tuple[str, str], reason: str) -> None:
    talk = [*conversion("f383", *voltage), *conversion("e383", *current)]
    (rejected,) = rehearse(Ads1115(Ads1115Knobs()).cycle(Stamp(0)), talk)
    assert rejected == Rejected(Stamp(9_000_000), reason, bytes.fromhex("".join((*voltage, *current))))


def test_the_identity_and_another_part() -> None:
    identity = rehearse(Ads1115(Ads1115Knobs()).configure(), [LOW, HIGH])
    assert identity.text == "ADS1115 at 0x48, voltage at AIN3, current at AIN2"
    with pytest.raises(DeviceError, match="found thresholds 0x8000 0x0000, wanted 0x8000 0x7fff"):
        rehearse(Ads1115(Ads1115Knobs()).configure(), [LOW, (HIGH[0], b"\0\0")])
