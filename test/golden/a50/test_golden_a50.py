"""Reports of the vendor's page through the decoder and the driver of a Water Linked DVL."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hindrax_core.driver_interface import Identity, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import BottomTrack, BottomVelocity
from hindrax_drivers.devices.a50 import A50, A50Knobs
from hindrax_drivers.protocols import waterlinked_protocol as protocol

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text(encoding="utf-8"))
VELOCITY, POSITION, SETTINGS = (CASES[name] for name in ("velocity", "position", "settings"))
NOW = Stamp(50_000_000_000)


def line(document: dict[str, Any]) -> bytes:
    return json.dumps(document).encode() + b"\r\n"


def changed(**changes: Any) -> bytes:
    return line({**json.loads(VELOCITY["line"]), **changes})


def readings(driver: A50, data: bytes, now: Stamp = NOW) -> list[Any]:
    return [one.reading for one in driver.feed(data, now) if isinstance(one, Stamped)]


def test_the_velocity_report() -> None:
    found = protocol.velocity_report(protocol.parse(VELOCITY["line"].encode()))
    assert found.velocity_mps == tuple(VELOCITY["velocity_mps"])
    assert found.altitude_m == VELOCITY["altitude_m"]
    assert [beam.range_m for beam in found.beams] == VELOCITY["ranges_m"]
    assert found.interval_s == pytest.approx(VELOCITY["interval_s"])
    assert found.transmission_us - found.validity_us == VELOCITY["transmitted_after_us"]
    assert found.valid
    assert not found.hot


def test_the_figure_of_merit_is_the_root_of_the_largest_eigenvalue() -> None:
    covariance = np.array(json.loads(VELOCITY["line"])["covariance"])
    assert math.sqrt(np.linalg.eigvalsh(covariance)[-1]) == pytest.approx(VELOCITY["fom_mps"], rel=1e-6)
    found = protocol.velocity_report(protocol.parse(VELOCITY["line"].encode()))
    assert found.fom_mps == VELOCITY["fom_mps"]
    assert found.sigma_mps == pytest.approx(math.sqrt(covariance[0, 0]))


def test_the_stamp_lies_as_long_before_the_arrival_as_the_report_says() -> None:
    driver = A50(A50Knobs(latency_s=0.0))
    stamps = {type(one.reading): one.stamp for one in driver.feed(changed(), NOW) if isinstance(one, Stamped)}
    assert stamps == dict.fromkeys((BottomTrack, BottomVelocity), NOW - 1000 * VELOCITY["transmitted_after_us"])


def test_the_reading_has_the_deviation_of_the_covariance_and_a_floor() -> None:
    track, velocity = readings(A50(A50Knobs(sigma_floor_mps=0.003)), changed())
    assert velocity.velocity_mps == tuple(VELOCITY["velocity_mps"])
    assert velocity.sigma_mps == pytest.approx(math.hypot(0.003, 1.5643e-4), rel=1e-4)
    assert velocity.confidence == 1.0
    assert (track.locked, track.altitude_m) == (True, VELOCITY["altitude_m"])


@pytest.mark.parametrize(
    "change",
    [{"velocity_valid": False}, {"fom": 0.2}, {"tracking_mode": "water"}, {"type": "velocity_water"}],
    ids=lambda change: next(iter(change)),
)
def test_without_lock_or_with_a_poor_figure_of_merit_there_is_no_velocity(change: dict[str, Any]) -> None:
    track, velocity = readings(A50(), changed(**change))
    assert velocity.velocity_mps is None
    assert track.locked is ("fom" in change)


def test_the_dead_reckoning_report_is_a_sign_of_life() -> None:
    found = protocol.dead_reckoning(protocol.parse(POSITION["line"].encode()))
    assert found.position_m == pytest.approx(POSITION["position_m"])
    assert found.sigma_m == POSITION["sigma_m"]
    assert math.degrees(found.attitude_rad[0]) == pytest.approx(POSITION["roll_deg"])
    assert A50().feed(POSITION["line"].encode() + b"\n", NOW) == []


@pytest.mark.parametrize("case", CASES["commands"], ids=lambda case: case["name"])
def test_commands(case: dict[str, Any]) -> None:
    made = protocol.command(case["name"], **case.get("parameters", {}))
    assert json.loads(made) == json.loads(case["line"])
    assert made.endswith(b"\n")


def test_settings_that_spoil_a_measurement_are_set_and_read_again() -> None:
    driver = A50(A50Knobs(speed_of_sound_mps=1484.0))
    assert driver.start(NOW) == [Send(protocol.command("get_config"))]
    identity, order = driver.feed(SETTINGS["line"].encode() + b"\n", NOW)
    assert identity == Identity("Water Linked DVL, json_v3.1")
    assert isinstance(order, Send)
    assert json.loads(order.data) == {
        "command": "set_config",
        "parameters": {"speed_of_sound": 1484, "mounting_rotation_offset": 0},
    }
    answer = {"response_to": "set_config", "success": True, "error_message": "", "result": None, "type": "response"}
    assert driver.feed(line(answer), NOW) == [Send(protocol.command("get_config"))]
    refused = driver.feed(line(answer | {"success": False, "error_message": "out of range"}), NOW)
    assert refused == [Trouble(NOW, "DVL: refused set_config (out of range)")]


def test_settings_are_only_reported_where_the_driver_may_not_set_them() -> None:
    outputs = A50(A50Knobs(configure=False)).feed(SETTINGS["line"].encode() + b"\n", NOW)
    texts = [one.text for one in outputs if isinstance(one, Trouble)]
    assert texts[0].startswith("DVL speed of sound: found 1475.0, wanted 1484; ")
    assert texts[1].startswith("DVL mounting rotation offset: found 20.0, wanted 0; ")
    assert not [one for one in outputs if isinstance(one, Send)]


@pytest.mark.parametrize("case", CASES["refused"], ids=lambda case: case["what"])
def test_what_is_no_report_is_refused(case: dict[str, Any]) -> None:
    data = changed(**case["change"])
    data = data[: len(data) // 2] + b"\n" if case.get("cut") else data
    (refused,) = A50().feed(data, NOW)
    assert isinstance(refused, Rejected)
    assert refused.reason == case["reason"]


def test_the_same_report_twice_is_no_second_measurement() -> None:
    driver = A50()
    assert len(readings(driver, changed())) == 2
    assert [one.reason for one in driver.feed(changed(), NOW) if isinstance(one, Rejected)] == ["velocity: repeated"]


def test_a_batch_of_reports_that_comes_again_is_no_measurement_and_a_clock_that_was_set_is_no_batch() -> None:
    """Each report of the batch is older than the one before it, so a look at the last alone takes both for new."""
    driver, first_us = A50(), json.loads(VELOCITY["line"])["time_of_validity"]

    def at(later_us: int) -> bytes:
        sent_us = json.loads(VELOCITY["line"])["time_of_transmission"]
        return changed(time_of_validity=first_us + later_us, time_of_transmission=sent_us + later_us)

    batch = at(0) + at(100_000)
    assert len(readings(driver, batch)) == 4
    assert [readings(driver, batch) for _ in range(3)] == [[], [], []]
    assert len(readings(driver, at(-5_000_000))) == 2
