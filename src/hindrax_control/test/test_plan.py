"""Plans: they fit the pool, the limits and the thrusters, and say why when nothing does."""

import math
import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.goal import ALONG
from hindrax_control.maneuver.leg import LegController
from hindrax_control.maneuver.plan import LEVEL_SHARE, Leg, Plan, PlanKnobs, Planner, motion_name, stopping
from hindrax_control.pool_bounds import PoolBounds
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, Limits, Pool, Vehicle


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
    assert sum(planned(hindrax, allocator, motion)[1].seconds for motion in AXES) < 330.0


@pytest.mark.parametrize("motion", AXES)
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
    greedy = PlanKnobs(surge_mps=(0.1, 3.0), sway_mps=(0.1, 3.0), heave_mps=(0.1, 3.0), yaw_radps=(0.4, 3.0))
    fast = replace(hindrax, limits=Limits(speed_mps=5.0))
    for knobs, vehicle in ((PlanKnobs(), hindrax), (greedy, fast)):
        for motion in AXES:
            planner, plan = planned(vehicle, allocator, motion, knobs)
            for leg in plan.legs:
                assert leg.boost <= planner.force_limit(motion, leg.sign) + 1e-9
                assert abs(leg.level) < 0.95 * planner.force_limit(motion, leg.sign)
                assert abs(leg.level) < leg.boost


@pytest.mark.parametrize("motion", AXES)
def test_a_motion_begins_where_its_first_leg_does_and_ends_where_its_last_does(
    hindrax: Vehicle, allocator: Allocator, motion: str
) -> None:
    knobs, pool = PlanKnobs(), hindrax.pool
    _, plan = planned(hindrax, allocator, motion)
    middle_m = 0.5 * pool.length_m
    assert plan.start_m == (plan.legs[0].start if motion in ALONG else middle_m, 0.5 * pool.width_m)
    assert plan.end_m == (plan.legs[-1].end if motion in ALONG else middle_m, 0.5 * pool.width_m)
    assert plan.heading_rad == (-math.pi / 2.0 if motion == "sway" else 0.0)
    assert plan.vertical == (("depth", plan.legs[0].start) if motion == "heave" else ("altitude", knobs.altitude_m))
    assert plan.hover_s == (knobs.hover_s if motion == "heave" else 0.0)


@pytest.mark.parametrize(("motion", "half_m"), [("surge", 0.295), ("sway", 0.235)])
def test_long_plateaus_take_the_whole_pool_but_the_margin_of_the_hull(
    hindrax: Vehicle, allocator: Allocator, motion: str, half_m: float
) -> None:
    knobs = PlanKnobs(plateau_s=120.0)
    _, plan = planned(hindrax, allocator, motion, knobs)
    margin_m = half_m + knobs.wall_m
    assert (plan.legs[0].start, plan.legs[0].end) == pytest.approx((margin_m, hindrax.pool.length_m - margin_m))


def flown_s(leg: Leg, freedom: PriorDynamics) -> tuple[float, float]:
    """Time that a leg takes on the vehicle of the prior, and time at its force [s]."""
    driver, step_s = LegController(leg), 0.02
    at, rate, thrust, time_s, plateau_s = leg.start, 0.0, 0.0, 0.0, 0.0
    while not (output := driver.step(at, rate, time_s)).finished:
        plateau_s += step_s if output.force == leg.level else 0.0
        thrust += (output.force - thrust) * (1.0 - math.exp(-step_s / 0.15))
        rate += (thrust - freedom.drag_force(rate)) / freedom.inertia * step_s
        at += rate * step_s
        time_s += step_s
    return time_s, plateau_s


@pytest.mark.parametrize("motion", ["surge", "sway", "heave", "yaw"])
def test_legs_take_as_long_as_planned(hindrax: Vehicle, allocator: Allocator, motion: str) -> None:
    planner, plan = planned(hindrax, allocator, motion)
    for leg in plan.legs:
        assert flown_s(leg, planner.freedoms[motion])[0] == pytest.approx(leg.seconds, rel=0.06)


