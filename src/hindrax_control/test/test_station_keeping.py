"""Keeping station on an ideal vehicle: transits, currents, headings."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.pool_bounds import PoolBounds, PoolPosition
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.vehicle import Vehicle, load_vehicle


def keep(station: StationKeeping, ideal: IdealVehicle, box: PoolBounds, seconds: float) -> PoolPosition:
    for _ in range(round(seconds / ideal.step_s)):
        X, Y = station.step(box.place(ideal.navigation()), ideal.step_s)
        ideal.step((X, Y, ideal.freedoms["heave"].bias, 0.0, 0.0, 0.0))
    return box.place(ideal.navigation())


@settings(max_examples=15, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(2.0, 8.0), st.floats(1.5, 4.5))
def test_goal_is_reached_at_any_heading(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], heading_rad: float, x_m: float, y_m: float
) -> None:
    ideal, box, station = (
        ideal_vehicle(hindrax, heading_rad=heading_rad),
        PoolBounds(hindrax, 0.0),
        StationKeeping(hindrax),
    )
    station.start(box.place(ideal.navigation()))
    station.goal_m = (x_m, y_m)
    place = keep(station, ideal, box, 35.0)
    assert (place.x_m, place.y_m) == pytest.approx((x_m, y_m), abs=0.05)


def test_current_is_held_off_and_learned_for_every_heading(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    ideal, box, station = ideal_vehicle(hindrax), PoolBounds(hindrax, 0.0), StationKeeping(hindrax)
    ideal.current = (0.1, -0.1)
    place = keep(station, ideal, box, 60.0)
    assert math.hypot(place.vx_mps, place.vy_mps) < 0.01
    ideal.heading = 1.5
    turned = keep(station, ideal, box, 10.0)
    assert math.hypot(turned.x_m - place.x_m, turned.y_m - place.y_m) < 0.2


VEHICLES = sorted((Path(__file__).parents[2] / "hindrax_bringup" / "vehicles").glob("*.yaml"))


@pytest.mark.parametrize("heading_rad", [0.0, -math.pi / 2.0])
@pytest.mark.parametrize("file", VEHICLES, ids=lambda file: file.stem)
def test_every_vehicle_follows_its_reference_untuned(
    file: Path, heading_rad: float, ideal_vehicle: type[IdealVehicle]
) -> None:
    """Gains, drag and mass are of its file: it is 5 cm behind at most, settles in 10 s and does not overshoot."""
    vehicle = load_vehicle(file)
    ideal, box, station = (
        ideal_vehicle(vehicle, heading_rad=heading_rad),
        PoolBounds(vehicle, 0.0),
        StationKeeping(vehicle),
    )
    station.start(box.place(ideal.navigation()))
    station.goal_m = (6.5, 3.0)
    seen: list[tuple[float, float, float]] = []
    while ideal.time_s < 20.0:
        place = keep(station, ideal, box, ideal.step_s)
        seen.append((ideal.time_s, place.x_m - 6.5, station._x.value - place.x_m))
    assert max(abs(behind_m) for _, _, behind_m in seen) < 0.05
    assert max(time_s for time_s, off_m, _ in seen if abs(off_m) > 0.05) < 10.0
    assert max(off_m for _, off_m, _ in seen) < 0.03


def test_an_identified_vehicle_is_followed_closer_than_a_guessed_one(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]
) -> None:
    behind_m = []
    for assumed in (hindrax, replace(hindrax, hydrodynamics=None)):
        ideal, box, station = ideal_vehicle(hindrax), PoolBounds(hindrax, 0.0), StationKeeping(assumed)
        station.start(box.place(ideal.navigation()))
        station.goal_m = (6.5, 3.0)
        places = [(keep(station, ideal, box, 0.1), station._x.value) for _ in range(80)]
        behind_m.append(max(abs(reference_m - place.x_m) for place, reference_m in places))
    known_m, guessed_m = behind_m
    assert 2.0 * known_m < guessed_m
