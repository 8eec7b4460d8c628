"""Sentences from outside through the driver, field by field."""

import functools
import math
import operator
from pathlib import Path
from typing import Any, TypeVar

import pytest
import yaml

from hindrax_core.driver_interface import Identity, Output
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import BottomTrack, BottomVelocity, Position
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_drivers.protocols.dvl75_protocol import checksum

ReadingT = TypeVar("ReadingT")
CASES = yaml.safe_load((Path(__file__).parent / "cases.yaml").read_text(encoding="utf-8"))


def named(kind: str) -> list[object]:
    return [pytest.param(case, id=case["name"]) for case in CASES[kind]]


def outputs(line: str) -> list[Output]:
    driver = Dvl75()
    driver.start(Stamp(0))
    return driver.feed(line.encode() + b"\r\n", Stamp(10**9))


def reading(line: str, kind: type[ReadingT]) -> ReadingT:
    (found,) = [one.reading for one in outputs(line) if isinstance(one, Stamped) and isinstance(one.reading, kind)]
    return found


@pytest.mark.parametrize("case", named("velocities"))
def test_position_deltas(case: dict[str, Any]) -> None:
    found = reading(case["line"], BottomVelocity)
    assert (found.device_us, found.interval_s, found.confidence) == pytest.approx(
        (case["device_us"], case["interval_s"], case["confidence"])
    )
    wanted = case["velocity_mps"]
    assert (found.velocity_mps is None) == (wanted is None)
    assert (found.velocity_mps is None) == (wanted is None)
    if wanted is not None:
        assert found.velocity_mps == pytest.approx(wanted)


@pytest.mark.parametrize("case", named("tracks"))
def test_extended_data(case: dict[str, Any]) -> None:
    found = reading(case["line"], BottomTrack)
    attitude = (found.roll_rad, found.pitch_rad, found.heading_rad)
    assert found.locked is case["locked"]
    assert attitude == pytest.approx([math.radians(one) for one in case["attitude_deg"]])
    assert found.altitude_m == case["altitude_m"]
    assert found.velocity_north_east_mps == pytest.approx(case["north_east_mps"])
    assert found.imu_calibration == case["imu_calibration"]
    assert found.skipped_pings == case["skipped_pings"]
    assert [beam.gain_dB for beam in found.beams] == case["gains_dB"]
    assert [beam.locked for beam in found.beams] == case["locks"]
    assert [beam.velocity_mps for beam in found.beams] == case["beam_velocities_mps"]
    assert [beam.range_m for beam in found.beams] == case["ranges_m"]
    place = reading(case["line"], Position)
    assert [place.latitude_deg, place.longitude_deg, place.fixed] == case["place"]


def test_a_place_of_nmea_0183() -> None:
    case = CASES["minimum"]
    place = reading(case["line"], Position)
    assert (place.latitude_deg, place.longitude_deg) == pytest.approx(case["place"][:2], abs=1e-6)
    assert place.fixed is case["place"][2]


@pytest.mark.parametrize("case", named("refused"))
def test_refused(case: dict[str, Any]) -> None:
    assert [one.reason for one in outputs(case["line"]) if isinstance(one, Rejected)] == [case["reason"]]
    assert not [one for one in outputs(case["line"]) if isinstance(one, Stamped)]


@pytest.mark.parametrize("case", [*named("velocities"), *named("tracks")])
def test_the_folded_checksum_is_the_plain_xor(case: dict[str, Any]) -> None:
    body, _, digits = case["line"][1:].encode().partition(b"*")
    assert checksum(body) == functools.reduce(operator.xor, body) == int(digits, 16)


def test_configuration_names_the_device() -> None:
    case = CASES["configuration"]
    plain = functools.reduce(operator.xor, case["line"][1:].encode())
    driver = Dvl75()
    found = driver.feed(f"{case['line']}*{plain:02X}\n".encode(), Stamp(0))
    assert found == [Identity(case["identity"])]
    assert driver.configuration["DVPDX messages"] == "ON"