@pytest.mark.parametrize("motion", ALONG)
def test_legs_along_the_pool_are_as_long_as_their_plateau_needs(
    hindrax: Vehicle, allocator: Allocator, motion: str
) -> None:
    knobs = PlanKnobs()
    planner, plan = planned(hindrax, allocator, motion, knobs)
    for leg in plan.legs[::2]:
        _, plateau_s = flown_s(leg, planner.freedoms[motion])
        assert knobs.plateau_s < plateau_s < 1.3 * knobs.plateau_s


BOOSTS_S = {"surge": 1.2, "sway": 1.2, "heave": 0.8, "roll": 0.25, "pitch": 0.3, "yaw": 0.8}


@pytest.mark.parametrize("motion", AXES)
def test_a_boost_gets_up_to_speed_in_its_time_and_every_leg_ends_with_a_coast_or_a_swing_on_the_way_back(
    hindrax: Vehicle, allocator: Allocator, motion: str
) -> None:
    planner, plan = planned(hindrax, allocator, motion)
    for leg in plan.legs:
        assert leg.boost < planner.force_limit(motion, leg.sign)
        assert leg.pace == pytest.approx(max(abs(leg.rate) / BOOSTS_S[motion], 0.2))
        if motion not in ("roll", "pitch"):
            assert (leg.coast_s, leg.natural_radps) == (PlanKnobs().coast_s, 0.0)
        elif leg.sign > 0.0:
            assert (leg.coast_s, leg.natural_radps) == (0.0, 0.0)
        else:
            freedom = planner.freedoms[motion]
            assert leg.natural_radps**2 * freedom.inertia == pytest.approx(freedom.restoring)
            # One period: the leg that follows has the whole room again.
            assert leg.coast_s == pytest.approx(math.tau / leg.natural_radps)


def test_without_a_swing_both_legs_of_an_angle_cross_the_whole_room(hindrax: Vehicle, allocator: Allocator) -> None:
    _, plan = planned(hindrax, allocator, "roll", PlanKnobs(swing_s=0.0))
    assert {(leg.coast_s, leg.natural_radps) for leg in plan.legs} == {(0.0, 0.0)}
    assert [leg.seconds for leg in plan.legs[::2]] == pytest.approx([leg.seconds for leg in plan.legs[1::2]])


@pytest.mark.parametrize(("arm_m", "coast_s"), [(-0.01, 0.0), (0.0, PlanKnobs().coast_s)])
def test_what_does_not_right_itself_does_not_swing_and_what_is_top_heavy_never_rests(
    hindrax: Vehicle, allocator: Allocator, arm_m: float, coast_s: float
) -> None:
    vehicle = replace(hindrax, center_of_mass_m=(0.0, 0.0, arm_m), center_of_buoyancy_m=(0.0, 0.0, 0.0))
    for motion in ("roll", "pitch"):
        _, plan = planned(vehicle, allocator, motion)
        assert {(leg.coast_s, leg.natural_radps) for leg in plan.legs} == {(coast_s, 0.0)}


@pytest.mark.parametrize("net_buoyancy_N", [25.0, -25.0])
def test_a_vehicle_that_is_not_neutral_swings_no_longer_than_it_takes_to_rise_or_sink_by_a_hand(
    hindrax: Vehicle, allocator: Allocator, net_buoyancy_N: float
) -> None:
    volume_m3 = hindrax.mass_kg / hindrax.water.density_kgpm3 + net_buoyancy_N / (9.80665 * hindrax.water.density_kgpm3)
    planner, plan = planned(replace(hindrax, volume_m3=volume_m3), allocator, "pitch")
    swing_s = plan.legs[1].coast_s
    acceleration = abs(planner.freedoms["heave"].bias) / planner.freedoms["heave"].inertia
    assert 0.5 * acceleration * swing_s**2 == pytest.approx(0.3)
    _, short = planned(hindrax, allocator, "pitch", PlanKnobs(swing_s=0.5))
    assert short.legs[1].coast_s == 0.5


