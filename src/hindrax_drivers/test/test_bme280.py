"""The barometer in the hull: the weight of each coefficient, and what is no measurement."""

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Air
from hindrax_core.testing import rehearse
from hindrax_drivers.devices import bme280 as module
from hindrax_drivers.devices.bme280 import (
    HUNG_AFTER,
    REPEATS,
    Bme280,
    Bme280Knobs,
    Calibration,
    air_of,
    calibration_of,
)

LOW, HIGH = bytes(range(1, 27)), bytes(range(1, 8))
ASLEEP, AIR = 0x2C, Air(101_325.0, 20.0, 0.5)
Talk = list[tuple[Operation, bytes]]


def registers(pressure: int, temperature: int, humidity: int) -> bytes:
    """Registers 0xF7 to 0xFE."""
    parts = [(pressure << 4).to_bytes(3, "big"), (temperature << 4).to_bytes(3, "big")]
    return b"".join(parts) + humidity.to_bytes(2, "big")


@pytest.mark.parametrize(
    ("t", "wanted_C"),
    [((0, 5120, 0), 32.0), ((1024, 5120, 0), 31.0), ((0, 5120, 5120), 48.0), ((0, 0, -5120), -16.0)],
)
def test_each_coefficient_of_the_temperature_has_the_power_of_two_of_the_data_sheet(
    t: tuple[int, ...], wanted_C: float
) -> None:
    assert air_of(Calibration(t, (0, 1, *[0] * 7), ()), registers(0, 32 << 14, 0)).temperature_C == wanted_C


@pytest.mark.parametrize(
    ("coefficient", "value", "wanted_Pa"),
    [
        (1, 6250, 1024.0),
        (1, 12500, 512.0),
        (2, 2**19, 512.0),
        (3, 2**23, 512.0),
        (4, -1, 1040.0),
        (5, -1, 1028.0),
        (6, -1, 1026.0),
        (7, 16, 1025.0),
        (8, 2**9, 1025.0),
        (9, 2**15, 1025.0),
    ],
)
def test_each_coefficient_of_the_pressure_has_the_power_of_two_of_the_data_sheet(
    coefficient: int, value: int, wanted_Pa: float
) -> None:
    """1024 counts below the end of 20 bits, and a temperature 2^15 above the middle of the polynomial (section 8.1)."""
    p = [6250, 0, 0, 0, 0, 0, 0, 0, 0]
    p[coefficient - 1] = value
    air = air_of(Calibration((0, 6048, 0), tuple(p), ()), registers((1 << 20) - 1024, 32 << 14, 0))
    assert air.pressure_Pa == wanted_Pa
    assert math.isnan(air.humidity)


def test_a_calibration_without_a_gain_gives_no_pressure() -> None:
    assert math.isnan(air_of(Calibration((0, 1, 0), (0,) * 9, ()), bytes(8)).pressure_Pa)


@pytest.mark.parametrize(
    ("h", "raw", "wanted"),
    [
        ((0, 65536, 0, 0, 0, 0), 50, 0.5),
        ((0, 32768, 0, 0, 0, 0), 50, 0.25),
        ((4096, 65536, 0, 0, 0, 0), 50, 0.3046875),
        ((0, 65536, 0, -1, 0, 0), 0, 0.64),
        ((0, 65536, 0, 0, -16, 0), 50, 0.66),
        ((0, 65536, 0, 0, 0, 4096), 25, 0.5),
        ((0, 65536, 4096, 0, 0, 4096), 20, 0.6),
        ((0, 65536, 0, 0, 0, 0), 200, 1.0),
        ((0, 65536, 0, 1, 0, 0), 0, 0.0),
    ],
)
def test_each_coefficient_of_the_humidity_has_the_power_of_two_of_the_data_sheet(
    h: tuple[int, ...], raw: int, wanted: float
) -> None:
    """A temperature 2^14 above the middle of the polynomial (section 8.1)."""
    air = air_of(Calibration((0, 2912, 0), (1, *[0] * 8), h), registers(0, 32 << 14, raw))
    assert air.humidity == pytest.approx(wanted, rel=1e-12)


@given(st.integers(-2048, 2047), st.integers(-2048, 2047))
def test_two_coefficients_of_twelve_bits_share_a_byte(h4: int, h5: int) -> None:
    """0xE4 and the low half of 0xE5; 0xE6 and its high half (table 16)."""
    shared = bytes([h4 >> 4 & 0xFF, h4 & 0xF | (h5 & 0xF) << 4, h5 >> 4 & 0xFF])
    assert calibration_of(LOW, HIGH[:3] + shared + HIGH[6:]).h[3:5] == (h4, h5)


def configured(sensor: Bme280, at: int = 0x77, part: bytes = b"\x60") -> Bme280:
    whole = part == b"\x60"
    coefficients: Talk = [(WriteRead(at, b"\x88", 26), LOW), *[(WriteRead(at, b"\xe1", 7), HIGH)] * whole]
    talk: Talk = [(WriteRead(at, b"\xd0", 1), part), (Write(at, b"\xe0\xb6"), b""), (Pause(0.002), b"")]
    humid: Talk = [(Write(at, b"\xf2\x01"), b"")] * whole
    assert rehearse(sensor.configure(), [*talk, *coefficients, *coefficients, *humid]).text.endswith(f"{at:#04x}")
    return sensor


def look(sensor: Bme280, raw: bytes, head: bytes = bytes([1, 0, ASLEEP, 0, 0]), at: int = 0x77) -> Any:
    """What a measurement gives; None for nothing."""
    pause = Pause(0.0167, max(0.0, sensor.period_s - 0.0167))
    talk: Talk = [(Write(at, b"\xf4\x2d"), b""), (pause, b""), (WriteRead(at, b"\xf2", 13), head + raw)]
    found = rehearse(sensor.cycle(Stamp(10**9)), talk)
    assert all(one.stamp == 10**9 + 8_350_000 for one in found), "the middle of the measurement"
    return found[0] if found else None


