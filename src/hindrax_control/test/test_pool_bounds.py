"""Where the vehicle is in the pool: the start, the axes, the walls."""

import cmath
import contextlib
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.pool_bounds import PoolBounds, PoolBoundsKnobs, PoolPosition
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec3
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")


def navigation(
    position_m: tuple[float, float] = (0.0, 0.0), heading_rad: float = 0.0, velocity_mps: Vec3 = (0.0, 0.0, 0.0)
) -> Navigation:
    return Navigation((0.0, 0.0, heading_rad), (0.0, 0.0, 0.0), velocity_mps, 0.9, 0.9, position_m, dvl_locked=True)


def test_dead_reckoning_begins_in_the_middle_of_the_pool() -> None:
    box = PoolBounds(HINDRAX, 0.0)
    place = box.place(navigation())
    assert (place.x_m, place.y_m, place.heading_rad) == (5.0, 3.0, 0.0)
    # 10 x 6 m pool, 0.59 x 0.47 m vehicle.
    assert box.walls_m(place) == pytest.approx({"south": 4.705, "north": 4.705, "west": 2.765, "east": 2.765})


@given(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_pool_axes_turn_with_the_heading_at_the_start(heading_rad: float, ahead_m: float, aside_m: float) -> None:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    north_east = (cos * ahead_m - sin * aside_m, sin * ahead_m + cos * aside_m)
    place = PoolBounds(HINDRAX, heading_rad).place(navigation(north_east, heading_rad, (0.3, 0.1, 0.0)))
    assert (place.x_m, place.y_m) == pytest.approx((5.0 + ahead_m, 3.0 + aside_m))
    assert (place.vx_mps, place.vy_mps) == pytest.approx((0.3, 0.1))
    assert place.heading_rad == pytest.approx(0.0, abs=1e-9)


def test_vehicle_that_lies_across_the_pool_at_the_start() -> None:
    box = PoolBounds(HINDRAX, 1.0, PoolBoundsKnobs(start_along=0.1, start_across=0.5, start_turned_deg=90.0))
    place = box.place(navigation((math.cos(1.0), math.sin(1.0)), 1.0))  # one meter ahead
    assert (place.x_m, place.y_m, place.heading_rad) == pytest.approx((1.0, 4.0, math.pi / 2.0))
    assert box.walls_m(place)["south"] == pytest.approx(1.0 - 0.235)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_velocities_turn_with_the_heading(start_rad: float, heading_rad: float, u: float, v: float) -> None:
    place = PoolBounds(HINDRAX, start_rad).place(navigation((0.0, 0.0), heading_rad, (u, v, 0.4)))
    turned = complex(u, v) * cmath.exp(1j * (heading_rad - start_rad))
    assert (place.vx_mps, place.vy_mps) == pytest.approx((turned.real, turned.imag), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5) | st.just(math.nan), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_after_it_was_given_a_place_it_counts_from_there(
    heading_rad: float, turned_rad: float, ahead_m: float, aside_m: float
) -> None:
    box = PoolBounds(HINDRAX, 0.5)
    box.recentre(navigation((7.0, -9.0), heading_rad), 4.0, 2.0, turned_rad)
    axis_rad = 0.5 if math.isnan(turned_rad) else heading_rad - turned_rad
    cos, sin = math.cos(axis_rad), math.sin(axis_rad)
    there = (7.0 + cos * ahead_m - sin * aside_m, -9.0 + sin * ahead_m + cos * aside_m)
    place = box.place(navigation(there, heading_rad))
    assert (place.x_m, place.y_m) == pytest.approx((4.0 + ahead_m, 2.0 + aside_m))
    assert math.remainder(place.heading_rad - (heading_rad - axis_rad), math.tau) == pytest.approx(0.0, abs=1e-9)


def test_the_uncertainty_of_a_place_is_that_of_its_source_and_of_the_way_since() -> None:
    box = PoolBounds(HINDRAX, 0.0)
    assert box.place(replace(navigation(), position_sigma_m=2.0)).sigma_m == pytest.approx(math.hypot(0.1, 2.0))
    assert box.place(replace(navigation(), position_sigma_m=0.5)).sigma_m == pytest.approx(math.hypot(0.1, 0.5))
    box.recentre(replace(navigation(), position_sigma_m=0.3), 4.0, 2.0, 0.0)
    assert box.place(replace(navigation(), position_sigma_m=0.3)).sigma_m == pytest.approx(0.1)
    assert box.place(replace(navigation(), position_sigma_m=0.5)).sigma_m == pytest.approx(math.hypot(0.1, 0.4))
    box.recentre(replace(navigation(), position_sigma_m=math.inf), 4.0, 2.0, 0.0)
    assert box.place(replace(navigation(), position_sigma_m=math.inf)).sigma_m == math.inf
    assert box.place(replace(navigation(), position_sigma_m=2.0)).sigma_m == pytest.approx(math.hypot(0.1, 2.0))
    box.recentre(replace(navigation(), position_sigma_m=0.3), 4.0, 2.0, 0.0)
    # A navigator that began anew says less than before, and counts from there.
    assert box.place(replace(navigation(), position_sigma_m=0.2)).sigma_m == pytest.approx(math.hypot(0.1, 0.2))
    assert box.place(replace(navigation(), position_sigma_m=0.5)).sigma_m == pytest.approx(math.hypot(0.1, 0.5))


@pytest.mark.parametrize(
    ("x_m", "y_m", "turned_rad", "words"),
    [
        (0.29, 3.0, 0.0, "x: found 0.29 m, wanted 0.29"),
        (9.71, 3.0, 0.0, r"x: found 9.71 m, wanted 0.\d\d to 9.7\d m, the hull within the pool"),
        (5.0, 0.23, 0.0, "y: found 0.23 m"),
        (5.0, 5.77, 0.0, "y: found 5.77 m"),
        (0.29, 3.0, math.pi / 2.0, ""),
        (5.0, 0.23, math.pi / 2.0, "y: found 0.23 m"),
        (5.0, 3.0, 6.3, "heading: found 361 deg"),
        (5.0, 3.0, -6.28, ""),
    ],
)
def test_a_place_outside_of_the_pool_is_refused(x_m: float, y_m: float, turned_rad: float, words: str) -> None:
    with pytest.raises(UsageError, match=words) if words else contextlib.nullcontext():
        PoolBounds(HINDRAX, 0.0).recentre(navigation(), x_m, y_m, turned_rad)


@given(st.floats(-7.0, 7.0))
def test_the_hull_reaches_as_far_whichever_way_it_is_turned(heading_rad: float) -> None:
    """The corners of a rectangle, turned: the farthest of them is what must clear the wall."""
    box = PoolBounds(HINDRAX, 0.0)
    corners = [
        complex(ahead * 0.295, aside * 0.235) * cmath.exp(1j * heading_rad) for ahead in (-1, 1) for aside in (-1, 1)
    ]
    wanted = max(one.real for one in corners), max(one.imag for one in corners)
    assert box.reach_m(heading_rad) == pytest.approx(wanted)
    place = box.place(navigation((0.0, 0.0), heading_rad))
    walls = box.walls_m(place)
    assert walls == pytest.approx(
        dict.fromkeys(("south", "north"), 5.0 - wanted[0]) | dict.fromkeys(("west", "east"), 3.0 - wanted[1])
    )


def test_wall_ahead_is_the_one_the_vehicle_moves_towards() -> None:
    box = PoolBounds(HINDRAX, 0.0)
    for velocity, expected in (
        ((0.3, 0.0, 0.0), 2.705),
        ((-0.3, 0.0, 0.0), 6.705),
        ((0.1, 0.2, 0.0), 2.765),
        ((0.0, -0.2, 0.0), 2.765),
        ((0.0, 0.0, 0.0), 2.705),
        ((math.nan, math.nan, 0.0), 2.705),
    ):
        assert box.ahead_m(box.place(navigation((2.0, 0.0), 0.0, velocity))) == pytest.approx(expected)
    for aside_mps, expected in ((0.2, 1.765), (-0.2, 3.765)):
        assert box.ahead_m(box.place(navigation((2.0, 1.0), 0.0, (0.1, aside_mps, 0.0)))) == pytest.approx(expected)
    assert math.isnan(box.ahead_m(box.place(navigation((math.nan, 0.0)))))


def test_a_place_is_judged_by_the_heading_from_the_length_of_the_pool() -> None:
    PoolBounds(HINDRAX, 0.5).recentre(navigation((0.0, 0.0), 0.5), 5.0, 0.3, math.nan)
    with pytest.raises(UsageError, match=r"y: found 0.3 m, wanted 0.3\d to"):
        PoolBounds(HINDRAX, 0.0).recentre(navigation((0.0, 0.0), 1.0), 5.0, 0.3, math.nan)


@pytest.mark.parametrize("locked", [True, False])
@pytest.mark.parametrize(
    ("sigmas_mps", "worst_mps"), [((0.1, 0.3), 0.3), ((math.nan, 0.2), 0.2), ((math.nan,) * 2, 0.0)]
)
def test_a_velocity_has_its_uncertainty_while_nothing_measures_it(
    sigmas_mps: tuple[float, float], worst_mps: float, *, locked: bool
) -> None:
    found = replace(navigation(), velocity_sigma_mps=(*sigmas_mps, 9.0), dvl_locked=locked)
    assert PoolBounds(HINDRAX, 0.0).place(found).speed_sigma_mps == (0.0 if locked else worst_mps)


@pytest.mark.parametrize("seen", [(True, True), (True, False), (False, True), (False, False)])
def test_a_way_in_the_pool_is_along_surge_and_sway_where_they_are_measured(seen: tuple[bool, bool]) -> None:
    place = PoolPosition(4.0, 2.0, 0.7, 0.0, 0.0, seen=seen)
    way = complex(1.3, -0.6) * cmath.exp(-0.7j)
    along_aside = (way.real * seen[0], way.imag * seen[1])
    assert place.body(1.3, -0.6) == pytest.approx(along_aside)
    assert place.off_m(5.3, 1.4) == pytest.approx(math.hypot(*along_aside))
    assert PoolPosition(4.0, 2.0, 0.7, 0.0, 0.0).body(1.3, -0.6) == pytest.approx((way.real, way.imag))


@pytest.mark.parametrize(
    ("velocity", "found", "seen"),
    [
        ((0.3, 0.1, 0.0), (0.3, 0.1), (True, True)),
        ((0.3, math.nan, 0.0), (0.3, 0.0), (True, False)),
        ((math.nan, 0.1, 0.0), (0.0, 0.1), (False, True)),
        ((math.nan, math.nan, 0.0), (math.nan, math.nan), (True, True)),
    ],
)
def test_of_one_velocity_that_is_measured_the_other_is_zero_and_of_none_both_are_unknown(
    velocity: Vec3, found: tuple[float, float], seen: tuple[bool, bool]
) -> None:
    place = PoolBounds(HINDRAX, 0.0).place(navigation((0.0, 0.0), 0.0, velocity))
    assert (place.vx_mps, place.vy_mps) == pytest.approx(found, nan_ok=True)
    assert place.seen == seen
