"""Plans: they fit the pool, the limits and the thrusters, and say why when nothing does."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.plan import MOTIONS, Plan, PlanKnobs, Planner, stopping
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Limits, Pool, Vehicle


@pytest.fixture(scope="module")
def allocator(hindrax: Vehicle) -> Allocator:
    return Allocator(hindrax)


def planned(
    vehicle: Vehicle,
    allocator: Allocator,
    motion: str,
    knobs: PlanKnobs | None = None,
    disabled: frozenset[Any] = frozenset(),
) -> tuple[Planner, Plan]:
    planner = Planner(vehicle, allocator, knobs or PlanKnobs(), disabled)
    return planner, planner.plan(motion, PoolBounds(vehicle, 0.0))


def test_surge_begins_with_the_fastest_plateau_of_the_paper_and_the_slowest(
    hindrax: Vehicle, allocator: Allocator
) -> None:
    _, plan = planned(hindrax, allocator, "surge", PlanKnobs(levels=4))
    # COB-2023-1394 section 5 and Table 3: plateaus up to 0.45 m/s, where surge takes 13.8 N plus the linear part.
    assert plan.rates == pytest.approx((0.45, 0.1, 0.1 + 0.35 / 3.0, 0.1 + 0.7 / 3.0))
    assert plan.legs[0].level == pytest.approx(66.48 * 0.45**2 + 1.25 * 0.45)


def test_all_motions_take_less_than_six_minutes_with_the_ways_between(hindrax: Vehicle, allocator: Allocator) -> None:
    assert sum(planned(hindrax, allocator, motion)[1].seconds for motion in MOTIONS) < 330.0


@pytest.mark.parametrize("motion", MOTIONS)
def test_legs_go_both_ways_with_equal_rates(hindrax: Vehicle, allocator: Allocator, motion: str) -> None:
    _, plan = planned(hindrax, allocator, motion)
    out, back = plan.legs[::2], plan.legs[1::2]
    assert [leg.rate for leg in out] == pytest.approx([-leg.rate for leg in back])
    assert all(leg.sign * leg.level > 0.0 for leg in plan.legs)
    assert all((leg.end - leg.start) * leg.sign > 0.0 for leg in plan.legs)
    assert all(
        one.end == pytest.approx(other.start)
        for one, other in zip(plan.legs, plan.legs[1:], strict=False)
        if other.start != plan.legs[0].start
    )


@settings(max_examples=25, deadline=None)
@given(st.builds(Pool, st.floats(4.0, 40.0), st.floats(2.5, 20.0), st.floats(1.3, 10.0)), st.floats(0.2, 2.0))
def test_every_leg_stays_in_any_pool(hindrax: Vehicle, allocator: Allocator, pool: Pool, speed_mps: float) -> None:
    vehicle = replace(hindrax, pool=pool, limits=Limits(speed_mps=speed_mps))
    knobs = PlanKnobs()
    for motion, half_m in (("surge", 0.295), ("sway", 0.235)):
        _, plan = planned(vehicle, allocator, motion)
        for leg in plan.legs:
            assert half_m + knobs.wall_m - 1e-9 <= min(leg.start, leg.end)
            assert max(leg.start, leg.end) <= pool.length_m - half_m - knobs.wall_m + 1e-9
            assert abs(leg.rate) <= 0.8 * speed_mps + 1e-9
    _, plan = planned(vehicle, allocator, "heave")
    assert all(0.35 - 1e-9 <= leg.start <= pool.depth_m - 0.55 + 1e-9 for leg in plan.legs)


def test_forces_keep_a_reserve_for_the_other_axes(hindrax: Vehicle, allocator: Allocator) -> None:
    for motion in MOTIONS:
        planner, plan = planned(hindrax, allocator, motion)
        for leg in plan.legs:
            assert leg.boost <= planner.force_limit(motion, leg.sign) + 1e-9
            assert abs(leg.level) < leg.boost


def test_fewer_thrusters_make_slower_plans(hindrax: Vehicle, allocator: Allocator) -> None:
    _, whole = planned(hindrax, allocator, "surge", PlanKnobs(surge_mps=(0.1, 0.7)))
    _, less = planned(hindrax, allocator, "surge", PlanKnobs(surge_mps=(0.1, 0.7)), frozenset({"T3"}))
    assert less.rates[0] < whole.rates[0]
    with pytest.raises(UsageError, match=r"sway: without T3, T4 no thruster serves it .*; `\./hindrax thruster"):
        planned(hindrax, allocator, "sway", disabled=frozenset({"T3", "T4"}))


def test_tilt_stays_below_the_limit_of_the_vehicle(hindrax: Vehicle, allocator: Allocator) -> None:
    careful = replace(hindrax, limits=Limits(tilt_deg=20.0))
    _, plan = planned(careful, allocator, "roll")
    assert max(leg.end for leg in plan.legs) == pytest.approx(math.radians(17.0))
    _, plan = planned(hindrax, allocator, "pitch")
    assert max(leg.end for leg in plan.legs) == pytest.approx(math.radians(40.0))


def test_pool_without_room_is_refused(hindrax: Vehicle, allocator: Allocator) -> None:
    with pytest.raises(UsageError, match=r"surge: the pool leaves -0\.19 m of room"):
        planned(replace(hindrax, pool=Pool(length_m=2.0)), allocator, "surge")
    with pytest.raises(UsageError, match="motion 'loop': unknown, wanted one of surge"):
        planned(hindrax, allocator, "loop")


def test_repeats_repeat_the_whole_set(hindrax: Vehicle, allocator: Allocator) -> None:
    _, once = planned(hindrax, allocator, "surge")
    _, twice = planned(hindrax, allocator, "surge", PlanKnobs(repeats=(2, 1, 1, 1, 1, 1)))
    assert twice.rates == once.rates * 2


def test_levels_go_from_the_slowest_plateau_to_the_fastest(hindrax: Vehicle, allocator: Allocator) -> None:
    planner, _ = planned(hindrax, allocator, "surge")
    plan = planner.plan("surge", PoolBounds(hindrax, 0.0), (0.0, 1.0, 0.5, 1.0))
    assert plan.rates == pytest.approx((0.1, 0.45, 0.275, 0.45))


def test_one_level_is_the_fastest(hindrax: Vehicle, allocator: Allocator) -> None:
    _, plan = planned(hindrax, allocator, "yaw", PlanKnobs(turning_levels=1, repeats=(1,) * 6))
    assert [leg.rate for leg in plan.legs] == pytest.approx([1.2, -1.2])


def test_stopping_way() -> None:
    # 0.5 m/s, 0.25 s of lag, then 0.5 m/s^2: 0.125 + 0.25 m.
    assert stopping(-0.5, 0.5, 0.25) == pytest.approx(0.375)


def test_vehicle_without_hydrodynamics_gets_a_plan_too(hindrax: Vehicle) -> None:
    bare = replace(hindrax, hydrodynamics=None)
    allocator = Allocator(bare)
    for motion in MOTIONS:
        assert planned(bare, allocator, motion)[1].legs
