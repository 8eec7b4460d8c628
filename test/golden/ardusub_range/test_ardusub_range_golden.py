"""Distances of the autopilot's rangefinder against frames by pymavlink."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from pymavlink.dialects.v20 import ardupilotmega

from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Echo
from hindrax_drivers.devices.ardusub_range import ArduSubRange

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())["distances"]
BOARD = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)


def outputs(cm: int, quality: int, orientation: int = 25) -> list[Output]:
    driver = ArduSubRange()
    list(driver.start(Stamp(10**9)))
    messages = (
        BOARD.heartbeat_encode(12, 3, 0x41, 19, 3),
        BOARD.distance_sensor_encode(5000, 30, 10_000, cm, 2, 0, orientation, 0, 0.0, 0.0, [0.0] * 4, quality),
    )
    return list(driver.feed(b"".join(bytes(one.pack(BOARD)) for one in messages), stamp_from_s(1.5)))


@pytest.mark.parametrize("row", CASES, ids=lambda row: row["what"])
def test_a_distance(row: dict[str, Any]) -> None:
    (found,) = outputs(row["cm"], row["quality"])
    assert isinstance(found, Stamped)
    assert isinstance(found.reading, Echo)
    assert found.reading.range_m == row["range_m"]
    assert found.reading.confidence == pytest.approx(row["confidence"], abs=1e-4)


def test_one_that_looks_elsewhere_is_another_sensor() -> None:
    assert outputs(215, 100, orientation=0) == []
