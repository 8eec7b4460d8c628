"""Angles and rates whose header names no unit: by their size, and by each other."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import Recording
from hindrax_core.vehicle import Vehicle

T = np.arange(0.0, 30.0, 0.1)
YAW = 3.0 + 0.6 * np.sin(T / 4.0)
RATE = 0.15 * np.cos(T / 4.0)
DEG = 180.0 / math.pi


def read(header: str, *columns: object, moment: object = 4.0 * np.sin(T), vehicle: Vehicle | None = None) -> Recording:
    rows = zip(T, *columns, moment, strict=True)  # type: ignore[call-overload]  # any columns
    lines = [",".join(f"{cell:.6f}" for cell in row) for row in rows]
    (one,) = read_records("\n".join([f"time,{header},N", *lines]), "x.csv", vehicle=vehicle)
    return one


def test_a_heading_of_many_degrees_tells_the_unit_of_the_rates() -> None:
    """As a ground station writes them; taken for rad/s the vehicle would spin."""
    found = read("heading,yawRate,rollRate", YAW * DEG, RATE * DEG, 0.0 * T + 2.0)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-4)
    assert found.velocity[:, 3] == pytest.approx(0.0 * T + 2.0 / DEG, abs=1e-4)
    assert "angles (yaw) are in degrees, by their size" in found.assumptions
    assert "rates (p, r) are in deg/s, by the angles" in found.assumptions


def test_a_compass_counts_clockwise_and_the_rate_beside_it_perhaps_not() -> None:
    found = read("heading,yawRate", YAW * DEG, -RATE * DEG)
    assert found.velocity[:, 5] == pytest.approx(-RATE, abs=1e-4)


def test_a_heading_that_passes_north_is_one_turn() -> None:
    found = read("heading,yawRate", (YAW * DEG + 170.0) % 360.0, RATE * DEG)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-4)


@pytest.mark.parametrize("wrapped", [lambda yaw: yaw, lambda yaw: (yaw + math.pi) % math.tau - math.pi])
def test_what_is_in_radians_stays(wrapped: Callable[[object], object]) -> None:
    found = read("yaw,r", wrapped(YAW), RATE)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-5)
    assert not any("deg" in one for one in found.assumptions)


def test_rates_in_degrees_beside_angles_in_radians_are_found() -> None:
    found = read("yaw,r", YAW, RATE * DEG)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-4)
    assert "rates (r) are in deg/s, by the angles" in found.assumptions


def test_small_angles_in_degrees_are_found_by_the_rates() -> None:
    roll = 0.05 * np.sin(T / 2.0)
    found = read("roll,p [rad/s],r [rad/s]", roll * DEG, 0.025 * np.cos(T / 2.0), RATE)
    assert found.attitude[:, 0] == pytest.approx(roll, abs=1e-4)
    assert "angles (roll) are in degrees, by their rates" in found.assumptions


def test_turns_in_radians_that_are_counted_on_are_no_degrees() -> None:
    spun = 0.5 * T
    found = read("yaw,r [rad/s],u", spun, 0.5 + 0.2 * np.cos(T), 0.1 * np.sin(T))
    assert not any("deg" in one for one in found.assumptions)


@pytest.mark.parametrize("unit", [1.0, DEG])
def test_the_inertia_tells_whether_turns_are_counted_on_in_radians(unit: float) -> None:
    """Three turns in radians were taken for 20 degrees: a drag of yaw 200 times too large was identified."""
    box = Vehicle("box", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4), inertia_kgm2=(0.7, 0.9, 1.0))
    moment = 3.0 * np.sign(np.sin(T)) + 0.8
    rate = np.zeros(len(T))
    for i in range(1, len(T)):
        rate[i] = rate[i - 1] + 0.1 / 1.8 * (moment[i - 1] - rate[i - 1])
    yaw = np.cumsum(0.1 * rate)
    assert yaw.max() > 2.5 * math.tau
    found = read("yaw,r", unit * yaw, unit * rate, moment=moment, vehicle=box)
    assert found.velocity[:, 5] == pytest.approx(rate, abs=1e-5)


def test_a_named_unit_is_believed() -> None:
    found = read("yaw [deg],r [rad/s]", YAW * DEG, RATE)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-5)
    found = read("r", RATE)
    assert found.velocity[:, 5] == pytest.approx(RATE, abs=1e-5)


def test_a_rate_alone_is_in_degrees_where_it_would_be_a_whirl() -> None:
    found = read("r", RATE * 4.0 * DEG)
    assert found.velocity[:, 5] == pytest.approx(RATE * 4.0, abs=1e-4)
    assert "rates (r) are in deg/s, by their size" in found.assumptions


def test_a_spike_of_a_rate_is_no_unit() -> None:
    rate = RATE * 4.0
    rate[70] = 60.0
    assert not any("deg" in one for one in read("r", rate).assumptions)