def test_heave_is_two_motions_and_every_other_one() -> None:
    """COB-2023-1394, Table 3: drag down and drag up."""
    assert [motion_name("heave", rate_mps) for rate_mps in (0.1, -0.1)] == ["heave_down", "heave_up"]
    assert [motion_name("surge", rate_mps) for rate_mps in (0.1, -0.1)] == ["surge", "surge"]


@pytest.mark.parametrize(
    ("motion", "line"),
    [
        ("surge", r"surge: 0\.45, 0\.10, 0\.28 m/s, each out and back; \d+ s"),
        ("heave", r"heave: hover 8 s, then 0\.30, 0\.08, 0\.19 m/s, each out and back; \d+ s"),
        ("yaw", r"yaw: 1\.20, 0\.40 rad/s, each out and back; \d+ s"),
    ],
)
def test_a_plan_states_in_one_line_what_it_flies(
    hindrax: Vehicle, allocator: Allocator, motion: str, line: str
) -> None:
    _, plan = planned(hindrax, allocator, motion)
    assert re.fullmatch(line, str(plan))


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
    for motion, largest_deg in (("roll", 30.0), ("pitch", 40.0)):
        _, plan = planned(hindrax, allocator, motion)
        assert max(leg.end for leg in plan.legs) == pytest.approx(math.radians(largest_deg))


@pytest.mark.parametrize("altitude_m", [0.2, 1.6])
def test_an_altitude_at_which_the_hull_touches_floor_or_surface_can_be_flown(
    hindrax: Vehicle, allocator: Allocator, altitude_m: float
) -> None:
    planner = Planner(hindrax, allocator, PlanKnobs(altitude_m=altitude_m))
    assert planner.plan("yaw", PoolBounds(hindrax, 0.0)).vertical == ("altitude", altitude_m)


@pytest.mark.parametrize("altitude_m", [0.1, 1.7, 9.0])
def test_an_altitude_outside_of_the_pool_is_refused(hindrax: Vehicle, allocator: Allocator, altitude_m: float) -> None:
    planner = Planner(hindrax, allocator, PlanKnobs(altitude_m=altitude_m))
    wanted = rf"plan.altitude_m: found {altitude_m:g} m, wanted 0.20 to 1.60 m, the hull within the pool"
    with pytest.raises(UsageError, match=wanted):
        planner.plan("surge", PoolBounds(hindrax, 0.0))
    planner.plan("heave", PoolBounds(hindrax, 0.0))


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
    assert stopping(-0.5, 0.5) == pytest.approx(0.375)


def test_vehicle_without_hydrodynamics_gets_a_plan_too(hindrax: Vehicle) -> None:
    bare = replace(hindrax, hydrodynamics=None)
    allocator = Allocator(bare)
    for motion in AXES:
        assert planned(bare, allocator, motion)[1].legs


def test_a_boost_without_reserve_is_the_limit_and_makes_a_tenth_of_its_acceleration(
    hindrax: Vehicle, allocator: Allocator
) -> None:
    planner = Planner(hindrax, allocator, PlanKnobs())
    freedom = planner.freedoms["surge"]
    limit = planner.force_limit("surge", 1.0)
    boost, pace = planner._boost("surge", freedom, 3.0)  # its drag is far more than the limit
    assert boost == pytest.approx(limit)
    assert pace == pytest.approx(0.1 * limit / freedom.inertia)


def test_the_weaker_direction_states_how_fast_both_are_flown(
    hindrax: Vehicle, allocator: Allocator, monkeypatch: pytest.MonkeyPatch
) -> None:
    fastest = {}
    for weaker in (1.0, -1.0):
        limits = {weaker: 4.0, -weaker: 20.0}
        monkeypatch.setattr(Planner, "force_limit", lambda _self, _motion, sign, limits=limits: limits[sign])
        planner = Planner(hindrax, allocator, PlanKnobs())
        (fastest[weaker],) = planner._rates("surge", [1.0])
        assert fastest[weaker] == pytest.approx(planner.freedoms["surge"].rate_at(LEVEL_SHARE * 4.0))
    assert fastest[1.0] == fastest[-1.0]
