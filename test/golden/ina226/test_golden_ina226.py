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


def look(shunt: str, bus: str, again: str = "") -> list[tuple[Operation, bytes]]:
    """One triggered conversion: 16 averages of 1.1 ms, shunt and bus (tables 6 to 9: 4523h), read twice."""
    registers = [(WriteRead(0x41, b"\x01", 2), bytes.fromhex(shunt)), (WriteRead(0x41, b"\x02", 2), bytes.fromhex(bus))]
    return [
        (Write(0x41, b"\x00\x45\x23"), b""),
        (Pause(0.0393, 0.1 - 0.0393), b""),
        (WriteRead(0x41, b"\x06", 2), b"\x00\x08"),
        (WriteRead(0x41, b"\x00", 2), b"\x45\x23"),
        *registers,
        (registers[0][0], bytes.fromhex(again or shunt)),
        registers[1],
    ]


def battery(sensor: Ina226, transcript: list[tuple[Operation, bytes]]) -> Battery:
    (stamped,) = rehearse(sensor.cycle(Stamp(0)), transcript)
    assert isinstance(stamped, Stamped)
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
    ("shunt", "bus", "again"), [("7fff", "2570", ""), ("1f40", "2570", "1f41"), ("1f40", "a570", "")]
)
def test_what_is_no_measurement_is_rejected(shunt: str, bus: str, again: str) -> None:
    (rejected,) = rehearse(Ina226(Ina226Knobs()).cycle(Stamp(0)), look(shunt, bus, again))
    assert isinstance(rejected, Rejected)


def test_the_identity_and_another_part() -> None:
    talk: list[tuple[Operation, bytes]] = [MAKER, DIE, (Write(0x41, b"\x00\x80\x00"), b"")]
    assert rehearse(Ina226(Ina226Knobs()).configure(), talk).text == "INA226 at 0x41, shunt 0.5 mohm"
    with pytest.raises(DeviceError, match="found ids 0x5449 0x2270, wanted 0x5449 0x226x"):
        rehearse(Ina226(Ina226Knobs()).configure(), [MAKER, (DIE[0], b"\x22\x70")])
