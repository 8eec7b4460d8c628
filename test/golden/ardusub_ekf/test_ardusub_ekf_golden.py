"""Velocities of the autopilot's estimator against frames by pymavlink."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from pymavlink.dialects.v20 import ardupilotmega

from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.readings import BottomVelocity
from hindrax_drivers.devices.ardusub_ekf import ArduSubEkf

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
BOARD = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)


def velocity(flags: int, angles_deg: list[float], ned_mps: list[float]) -> BottomVelocity:
    """What the driver makes of the messages of one moment."""
    driver = ArduSubEkf()
    list(driver.start(Stamp(10**9)))
    messages = (
        BOARD.heartbeat_encode(12, 3, 0x41, 19, 3),
        BOARD.ekf_status_report_encode(flags, 0.1, 0.1, 0.1, 0.1, 0.0),
        BOARD.attitude_encode(5000, *map(math.radians, angles_deg), 0.0, 0.0, 0.0),
        BOARD.local_position_ned_encode(5000, 0.0, 0.0, 0.0, *ned_mps),
    )
    data = b"".join(bytes(one.pack(BOARD)) for one in messages)
    (found,) = driver.feed(data, stamp_from_s(1.5))
    assert isinstance(found, Stamped)
    assert isinstance(found.reading, BottomVelocity)
    return found.reading


@pytest.mark.parametrize("row", CASES["velocities"], ids=lambda row: row["what"])
def test_a_velocity_is_turned_into_body_axes(row: dict[str, Any]) -> None:
    found = velocity(0b0000110, row["angles_deg"], row["ned_mps"])
    assert found.velocity_mps == pytest.approx(row["body_mps"], abs=1e-6)


@pytest.mark.parametrize("row", CASES["claims"], ids=lambda row: row["what"])
def test_it_is_one_only_while_the_estimator_claims_it(row: dict[str, Any]) -> None:
    found = velocity(row["flags"], [0.0, 0.0, 0.0], [0.1, 0.2, 0.3])
    assert (found.velocity_mps is not None) is row["claimed"]
