"""INA226 against the numbers of its data sheet."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Battery
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.ina226 import Ina226, Ina226Knobs

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
MAKER = (WriteRead(0x41, b"\xfe", 2), bytes.fromhex(CASES["manufacturer"]))
DIE = (WriteRead(0x41, b"\xff", 2), bytes.fromhex(CASES["die"]))


def look(
    shunt: str, bus: str, again: str = "", mask: str = "0008", settings: str = "4523"
) -> list[tuple[Operation, bytes]]:
    """One triggered conversion: 16 averages of 1.1 ms, shunt and bus (tables 6 to 9: 4523h), read twice."""
    registers = [(WriteRead(0x41, b"\x01", 2), bytes.fromhex(shunt)), (WriteRead(0x41, b"\x02", 2), bytes.fromhex(bus))]
    return [
        (Write(0x41, b"\x00\x45\x23"), b""),
        (Pause(0.0393, 0.1 - 0.0393), b""),
        (WriteRead(0x41, b"\x06", 2), bytes.fromhex(mask)),
        (WriteRead(0x41, b"\x00", 2), bytes.fromhex(settings)),
        *registers,
        (registers[0][0], bytes.fromhex(again or shunt)),
        registers[1],
    ]


def battery(sensor: Ina226, transcript: list[tuple[Operation, bytes]]) -> Battery:
    (stamped,) = rehearse(sensor.cycle(Stamp(0)), transcript)
    assert isinstance(stamped, Stamped)
    assert stamped.stamp == 19_650_000, "the middle of the conversion"
    assert isinstance(stamped.reading, Battery)
    return stamped.reading


@pytest.mark.parametrize("row", CASES["samples"], ids=lambda row: row["what"])
def test_a_sample(row: dict[str, Any]) -> None:
    sensor = Ina226(Ina226Knobs(shunt_ohm=row["shunt_ohm"]))
    found = battery(sensor, look(row["shunt"], row["bus"]))
    assert found.voltage_V == pytest.approx(row["voltage_V"])
    assert found.current_A == pytest.approx(row["current_A"])


def test_a_shunt_that_is_wired_the_other_way_round() -> None:
    sensor = Ina226(Ina226Knobs(shunt_ohm=0.002, reversed=True))
    assert battery(sensor, look("1f40", "2570")).current_A == pytest.approx(-10.0)


@pytest.mark.parametrize(
    ("shunt", "bus", "again", "reason"),
    [
        ("7fff", "2570", "", "end of the scale"),
        ("8001", "2570", "", "end of the scale"),
        ("1f40", "7fff", "", "end of the scale"),
        ("1f40", "ffff", "", "end of the scale"),
        ("1f40", "2570", "1f41", "two reads differ"),
    ],
)
def test_what_is_no_measurement_is_rejected(shunt: str, bus: str, again: str, reason: str) -> None:
    (rejected,) = rehearse(Ina226(Ina226Knobs()).cycle(Stamp(0)), look(shunt, bus, again))
    raw = shunt + bus + (again + bus if again else "")
    assert rejected == Rejected(Stamp(19_650_000), reason, bytes.fromhex(raw))


@pytest.mark.parametrize(("shunt", "bus"), [("7ffe", "7ffe"), ("8002", "0000")])
def test_what_is_just_within_the_scale_is_accepted(shunt: str, bus: str) -> None:
    battery(Ina226(Ina226Knobs()), look(shunt, bus))


@pytest.mark.parametrize(
    ("mask", "settings", "why"),
    [("fff7", "4523", "no conversion in 0.0393 s"), ("0008", "4127", "lost its settings: found 0x4127, wanted 0x4523")],
)
def test_a_part_that_is_not_done_or_has_lost_its_settings_is_configured_anew(
    mask: str, settings: str, why: str
) -> None:
    with pytest.raises(DeviceError, match=f"address 0x41: {why}"):
        rehearse(Ina226(Ina226Knobs()).cycle(Stamp(0)), look("1f40", "2570", "", mask, settings)[:4])


def test_the_identity_and_another_part() -> None:
    talk: list[tuple[Operation, bytes]] = [MAKER, DIE, (Write(0x41, b"\x00\x80\x00"), b"")]
    assert rehearse(Ina226(Ina226Knobs()).configure(), talk).text == "INA226 at 0x41, shunt 0.5 mohm"
    with pytest.raises(DeviceError, match="found ids 0x5449 0x2270, wanted 0x5449 0x226x"):
        rehearse(Ina226(Ina226Knobs()).configure(), [MAKER, (DIE[0], b"\x22\x70")])