def test_at_another_address_and_as_often_as_wanted() -> None:
    sensor = configured(Bme280(Bme280Knobs(period_s=0.06), 0x76), 0x76)
    assert sensor.period_s == 0.06
    look(sensor, bytes(8), at=0x76)


@pytest.mark.parametrize("coefficients", [bytes(26), b"\xff" * 26])
def test_an_empty_calibration_is_refused(coefficients: bytes) -> None:
    low, high = (WriteRead(0x77, b"\x88", 26), coefficients), (WriteRead(0x77, b"\xe1", 7), HIGH)
    start: Talk = [(WriteRead(0x77, b"\xd0", 1), b"\x60"), (Write(0x77, b"\xe0\xb6"), b""), (Pause(0.002), b"")]
    with pytest.raises(DeviceError, match=r"address 0x77: two reads of its calibration differ, or are empty"):
        rehearse(Bme280(Bme280Knobs()).configure(), [*start, low, high, low, high])


@pytest.mark.parametrize(
    ("head", "why"),
    [
        (bytes([1, 0x08, ASLEEP, 0, 0]), r"not done after 0.0167 s \(status 0x08\)"),
        (bytes([1, 0x01, ASLEEP, 0, 0]), r"not done after 0.0167 s \(status 0x01\)"),
        (bytes([0, 0, ASLEEP, 0, 0]), r"lost its settings \(ctrl_hum 0x00, ctrl_meas 0x2c\)"),
        (bytes([1, 0, 0, 0, 0]), r"lost its settings \(ctrl_hum 0x01, ctrl_meas 0x00\)"),
    ],
)
def test_a_part_that_is_not_done_or_has_lost_its_settings_is_configured_anew(head: bytes, why: str) -> None:
    with pytest.raises(DeviceError, match=why):
        look(configured(Bme280(Bme280Knobs())), bytes(8), head)


def reasons(monkeypatch: pytest.MonkeyPatch, *airs: Air, part: bytes = b"\x60") -> list[str]:
    """What is said of measurements in a row, each of its own bytes; nothing of one that is believed or the first."""
    sensor, found = configured(Bme280(Bme280Knobs()), part=part), []
    for number, air in enumerate(airs):
        monkeypatch.setattr(module, "air_of", lambda *_raw, air=air: air)
        one = look(sensor, struct.pack("<Q", number), bytes([part == b"\x60", 0, ASLEEP, 0, 0]))
        assert isinstance(one, Rejected) or (one is None and number == 0) or one.reading == air
        found.append(one.reason if isinstance(one, Rejected) else "")
    return found


@pytest.mark.parametrize(
    ("air", "beyond"),
    [
        (Air(30_000.0, 20.0, 0.5), Air(29_999.9, 20.0, 0.5)),
        (Air(110_000.0, 20.0, 0.5), Air(110_000.1, 20.0, 0.5)),
        (Air(101_325.0, -40.0, 0.5), Air(101_325.0, -40.1, 0.5)),
        (Air(101_325.0, 85.0, 0.5), Air(101_325.0, 85.1, 0.5)),
        (AIR, Air(math.nan, 20.0, 0.5)),
    ],
)
def test_the_part_measures_300_to_1100_hPa_and_minus_40_to_85_degrees(
    monkeypatch: pytest.MonkeyPatch, air: Air, beyond: Air
) -> None:
    assert reasons(monkeypatch, air, air) == ["", ""]
    assert reasons(monkeypatch, beyond, air) == ["range", ""]


@pytest.mark.parametrize(
    ("to", "accepted"),
    [
        (Air(101_625.0, 20.0, 0.5), True),
        (Air(101_625.1, 20.0, 0.5), False),
        (Air(101_024.9, 20.0, 0.5), False),
        (Air(101_325.0, 21.0, 0.5), True),
        (Air(101_325.0, 21.01, 0.5), False),
        (Air(101_325.0, 18.99, 0.5), False),
        (Air(101_325.0, 20.0, 0.549), True),
        (Air(101_325.0, 20.0, 0.551), False),
        (Air(101_325.0, 20.0, 0.449), False),
    ],
)
def test_a_leap_is_refused_and_what_stays_there_is_accepted(
    monkeypatch: pytest.MonkeyPatch, to: Air, accepted: bool
) -> None:
    assert reasons(monkeypatch, AIR, to, to) == ["", "" if accepted else "leap", ""]


def test_the_air_of_a_bmp280_has_no_humidity_that_could_leap(monkeypatch: pytest.MonkeyPatch) -> None:
    dry = Air(101_325.0, 20.0, math.nan)
    assert reasons(monkeypatch, dry, dry, part=b"\x58") == ["", ""]


def test_equal_measurements_are_refused_and_a_part_that_hangs_is_configured_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "air_of", lambda *_raw: AIR)
    sensor = configured(Bme280(Bme280Knobs()))
    for raw in (b"measured", b"anything"):
        found = [look(sensor, raw) for _ in range(HUNG_AFTER)]
        rejected = [one.reason for one in found if isinstance(one, Rejected)]
        assert rejected == [f"{count} equal measurements" for count in range(REPEATS + 1, HUNG_AFTER + 1)]
        assert all(isinstance(one, Stamped) for one in found[1:REPEATS])
    with pytest.raises(DeviceError, match="address 0x77: repeats the same measurement"):
        look(sensor, b"anything")
    configured(sensor)
    assert look(sensor, b"anything") is None, "nothing to be compared with"
    assert isinstance(look(sensor, b"anything"), Stamped)
