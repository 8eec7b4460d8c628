"""The identification gets the motion of the center of mass, wherever the sensors sit."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import BottomVelocity, Pressure
from hindrax_core.rotation import cross, matrix, rotate
from hindrax_core.signals import Attitude, Navigation, Phase, Velocity, Way
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_ident.records.feed import Feed, WallRange

CENTER = (0.05, -0.03, 0.02)
RATES = (0.4, -0.3, 0.6)
ATTITUDE = (0.35, -0.25, 1.0)
ORIGIN_MPS = (0.3, -0.1, 0.2)
DEPTH_M = 0.8


@pytest.fixture
def reported(vehicle: Vehicle) -> list[Any]:
    """Everything that a rotating, moving vehicle with an offset center of mass says at one instant."""
    sensors = {name: replace(one, position_m=(0.1, 0.02, 0.15)) for name, one in vehicle.sensors.items()}
    moved = replace(vehicle, center_of_mass_m=CENTER, sensors=sensors)
    feed = Feed(moved)
    x, y, z = (v + w for v, w in zip(ORIGIN_MPS, cross(RATES, (0.1, 0.02, 0.15)), strict=True))
    sensor_m = DEPTH_M + rotate(matrix(ATTITUDE), (0.1, 0.02, 0.15))[2]
    pressure = vehicle.water.surface_pressure_Pa + sensor_m * vehicle.water.density_kgpm3 * 9.80665
    state = Navigation(
        attitude_rad=ATTITUDE,
        rate_radps=RATES,
        velocity_mps=ORIGIN_MPS,
        depth_m=DEPTH_M,
        altitude_m=1.0,
        position_m=(0.0, 0.0),
        dvl_locked=True,
        ages_s={},
        velocity_sigma_mps=(0.01, 0.01, 0.01),
    )
    readings = (state, BottomVelocity((x, y, z), 0.01, 1.0, 0.05, 0), Pressure(pressure, 20.0))
    return [event.reading for one in readings for event in feed.events_of(Stamped(Stamp(0), one))]


def test_velocities_are_those_of_the_center_of_mass(reported: list[Any]) -> None:
    expected = [v + w for v, w in zip(ORIGIN_MPS, cross(RATES, CENTER), strict=True)]
    found = {one.source: one.nu for one in reported if isinstance(one, Velocity)}
    assert found["dvl"][:2] == pytest.approx(expected[:2])
    assert found["navigation"][2] == pytest.approx(expected[2])
    assert found["navigation"][3:] == RATES


def test_depths_are_those_of_the_center_of_mass(reported: list[Any]) -> None:
    expected = DEPTH_M + rotate(matrix(ATTITUDE), CENTER)[2]
    depths = [one.depth_m for one in reported if isinstance(one, Attitude)]
    assert depths == pytest.approx([expected, expected], abs=1e-5)
    assert abs(expected - DEPTH_M) > 0.01


def test_a_dvl_without_lock_states_nothing(vehicle: Vehicle) -> None:
    assert Feed(vehicle).events_of(Stamped(Stamp(0), BottomVelocity(None, math.inf, 0.0, 0.05, 0))) == ()


AHEAD, PORT = (0.0, 90.0, 0.0), (90.0, 0.0, 0.0)


def ways(vehicle: Vehicle, rotation_deg: tuple[float, float, float], *turned_deg: float) -> list[Any]:
    """What ranges of 3 m make, at headings from that at which the motion began, with the sonar 0.3 m ahead."""
    rest = {name: one for name, one in vehicle.sensors.items() if name not in vehicle.measuring("velocity")}
    sonar = Mount("ping1d", position_m=(0.3, 0.0, 0.0), rotation_deg=rotation_deg)
    feed, found = Feed(replace(vehicle, center_of_mass_m=(0.0, 0.0, 0.0), sensors={**rest, "wall": sonar})), []
    for number, degrees in enumerate((0.0, *turned_deg)):
        attitude = (0.0, 0.0, 0.5 + math.radians(degrees))
        state = Navigation(attitude, (0.0, 0.0, 0.0), (math.nan,) * 3, 1.0, 1.0, (0.0, 0.0), dvl_locked=False)
        phase = Phase("surge", "settle" if number == 0 else "transient")
        for one in (state, phase, WallRange(3.0, "wall")):
            found += [event.reading for event in feed.events_of(Stamped(Stamp(0), one))]
    return [one for one in found if isinstance(one, Way)]


def test_a_range_to_a_wall_is_a_way_along_the_axis_it_looks_along(vehicle: Vehicle) -> None:
    assert ways(vehicle, AHEAD, 0.0)[0].way_m[0] == pytest.approx(-3.3)
    assert ways(vehicle, PORT, 0.0)[0].way_m[1] == pytest.approx(3.0)


def test_ranges_count_while_the_beam_holds_the_normal_of_the_wall(vehicle: Vehicle) -> None:
    assert len(ways(vehicle, AHEAD, 0.0, 8.0, -8.0)) == 4
    assert len(ways(vehicle, AHEAD, 0.0, 15.0, -40.0)) == 2


def test_beside_a_dvl_and_of_no_confidence_a_range_is_no_way(vehicle: Vehicle) -> None:
    feed = Feed(replace(vehicle, sensors={**vehicle.sensors, "wall": Mount("ping1d", rotation_deg=AHEAD)}))
    assert feed.events_of(Stamped(Stamp(0), WallRange(3.0, "wall"))) == ()
