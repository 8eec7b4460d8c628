"""BME280 against the example of the data sheet, and against the numbers of another implementation."""

import struct
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Air
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.bme280 import Bme280, Bme280Knobs, Calibration, air_of, calibration_of

Talk = list[tuple[Operation, bytes]]

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
SHEET, PIMORONI = CASES["datasheet"], CASES["pimoroni"]
LOW = struct.pack("<H2hH8hxB", *SHEET["t"], *SHEET["p"], 75)
HIGH = bytes.fromhex(CASES["shared_byte"]["registers"])
IDENTIFY = (WriteRead(0x77, b"\xd0", 1), b"\x60")
RESET: Talk = [(Write(0x77, b"\xe0\xb6"), b""), (Pause(0.002), b"")]
COEFFICIENTS: Talk = [(WriteRead(0x77, b"\x88", 26), LOW), (WriteRead(0x77, b"\xe1", 7), HIGH)]


def data(case: dict[str, Any]) -> bytes:
    """Registers 0xF7 to 0xFE."""
    parts = [(case["raw_pressure"] << 4).to_bytes(3, "big"), (case["raw_temperature"] << 4).to_bytes(3, "big")]
    return b"".join(parts) + int(case.get("raw_humidity", 0)).to_bytes(2, "big")


def test_the_example_of_the_data_sheet() -> None:
    air = air_of(Calibration(tuple(SHEET["t"]), tuple(SHEET["p"]), ()), data(SHEET))
    assert air.temperature_C == pytest.approx(SHEET["temperature_C"], abs=0.005)
    assert air.pressure_Pa == pytest.approx(SHEET["pressure_Pa"], abs=0.01)


def test_the_numbers_of_another_implementation() -> None:
    air = air_of(Calibration(tuple(PIMORONI["t"]), tuple(PIMORONI["p"]), tuple(PIMORONI["h"])), data(PIMORONI))
    assert air.temperature_C == pytest.approx(PIMORONI["temperature_C"], abs=2e-4)
    assert air.pressure_Pa == pytest.approx(PIMORONI["pressure_Pa"], abs=0.1)
    assert air.humidity == pytest.approx(PIMORONI["humidity"], abs=1e-5)


def test_the_coefficients_that_share_a_byte() -> None:
    found = calibration_of(LOW, HIGH)
    assert found.t == tuple(SHEET["t"])
    assert found.p == tuple(SHEET["p"])
    assert found.h == (75, *CASES["shared_byte"]["h"])
    assert calibration_of(LOW, b"") == Calibration(found.t, found.p, ()), "a BMP280"


def test_the_conversation() -> None:
    sensor = Bme280(Bme280Knobs())
    configured: Talk = [IDENTIFY, *RESET, *COEFFICIENTS, *COEFFICIENTS, (Write(0x77, b"\xf2\x01"), b"")]
    assert rehearse(sensor.configure(), configured).text == "BME280 at 0x77"
    block = bytes([0x01, 0x00, 0x2C, 0x00, 0x00]) + data(SHEET)
    look: Talk = [
        (Write(0x77, b"\xf4\x2d"), b""),
        (Pause(0.0167, 0.2 - 0.0167), b""),
        (WriteRead(0x77, b"\xf2", 13), block),
    ]
    assert rehearse(sensor.cycle(Stamp(0)), look) == [], "the first measurement has nothing to be compared with"
    (stamped,) = rehearse(sensor.cycle(Stamp(0)), look)
    assert isinstance(stamped, Stamped)
    assert stamped.stamp == 8_350_000
    assert isinstance(stamped.reading, Air)
    assert stamped.reading.pressure_Pa == pytest.approx(SHEET["pressure_Pa"], abs=0.01)


def test_a_bmp280_has_no_humidity() -> None:
    sensor = Bme280(Bme280Knobs())
    low = [COEFFICIENTS[0]]
    talk: Talk = [(IDENTIFY[0], b"\x58"), *RESET, *low, *low]
    assert rehearse(sensor.configure(), talk).text == "BMP280 at 0x77"


def test_another_part_and_a_disturbed_calibration_are_refused() -> None:
    with pytest.raises(DeviceError, match=r"found id 0x55, wanted 0x60 \(BME280\)"):
        rehearse(Bme280(Bme280Knobs()).configure(), [(IDENTIFY[0], b"\x55")])
    disturbed: Talk = [(COEFFICIENTS[0][0], bytes([LOW[0] ^ 4, *LOW[1:]])), COEFFICIENTS[1]]
    with pytest.raises(DeviceError, match="two reads of its calibration differ"):
        rehearse(Bme280(Bme280Knobs()).configure(), [IDENTIFY, *RESET, *COEFFICIENTS, *disturbed])
