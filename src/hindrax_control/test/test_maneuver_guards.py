"""Every guard: silent when all is well, and a sentence of its own when not."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from scipy.optimize import brentq

from hindrax_control.maneuver.maneuver_guards import (
    BLOCKED_PHASE_S,
    ManeuverGuardKnobs,
    ManeuverGuards,
    Situation,
    walls_after_braking_m,
)
from hindrax_control.maneuver.plan import LAG_S
from hindrax_control.pool_bounds import GuardedPlace, PoolBounds, PoolPosition
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.readings import Vec3
from hindrax_core.signals import Navigation
from hindrax_core.text.refusals import AIDING, Reason
from hindrax_core.vehicle import Mount, Vehicle

WELL = Navigation(
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    (0.1, 0.0, 0.0),
    0.9,
    0.9,
    (0.0, 0.0),
    dvl_locked=True,
    ages_s={"icm20948": 0.005, "ms5837": 0.02, "ping1d": 0.05, "dvl75": 0.05},
    depth_age_s=0.02,
    altitude_age_s=0.05,
)


@pytest.fixture
def look(hindrax: Vehicle) -> Callable[..., tuple[str, ...]]:
    safety, box = ManeuverGuards(hindrax), PoolBounds(hindrax, 0.0)

    def at(navigation: Navigation, time_s: float = 0.0, **situation: Any) -> tuple[str, ...]:
        place = box.place(navigation)
        return safety.step(Situation(navigation, place, box.walls_m(place), time_s, **situation))

    return at


def test_nothing_is_wrong_when_all_is_well(look: Callable[..., tuple[str, ...]]) -> None:
    assert look(WELL) == ()
    assert Situation(WELL, None, {}, 0.0).thrust_N == (0.0, 0.0)
    assert look(WELL, battery_V=15.0, deadline_s=100.0, needed_axes=("surge",)) == ()


def test_a_vehicle_whose_place_nobody_knows_is_not_flown_by_the_walls(look: Callable[..., tuple[str, ...]]) -> None:
    (found,) = look(WELL, unplaced="the pilot had been started again, wanted a known position in the pool")
    assert found.startswith("pool_box: the pilot had been started again, wanted a known position in the pool")


BLOCKED = replace(WELL, velocity_mps=(0.01, 0.0, 0.0))


def test_thrust_without_motion_is_blocked_after_a_while(look: Callable[..., tuple[str, ...]]) -> None:
    assert look(BLOCKED, 0.0, thrust_N=(18.0, 0.0)) == ()
    (found,) = look(BLOCKED, 5.0, thrust_N=(18.0, 0.0))
    assert found.startswith("blocked: 18 N of surge move it at 0.01 m/s, wanted 0.")


def test_blocked_is_a_phase_before_it_is_a_reason_to_stop(hindrax: Vehicle) -> None:
    safety = ManeuverGuards(hindrax)
    assert not safety.is_blocked(100.0)
    assert safety.step(Situation(BLOCKED, None, {}, 100.0, thrust_N=(18.0, 0.0))) == ()
    assert not safety.is_blocked(100.0 + 0.99 * BLOCKED_PHASE_S)
    assert safety.is_blocked(100.0 + 1.01 * BLOCKED_PHASE_S)
    assert safety.step(Situation(WELL, None, {}, 102.0)) == ()
    assert not safety.is_blocked(103.0)


@pytest.mark.parametrize(
    ("velocity", "thrust"),
    [
        ((0.3, 0.0, 0.0), (18.0, 0.0)),  # it moves
        ((-0.3, 0.0, 0.0), (18.0, 0.0)),  # it brakes
        ((0.0, 0.0, 0.0), (0.0, 2.0)),  # it stands against a current
        ((math.nan, math.nan, 0.0), (18.0, 0.0)),  # nobody knows; the lock has a guard of its own
    ],
)
def test_motion_braking_and_a_current_are_not_blocked(
    look: Callable[..., tuple[str, ...]], velocity: Vec3, thrust: tuple[float, float]
) -> None:
    seen = [look(replace(WELL, velocity_mps=velocity), time_s, thrust_N=thrust) for time_s in (0.0, 6.0)]
    assert seen == [(), ()]


@pytest.mark.parametrize(("axis", "at"), [("surge", 0), ("sway", 1)])
def test_blocked_is_a_quarter_of_a_speed_that_no_current_has(hindrax: Vehicle, axis: str, at: int) -> None:
    freedom = prior_dynamics(hindrax)[axis]

    def is_blocked(expected_mps: float, share: float) -> bool:
        force_N = brentq(lambda force: freedom.rate_at(force) - expected_mps, 0.0, 500.0)
        safety, seen = ManeuverGuards(hindrax), replace(WELL, velocity_mps=on(at, share * expected_mps))
        thrust = on(at, force_N)[:2]
        safety.step(Situation(seen, None, {}, 0.0, thrust_N=thrust))
        return any(one.startswith("blocked") for one in safety.step(Situation(seen, None, {}, 6.0, thrust_N=thrust)))

    assert is_blocked(0.5, 0.24)
    assert not is_blocked(0.5, 0.26)
    assert is_blocked(0.21, 0.0)
    assert not is_blocked(0.19, 0.0)


def on(axis: int, value: float) -> Vec3:
    return (value, 0.0, 0.0) if axis == 0 else (0.0, value, 0.0)


WALLS = {"north": (1.0, 0.0), "south": (-1.0, 0.0), "east": (0.0, 1.0), "west": (0.0, -1.0)}


@pytest.mark.parametrize("wall", WALLS)
def test_braking_takes_its_way_ahead_only_and_none_at_a_speed_that_nobody_knows(wall: str) -> None:
    knobs, walls_m = ManeuverGuardKnobs(), dict.fromkeys(WALLS, 2.0)
    north, east = WALLS[wall]
    way_m = 0.5 * LAG_S + 0.5 * 0.5**2 / knobs.braking_mps2
    found = walls_after_braking_m(PoolPosition(0.0, 0.0, 0.0, 0.5 * north, 0.5 * east), walls_m, knobs)
    assert found == pytest.approx(walls_m | {wall: 2.0 - way_m})
    assert walls_after_braking_m(PoolPosition(0.0, 0.0, 0.0, math.nan, math.nan), walls_m, knobs) == walls_m


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"position_m": (4.5, 0.0)}, "pool_box: 0.17 m to the north wall after braking, wanted 0.30 m"),
        ({"position_m": (-4.6, 0.0), "velocity_mps": (0.0, 0.0, 0.0)}, "pool_box: 0.11 m to the south wall"),
        ({"position_m": (0.0, 2.6), "velocity_mps": (0.0, 0.0, 0.0)}, "pool_box: 0.17 m to the east wall"),
        (
            {"position_m": (2.5, 0.0), "velocity_mps": (0.0, 0.0, 0.0), "position_sigma_m": 1.0},
            "pool_box: 2.21 m to the north wall after braking, wanted 0.30 m and 2.01 m uncertainty; bring it",
        ),
        ({"position_sigma_m": math.inf}, "pool_box: "),
        ({"depth_m": 61.0}, "depth_band: 61.00 m deep, wanted at most 60.00 m"),
        ({"depth_m": -0.2}, "depth_band: -0.40 m of water above the hull"),
        ({"altitude_m": 0.3}, "altitude_band: 0.10 m of water under the hull, wanted 0.15 m"),
    ],
)
def test_guards_that_act_at_once(
    look: Callable[..., tuple[str, ...]],
    change: dict[str, Any],
    sentence: str,
) -> None:
    found = look(replace(WELL, **change))
    assert len(found) == 1
    assert found[0].startswith(sentence)


@pytest.mark.parametrize(
    ("sigma_m", "wanted_m", "words"),
    [
        (math.nan, 0.3, "0.30 m"),
        (0.002, 0.304, "0.30 m"),
        (0.5, 1.3, "0.30 m and 1.00 m uncertainty"),
    ],
)
def test_walls_are_nearer_by_the_doubt_of_the_position_and_a_tiny_one_is_not_worth_a_word(
    hindrax: Vehicle, sigma_m: float, wanted_m: float, words: str
) -> None:
    place = PoolPosition(0.0, 0.0, 0.0, 0.0, 0.0, sigma_m)
    margin_m, text = ManeuverGuards(hindrax).margin(place)
    assert margin_m == pytest.approx(wanted_m)
    assert text == words


def test_a_place_is_shown_as_the_guard_of_the_walls_sees_it(hindrax: Vehicle) -> None:
    knobs, place = ManeuverGuardKnobs(), PoolPosition(0.0, 0.0, 0.0, 0.4, 0.0, 0.5)
    shown = ManeuverGuards(hindrax).guarded(place, dict.fromkeys(WALLS, 2.0), "nobody knows")
    assert shown == GuardedPlace(
        place, walls_after_braking_m(place, dict.fromkeys(WALLS, 2.0), knobs), 0.3 + 2.0 * 0.5, "nobody knows"
    )


def test_fast_vehicle_is_stopped_earlier_than_a_slow_one(look: Callable[..., tuple[str, ...]]) -> None:
    at = replace(WELL, position_m=(3.8, 0.0))
    assert look(replace(at, velocity_mps=(0.2, 0.0, 0.0))) == ()
    assert look(replace(at, velocity_mps=(0.6, 0.0, 0.0)))[0].startswith("pool_box")
    assert look(replace(at, velocity_mps=(-0.6, 0.0, 0.0))) == ()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"attitude_rad": (1.1, 0.0, 0.0)}, "attitude: tilted by 63 deg, wanted at most 55 deg"),
        ({"attitude_rad": (0.0, -1.1, 0.0)}, "attitude: tilted by 63 deg, wanted at most 55 deg"),
        ({"attitude_rad": (0.0, 0.0, math.nan)}, "attitude: unknown"),
        ({"velocity_mps": (1.0, 0.0, 0.08)}, "speed: 1.003 m/s, wanted at most 1.000 m/s"),
        ({"velocity_mps": (0.9, 0.0, 0.6)}, "speed: 1.08 m/s, wanted at most 1.00 m/s"),
        ({"ages_s": {"icm20948": 0.5}}, "sensor_age: rates from icm20948 received 0.50 s ago"),
        ({"depth_age_s": math.inf}, "sensor_age: depth from ms5837 received never, wanted at most 1.00 s"),
        ({"depth_m": math.nan}, "sensor_age: depth unknown"),
    ],
)
def test_guards_that_wait_until_it_lasts(
    look: Callable[..., tuple[str, ...]], change: dict[str, Any], sentence: str
) -> None:
    wrong = replace(WELL, **change)
    assert look(wrong, 10.0) == ()
    assert look(WELL, 10.2) == ()  # a flicker is forgotten
    assert look(wrong, 10.3) == ()
    assert look(wrong, 10.7)[0].startswith(sentence)


def test_lost_lock_is_survived_for_a_while(look: Callable[..., tuple[str, ...]]) -> None:
    blind = replace(WELL, dvl_locked=False)
    assert [look(blind, 10.0 + t) for t in (0.0, 1.0, 3.0, 4.9)] == [(), (), (), ()]
    (found,) = look(blind, 15.0)
    assert found.startswith("dvl_lock: no bottom lock for 5.0 s, wanted less than 5.0 s; give the DVL more water")


def test_a_lost_velocity_of_the_autopilot_sends_nobody_to_a_dvl_that_is_not_there(hindrax: Vehicle) -> None:
    sensors = {"autopilot": Mount("ardusub"), "estimator": Mount("ardusub_ekf")}
    vehicle = replace(hindrax, sensors=sensors, output=replace(hindrax.output, device="ardusub"))
    guards = ManeuverGuards(vehicle)
    blind = replace(WELL, dvl_locked=False, ages_s={"autopilot": 0.01}, depth_age_s=0.01)
    guards.step(Situation(blind, None, {}, 0.0))
    (found,) = (one for one in guards.step(Situation(blind, None, {}, 6.0)) if one.reason == Reason.DVL_LOCK)
    assert found.startswith(
        "dvl_lock: the autopilot's estimator claims no velocity for 6.0 s, wanted less than 5.0 s; "
    )
    assert found.endswith(AIDING)


def test_a_depth_that_the_autopilot_does_not_give_is_told_with_its_barometer(hindrax: Vehicle) -> None:
    sensors = {"fcu": Mount("ardusub")}
    guards = ManeuverGuards(replace(hindrax, sensors=sensors, output=replace(hindrax.output, device="ardusub")))
    deep = replace(WELL, ages_s={"fcu": 0.01}, depth_age_s=math.inf)
    guards.step(Situation(deep, None, {}, 0.0))
    (found,) = guards.step(Situation(deep, None, {}, 1.0))
    assert found.startswith("sensor_age: depth from fcu received never, wanted at most 1.00 s; check the autopilot")
    assert found.endswith("; that of a SITL is the first, which `--set fcu.barometer:=1` takes")


def test_samples_that_the_autopilot_does_not_give_send_nobody_to_its_barometer(hindrax: Vehicle) -> None:
    sensors = {"fcu": Mount("ardusub")}
    guards = ManeuverGuards(replace(hindrax, sensors=sensors, output=replace(hindrax.output, device="ardusub")))
    late = replace(WELL, ages_s={"fcu": 0.31}, depth_age_s=0.1)
    guards.step(Situation(late, None, {}, 0.0))
    (found,) = guards.step(Situation(late, None, {}, 1.0))
    assert found == (
        "sensor_age: rates from fcu received 0.31 s ago, wanted at most 0.20 s; "
        "check the sensor (`./hindrax doctor`), then fly again"
    )


def test_battery_leak_time_and_thrusters(look: Callable[..., tuple[str, ...]]) -> None:
    assert look(WELL, battery_V=12.4) == ()
    assert look(WELL, 2.0, battery_V=12.4) == ("battery: 12.4 V, wanted at least 13.0 V; charge the battery",)
    assert look(WELL, water_in_hull=True)[0].startswith("leak: found water in the hull, wanted it dry; surface")
    assert look(WELL, 110.0, deadline_s=100.0)[0].startswith("time_out: 10 s later than it should long be over; find")
    assert look(WELL, lost_axes=("sway",), needed_axes=("surge", "heave")) == ()
    assert look(WELL, lost_axes=("sway",), needed_axes=("sway",))[0].startswith("thrusters: sway cannot be served")
    twice = look(WELL, lost_axes=("heave",), needed_axes=("heave", "heave"))[0]
    assert twice.startswith("thrusters: heave cannot be served")


def test_one_low_sample_of_the_battery_ends_nothing(look: Callable[..., tuple[str, ...]]) -> None:
    """A boost pulls the voltage down for a moment, and a monitor may be wrong once."""
    assert look(WELL, 0.0, battery_V=11.0) == ()
    assert look(WELL, 1.0, battery_V=15.0) == ()
    assert look(WELL, 2.5, battery_V=11.0) == ()
    assert look(WELL, 4.5, battery_V=11.0)[0].startswith("battery: 11.0 V")


def test_vehicle_without_those_sensors_is_not_asked_for_them(hindrax: Vehicle) -> None:
    bare = ManeuverGuards(replace(hindrax, sensors={}))
    assert bare.step(Situation(replace(WELL, ages_s={}, dvl_locked=False), None, {}, 0.0)) == ()


def test_a_limit_itself_is_still_well_and_a_bit_beyond_is_not(hindrax: Vehicle) -> None:
    knobs, half_m = ManeuverGuardKnobs(), 0.5 * hindrax.envelope_m[2]
    tiny = 1e-6

    def found(navigation: Navigation = WELL, /, **situation: Any) -> tuple[str, ...]:
        guards = ManeuverGuards(hindrax, replace(knobs, patience_s=0.0, battery_s=0.0, unlocked_s=0.1))
        walls_m: dict[str, float] = {"north": situation.pop("north_m", 5.0)}
        place = PoolPosition(0.0, 0.0, 0.0, 0.0, 0.0)
        return guards.step(Situation(navigation, place, walls_m, 10.0, **situation))

    limits, tilt = hindrax.limits, math.radians(hindrax.limits.tilt_deg)
    for well, wrong in (
        ({"north_m": knobs.wall_m}, {"north_m": knobs.wall_m - tiny}),
        ({"battery_V": limits.battery_V}, {"battery_V": limits.battery_V - tiny}),
        ({"deadline_s": 10.0}, {"deadline_s": 10.0 - tiny}),
    ):
        assert found(**well) == ()
        assert len(found(**wrong)) == 1
    ages = {"icm20948": knobs.inertial_age_s}
    for change, beyond in (
        ({"depth_m": hindrax.depth_rating_m}, {"depth_m": hindrax.depth_rating_m + tiny}),
        ({"depth_m": knobs.surface_m + half_m + tiny}, {"depth_m": knobs.surface_m + half_m - tiny}),
        ({"altitude_m": knobs.floor_m + half_m + tiny}, {"altitude_m": knobs.floor_m + half_m - tiny}),
        ({"attitude_rad": (tilt - tiny, 0.0, 0.0)}, {"attitude_rad": (-tilt - tiny, 0.0, 0.0)}),
        ({"attitude_rad": (0.0, -tilt + tiny, 0.0)}, {"attitude_rad": (0.0, tilt + tiny, 0.0)}),
        ({"velocity_mps": (0.0, limits.speed_mps, math.nan)}, {"velocity_mps": (0.0, limits.speed_mps + tiny, 0.0)}),
        ({"ages_s": ages}, {"ages_s": ages | {"icm20948": knobs.inertial_age_s + tiny}}),
        ({"depth_age_s": knobs.depth_age_s}, {"depth_age_s": knobs.depth_age_s + tiny}),
    ):
        assert found(replace(WELL, **change)) == ()
        assert len(found(replace(WELL, **beyond))) == 1


def test_a_place_that_nobody_knows_and_an_unknown_height_say_nothing(hindrax: Vehicle) -> None:
    guards, walls_m = ManeuverGuards(hindrax), {"north": 0.0}
    for place in (PoolPosition(math.nan, 0.0, 0.0, 0.0, 0.0), PoolPosition(0.0, 0.0, math.inf, 0.0, 0.0), None):
        assert guards.step(Situation(WELL, place, walls_m, 0.0)) == ()
    assert guards.step(Situation(replace(WELL, altitude_m=math.nan), None, {}, 0.0)) == ()


def test_what_lasts_counts_from_its_own_beginning(look: Callable[..., tuple[str, ...]]) -> None:
    tilted = replace(WELL, attitude_rad=(1.1, 0.0, 0.0))
    both = replace(tilted, velocity_mps=(0.0, 0.0, 2.0))
    assert look(tilted, 10.0) == ()
    assert [one.partition(":")[0] for one in look(both, 10.3)] == ["attitude"]
    assert [one.partition(":")[0] for one in look(both, 10.7)] == ["attitude", "speed"]
