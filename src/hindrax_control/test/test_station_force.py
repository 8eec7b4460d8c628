"""The force that keeps station: what is asked for at a place and a speed, in the pool and in the body."""

import math
from dataclasses import replace

import pytest

from hindrax_control.hold.station_keeping import StationKeeping, StationKeepingKnobs
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.vehicle import Vehicle


def hover(axis: str, off_m: float = 0.0, speed_mps: float = 0.0, heading_rad: float = 0.0) -> PoolPosition:
    """A place off the middle of the pool along one of its axes, moving along it."""
    x_m, y_m, vx_mps, vy_mps = (off_m, 0.0, speed_mps, 0.0) if axis == "x" else (0.0, off_m, 0.0, speed_mps)
    return PoolPosition(5.0 + x_m, 3.0 + y_m, heading_rad, vx_mps, vy_mps)


def along(axis: str, force: tuple[float, float]) -> tuple[float, float]:
    """Force along and across a pool axis, of a vehicle that heads along the pool."""
    return force if axis == "x" else force[::-1]


def test_length_left_free_is_left_alone_and_the_width_is_kept(hindrax: Vehicle) -> None:
    """It is carried along the pool at 0.3 m/s, and off across it by 10 cm."""
    station = StationKeeping(hindrax)
    station.start(hover("x", speed_mps=0.3))
    for index in range(100):
        place = replace(hover("x", off_m=0.006 * index, speed_mps=0.3), y_m=3.1)
        force, other = station.step(place, 0.02, length_free=True)
        # What keeps it going, and no more.
        assert force == pytest.approx(prior_dynamics(hindrax)["surge"].drag_force(0.3), rel=0.1)
        assert other < 0.0
    goal_m = dict(zip("xy", station.goal_m or (), strict=True))
    assert goal_m == {"x": pytest.approx(place.x_m), "y": 3.0}


@pytest.mark.parametrize("axis", ["x", "y"])
def test_speed_over_ground_is_damped_and_a_goal_elsewhere_is_gone_to_in_time(hindrax: Vehicle, axis: str) -> None:
    station = StationKeeping(hindrax)
    station.start(hover(axis))
    drifting, across = along(axis, station.step(hover(axis, speed_mps=0.1), 0.02))
    assert drifting < 0.0
    assert across == 0.0
    station = StationKeeping(hindrax)
    station.start(hover(axis))
    station.goal_m = (5.0 + 2.0, 3.0 + 2.0)
    ahead, _ = along(axis, station.step(hover(axis), 0.02))
    assert ahead > 0.0
    for _ in range(400):
        station.step(hover(axis), 0.02, held_back=True)
    assert (station._x.value, station._y.value) == pytest.approx((5.0 + 2.0, 3.0 + 2.0), abs=0.3)


def learned_N(station: StationKeeping, axis: str, seconds: float, *, heading_rad: float = 0.0) -> float:
    """Keep a vehicle 10 cm behind its goal for a while; what it asks for more at the end [N], along the axis."""
    place = hover(axis, -0.1, heading_rad=heading_rad)
    station.goal_m = (5.0, 3.0)
    forces = [station.step(place, 0.02) for _ in range(round(seconds / 0.02) + 1)]
    X, Y = (last - first for first, last in zip(forces[0], forces[-1], strict=True))
    north, east = (
        X * math.cos(heading_rad) - Y * math.sin(heading_rad),
        X * math.sin(heading_rad) + Y * math.cos(heading_rad),
    )
    return north if axis == "x" else east


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_what_holds_against_a_current_grows_as_the_pool_sees_it_up_to_its_authority(
    hindrax: Vehicle, axis: str, heading_rad: float
) -> None:
    knobs, station = StationKeepingKnobs(), StationKeeping(hindrax)
    station.start(hover(axis, heading_rad=heading_rad))
    assert 0.0 < learned_N(station, axis, 1.0, heading_rad=heading_rad) < knobs.integral_N
    assert learned_N(station, axis, 200.0, heading_rad=heading_rad) < knobs.integral_N
    turned = [station.step(hover(axis, heading_rad=angle_rad), 0.0) for angle_rad in (0.0, heading_rad)]
    assert [math.hypot(*force) for force in turned] == pytest.approx([knobs.integral_N] * 2, rel=0.2)


def test_the_integral_part_repeats_the_proportional_one_in_its_time(hindrax: Vehicle) -> None:
    station = StationKeeping(hindrax)
    station.start(hover("x"))
    spring_N = station.step(hover("x", -0.1), 0.0)[0]
    assert learned_N(station, "x", StationKeepingKnobs().integral_s) == pytest.approx(spring_N, rel=0.01)


def test_a_long_gap_counts_as_a_short_step_and_a_step_back_as_none(hindrax: Vehicle) -> None:
    forces = []
    for gap_s in (-1.0, 0.0, 0.1, 3.0, 30.0):
        station = StationKeeping(hindrax)
        station.start(hover("x"))
        station.step(hover("x", -0.1), gap_s)
        forces.append(station.step(hover("x", -0.1), 0.0)[0])
    assert forces[0] == forces[1] < forces[2] < forces[3] == forces[4]


def test_unknown_place_asks_for_nothing_and_it_stays_where_it_is_known_again(hindrax: Vehicle) -> None:
    station = StationKeeping(hindrax)
    station.start(hover("x"))
    place = hover("x")
    lost = (replace(place, x_m=math.nan), replace(place, y_m=math.nan), replace(place, vx_mps=math.nan))
    for unknown in (*lost, replace(place, vy_mps=math.inf)):
        assert station.step(unknown, 0.02) == (0.0, 0.0)
        assert station.goal_m is None
    assert station.step(hover("x", 2.0), 0.02) == pytest.approx((0.0, 0.0))
    assert station.goal_m == (7.0, 3.0)


def test_integral_stands_still_while_held_back(hindrax: Vehicle) -> None:
    station = StationKeeping(hindrax)
    station.start(hover("x"))
    first, *_, last = (station.step(hover("x", -0.5), 0.02, held_back=True) for _ in range(500))
    assert last == first
    assert station.step(hover("x", -0.5), 0.02)[0] > last[0]


def test_a_velocity_that_was_integrated_for_too_long_asks_for_nothing(hindrax: Vehicle) -> None:
    """As one that is unknown: the vehicle drifts until it is measured again, and stays there."""
    station, most_mps = StationKeeping(hindrax), StationKeepingKnobs().unsure_mps
    station.start(hover("x"))
    moving = hover("x", speed_mps=0.4)
    assert station.step(replace(moving, speed_sigma_mps=most_mps), 0.02)[0] < 0.0
    assert station.step(replace(moving, speed_sigma_mps=1.01 * most_mps), 0.02) == (0.0, 0.0)
    station.step(hover("x", 2.0), 0.02)
    assert station.goal_m == (7.0, 3.0)
