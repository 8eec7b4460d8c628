"""One leg on a vehicle whose thrust lags: it coasts, and brakes to rest, however strong and light the vehicle is."""

import math
import statistics
from collections import deque
from dataclasses import dataclass, replace
from itertools import groupby

import pytest

from hindrax_control.maneuver.leg import Easing, LegController, LegOutput
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs
from hindrax_control.maneuver.plan import CHARACTERS, EASED_FROM, LAG_S, SPEED_RESERVE, Leg

STEP_S = 0.05
DELAY_S = 0.2
MASS_kg, ADDED_kg, DRAG = 11.5, 5.5, 141.0
"""About a BlueROV2 Heavy in surge; drag in N per (m/s)^2."""
RATE_mps = 0.45


def leg(
    braking_mps2: float, sign: float = 1.0, *, coast_s: float = 0.0, drag: float = DRAG, axis: str = "surge"
) -> Leg:
    """Leg of 6 m along the pool; boost and brake take off `braking_mps2`, drag apart. `drag`: what is believed."""
    inertia = MASS_kg + ADDED_kg
    level = drag * RATE_mps * RATE_mps
    boost = braking_mps2 * inertia
    return Leg(
        axis=axis,
        name=axis,
        sign=sign,
        level=sign * level,
        rate=sign * RATE_mps,
        start=-3.0 * sign,
        end=3.0 * sign,
        back=-3.0 * sign,
        boost=boost,
        pace=max(boost - level, 0.1 * boost) / inertia,
        inertia=inertia,
        coast_s=coast_s,
        seconds=15.0,
    )


@dataclass
class End:
    """Speed when the leg was told to be over, and when the thrust of its last lag had come; the furthest place.

    `coasts`: times, forces and speeds of the coast. `speeds`: of all steps.
    """

    told_mps: float
    rest_mps: float
    furthest_m: float
    coasts: list[tuple[float, float, float]]
    speeds: list[float]


def flown(one: Leg, easing: Easing | None = None, drag: float = DRAG) -> End:
    """Fly a leg with thrust that comes a lag after it was asked for; no thrust is asked for after its end.

    `drag`: the true one.
    """
    driver, coming = LegController(one, easing), deque([0.0] * round(DELAY_S / STEP_S))
    x_m, v_mps, time_s, told_mps, furthest_m = one.start, 0.0, 0.0, math.nan, -math.inf
    rest_s = math.inf
    coasts: list[tuple[float, float, float]] = []
    speeds: list[float] = []
    while time_s < rest_s:
        if math.isnan(told_mps):
            output = driver.step(x_m, v_mps, time_s)
            if output.phase == "coast":
                coasts.append((time_s, output.force, v_mps * one.sign))
            if output.finished:
                told_mps, rest_s = v_mps, time_s + DELAY_S
        coming.append(output.force if math.isnan(told_mps) else 0.0)
        v_mps += (coming.popleft() - drag * abs(v_mps) * v_mps) / one.inertia * STEP_S
        speeds.append(v_mps * one.sign)
        x_m += v_mps * STEP_S
        furthest_m = max(furthest_m, x_m * one.sign)
        time_s += STEP_S
        assert time_s < 60.0
    return End(told_mps * one.sign, v_mps * one.sign, furthest_m, coasts, speeds)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("braking_mps2", [1.8, 2.1, 3.0, 5.0])
def test_a_strong_light_vehicle_brakes_to_rest_before_the_end(braking_mps2: float, sign: float) -> None:
    end = flown(leg(braking_mps2, sign))
    # Two steps of braking are as exact as it gets; drag, which is left out, brakes on.
    assert abs(end.rest_mps) <= max(0.5 * RATE_mps, 2.0 * STEP_S * braking_mps2)
    assert end.rest_mps < 0.1
    assert end.furthest_m <= 3.0


def test_a_vehicle_that_hardly_brakes_ends_in_time_to_come_to_rest() -> None:
    weak = leg(0.5)
    end = flown(weak)
    assert end.told_mps < 0.5 * RATE_mps
    assert abs(end.rest_mps) < 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("assumed", [0.3, 0.7, 1.0, 1.5, 2.5])
def test_a_leg_coasts_at_speed_and_ends_within_its_room(assumed: float, sign: float) -> None:
    end = flown(leg(5.0, sign, coast_s=2.0, drag=assumed * DRAG))
    times_s, forces, speeds = zip(*end.coasts, strict=True)
    assert set(forces) == {0.0}
    assert speeds[0] > 0.5 * RATE_mps
    assert speeds[-1] < 0.8 * speeds[0]
    assert 1.0 < times_s[-1] - times_s[0] <= 2.0 + STEP_S
    assert abs(end.rest_mps) < 0.15
    assert end.furthest_m <= 3.0


LIMIT_mps = RATE_mps / SPEED_RESERVE


def longest_s(speeds: list[float]) -> float:
    """Longest time for which the speed was beyond its limit."""
    beyond = [len(list(run)) for fast, run in groupby(speeds, lambda v: v > LIMIT_mps) if fast]
    return STEP_S * max(beyond, default=0)


@pytest.mark.parametrize("share", [0.4, 0.5, 0.65])
def test_a_vehicle_with_less_drag_than_its_file_says_is_eased_before_the_guard_ends_the_flight(share: float) -> None:
    easing, one = Easing(), replace(leg(2.1, coast_s=2.0), most=EASED_FROM * LIMIT_mps)
    first = flown(one, easing, share * DRAG)
    assert longest_s(first.speeds) < ManeuverGuardKnobs().patience_s
    assert first.furthest_m <= 3.0
    assert first.coasts
    eased = easing.share
    second = flown(replace(one, sign=-1.0, level=-one.level, rate=-one.rate, start=3.0, end=-3.0), easing, share * DRAG)
    assert longest_s(second.speeds) < ManeuverGuardKnobs().patience_s
    assert easing.share == eased < 1.0, "what one leg has found, the next ones know"
    assert EASED_FROM * LIMIT_mps > statistics.median(second.speeds) > 0.7 * RATE_mps


@pytest.mark.parametrize("share", [0.9, 1.0, 2.0])
def test_a_vehicle_that_is_much_as_its_file_says_gets_the_forces_of_the_plan(share: float) -> None:
    easing = Easing()
    flown(replace(leg(2.1), most=EASED_FROM * LIMIT_mps), easing, share * DRAG)
    assert easing == Easing()


def test_a_leg_without_a_coast_keeps_its_force_until_it_brakes() -> None:
    assert flown(leg(2.1)).coasts == []


def test_a_coast_goes_less_far_than_its_first_rate_and_further_than_its_last() -> None:
    for short, far_m in ((leg(2.1, coast_s=2.0, drag=0.0), 0.8), (leg(2.1, coast_s=0.1), 0.04)):
        way_m, left_mps = short.coast(0.4)
        assert way_m == pytest.approx(far_m)
        assert left_mps == 0.4
    assert leg(2.1, coast_s=2.0).coast(0.0) == (0.0, 0.0)
    way_m, left_mps = leg(2.1, coast_s=2.0).coast(0.4)
    assert left_mps * 2.0 < way_m < 0.4 * 2.0


BEGIN_S = 100.0
"""Legs begin at any time, not at zero."""


def at_speed(one: Leg) -> LegController:
    """A leg that is at its plateau's rate from its first step on."""
    driver = LegController(one)
    assert driver.step(one.start, one.rate, BEGIN_S) == LegOutput(one.level, "transient")
    return driver


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_boost_pushes_until_the_thrust_that_still_comes_makes_up_the_rest(sign: float) -> None:
    one = leg(2.1, sign)
    driver = LegController(one)
    for forward_mps in (0.0, 0.5 * RATE_mps):
        assert driver.step(one.start, sign * forward_mps, BEGIN_S) == LegOutput(sign * one.boost, "transient")
    nearly_mps = RATE_mps - 0.5 * LAG_S * one.pace
    assert driver.step(one.start, sign * nearly_mps, BEGIN_S) == LegOutput(one.level, "transient")


@pytest.mark.parametrize("axis", ["surge", "roll"])
def test_a_boost_that_does_not_get_up_to_speed_is_given_up_a_second_after_1_6_times_its_time(axis: str) -> None:
    one = leg(2.1, axis=axis)
    driver, patient_s = LegController(one), 1.6 * CHARACTERS[axis].boost_s + 1.0
    for elapsed_s in (0.0, patient_s - 0.01):
        assert driver.step(one.start, 0.0, BEGIN_S + elapsed_s).force == one.boost
    assert driver.step(one.start, 0.0, BEGIN_S + patient_s + 0.01).force == one.level


def test_a_plateau_is_given_up_a_second_after_1_6_times_the_time_of_its_leg() -> None:
    one = leg(2.1)
    driver, patient_s = at_speed(one), 1.6 * one.seconds + 1.0
    for elapsed_s in (patient_s - 0.01, patient_s + 0.01):
        assert driver.step(0.0, RATE_mps, BEGIN_S + elapsed_s).force == one.level
    assert driver.step(0.0, RATE_mps, BEGIN_S + patient_s + 0.02) == LegOutput(-one.boost, "transit")


@pytest.mark.parametrize("braking_mps2", [2.1, 5.0])
def test_a_brake_that_does_not_stop_it_ends_two_seconds_after_five_times_its_time(braking_mps2: float) -> None:
    one = leg(braking_mps2)
    driver, patient_s = at_speed(one), 5.0 * RATE_mps / one.pace + 2.0
    for elapsed_s, finished in ((0.0, False), (patient_s - 0.01, False), (patient_s + 0.01, True)):
        reported = driver.step(one.end, 4.0 * RATE_mps, BEGIN_S + elapsed_s)
        assert reported == LegOutput(-one.boost, "transit", finished=finished)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("boosting", [False, True])
def test_it_brakes_where_a_lag_and_an_even_deceleration_just_bring_it_to_rest_at_the_end(
    sign: float, boosting: bool
) -> None:
    one, forward_mps = leg(2.1, sign), 0.3
    way_m = forward_mps * LAG_S + forward_mps**2 / (2.0 * 2.1)
    for before_m, phase in ((0.001, "transient"), (-0.001, "transit")):
        driver = LegController(one) if boosting else at_speed(one)
        assert driver.step(one.end - sign * (way_m + before_m), sign * forward_mps, BEGIN_S).phase == phase


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_coasts_where_coast_and_brake_together_just_bring_it_to_rest_at_the_end(sign: float) -> None:
    one = leg(2.1, sign, coast_s=2.0)
    way_m, left_mps = one.coast(RATE_mps)
    way_m += left_mps * LAG_S + left_mps**2 / (2.0 * 2.1)
    for before_m, phase in ((0.001, "transient"), (-0.001, "coast")):
        driver = at_speed(one)
        assert driver.step(one.end - sign * (way_m + before_m), one.rate, BEGIN_S + 1.0).phase == phase
    reported = [driver.step(0.0, one.rate, BEGIN_S + 1.0 + elapsed_s).phase for elapsed_s in (1.9, 2.0, 2.1)]
    assert reported == ["coast", "coast", "transit"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_swings_where_its_righting_alone_brings_it_to_rest_at_the_end(sign: float) -> None:
    """Amplitude of a pendulum: hypot(angle, rate / natural frequency), an angle of a lag later than now."""
    one = replace(leg(2.1, sign, coast_s=2.0, axis="roll"), natural_radps=0.2)
    ahead = math.sqrt(3.0**2 - (RATE_mps / 0.2) ** 2)
    for before, phase in ((0.001, "transient"), (-0.001, "coast")):
        driver = at_speed(one)
        assert driver.step(sign * (ahead - RATE_mps * LAG_S - before), one.rate, BEGIN_S + 1.0).phase == phase
    reported = [
        driver.step(at * sign, rate * sign, BEGIN_S + 2.0) for at, rate in ((2.9, 0.4), (3.2, 0.1), (0.0, -0.4))
    ]
    assert [(one.phase, one.force) for one in reported] == [("coast", 0.0)] * 3
    assert driver.step(0.0, -one.rate, BEGIN_S + 3.0).phase == "coast"
    assert driver.step(0.0, -one.rate, BEGIN_S + 3.1).phase == "transit"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_never_gets_up_to_speed_swings_too(sign: float) -> None:
    driver = LegController(replace(leg(2.1, sign, coast_s=2.0, axis="roll"), natural_radps=0.2))
    slow_mps = 0.25 * RATE_mps
    ahead = math.sqrt(3.0**2 - (slow_mps / 0.2) ** 2) - slow_mps * LAG_S
    reported = [driver.step(sign * (ahead + beyond), sign * slow_mps, BEGIN_S + 0.1) for beyond in (-0.001, 0.001)]
    assert [(one.phase, one.force != 0.0) for one in reported] == [("transient", True), ("coast", False)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("swinging", [False, True])
def test_what_does_not_right_itself_as_assumed_is_braked_beyond_its_end(sign: float, swinging: bool) -> None:
    one = replace(leg(2.1, sign, coast_s=2.0, axis="roll"), natural_radps=0.2 if swinging else 100.0)
    driver = at_speed(one)
    first = driver.step(sign * 2.5, one.rate, BEGIN_S + 0.1)
    assert first.phase == ("coast" if swinging else "transient")
    reported = [driver.step(sign * at, one.rate, BEGIN_S + 0.2).phase for at in (2.7, 3.31)]
    assert reported == [first.phase, "transit"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("at", "braked"), [(1.0, False), (2.8, True)])
def test_what_would_swing_on_beyond_its_end_is_braked_before_the_next_leg(
    sign: float, at: float, *, braked: bool
) -> None:
    """A slow leg that followed a fast swing at once let a heavy BlueROV2 roll on to 39 degrees, and was disarmed."""
    one = replace(leg(2.1, sign, coast_s=2.0, axis="roll"), natural_radps=0.2)
    slow_mps = sign * 0.95 * 2.1 * LAG_S
    driver = at_speed(one)
    assert driver.step(sign * 2.9, one.rate, BEGIN_S + 1.0).phase == "coast"
    ends = [driver.step(sign * at, slow_mps, BEGIN_S + 3.0 + after_s) for after_s in (0.01, 0.02, 0.02 + LAG_S)]
    assert {(end.phase, end.force * sign < 0.0) for end in ends[1:]} == {("transit", True)}
    assert [end.finished for end in ends[1:]] == [not braked, True]


def swinging(sign: float, natural_radps: float = 0.2) -> Leg:
    """Leg that ends in a swing of two seconds, fifteen seconds of plateau before it."""
    return replace(leg(2.1, sign, coast_s=2.0, axis="roll"), natural_radps=natural_radps, seconds=17.0)


PATIENT_S = 1.6 * 15.0 + 1.0
"""Patience with the plateau of `swinging`: that of any plateau, without the time of the swing."""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("at", [-2.0, -1.6, 1.6, 2.0])
def test_a_leg_that_hangs_swings_from_where_it_hangs(sign: float, at: float) -> None:
    """Righting moment and thrust are never quite what is believed: the rest of both outweighs a slow leg's drag."""
    driver = at_speed(swinging(sign))
    reported = [driver.step(sign * at, 0.0, BEGIN_S + PATIENT_S + late_s) for late_s in (-0.01, 0.01, 0.02, 2.0)]
    assert [(one.phase, one.force != 0.0) for one in reported] == [("transient", True)] * 2 + [("coast", False)] * 2
    assert [driver.step(0.0, 0.0, BEGIN_S + PATIENT_S + late_s).phase for late_s in (2.02, 2.1)] == ["coast", "transit"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("at", [-1.4, 0.0, 1.4])
def test_a_leg_that_hangs_near_level_is_pushed_and_swings_where_it_gets_to(sign: float, at: float) -> None:
    one, late_s = swinging(sign, 100.0), 0.01
    pushed_s = 1.6 * CHARACTERS["roll"].boost_s + 1.0
    for rises in (True, False):
        driver = at_speed(one)
        reported = [driver.step(sign * at, 0.0, BEGIN_S + PATIENT_S + after_s) for after_s in (late_s, 2.0 * late_s)]
        assert reported == [LegOutput(one.level, "transient"), LegOutput(sign * one.boost, "transient")]
        if rises:
            assert driver.step(sign * 3.01, sign * 0.01, BEGIN_S + PATIENT_S + 0.1) == LegOutput(0.0, "coast")
            continue
        times_s = [BEGIN_S + PATIENT_S + late_s + pushed_s + after_s for after_s in (-0.005, 0.005, 0.015)]
        assert [driver.step(sign * at, 0.0, time_s).phase for time_s in times_s] == ["transient"] * 2 + ["coast"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("boosting", [False, True])
def test_a_leg_that_is_carried_back_to_its_begin_swings_from_there(sign: float, boosting: bool) -> None:
    """In its boost it may still turn back by itself, until it is beyond."""
    one, backward = swinging(sign, 100.0), 0.1
    way = 0.0 if boosting else backward * LAG_S + backward**2 / (2.0 * 2.1)
    for before, phase in ((0.001, "transient"), (-0.001, "coast")):
        driver = LegController(one) if boosting else at_speed(one)
        assert driver.step(sign * (-3.0 + way + before), -sign * backward, BEGIN_S + 0.1).phase == phase
    # It is carried no further than a swing may go.
    reported = [driver.step(-sign * at, -sign * backward, BEGIN_S + 0.2).phase for at in (3.2, 3.3)]
    assert reported == ["coast", "transit"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_rights_itself_slowly_is_braked_in_time(sign: float, side: float) -> None:
    """A pendulum of 0.2 rad/s that turns by 1 rad/s at level would go on to 5 rad: it stops at 3.3."""
    driver, rate = at_speed(swinging(sign)), 1.0
    assert driver.step(0.1 * sign, rate * sign, BEGIN_S + 0.1).phase == "coast"
    last = 3.3 - rate * LAG_S - rate**2 / (2.0 * 2.1)
    reported = [driver.step(side * (last + beyond), side * rate, BEGIN_S + 0.2) for beyond in (-0.001, 0.001)]
    assert [one.phase for one in reported] == ["coast", "transit"]
    assert reported[1].force * side < 0.0


@pytest.mark.parametrize(("natural_radps", "phase"), [(0.0, "transient"), (100.0, "coast")])
def test_only_what_swings_coasts_without_a_plateau(natural_radps: float, phase: str) -> None:
    one = replace(swinging(1.0), natural_radps=natural_radps)
    at = 3.0 if natural_radps else 3.0 - one.coast(0.1)[0]
    assert LegController(one).step(at, 0.1, BEGIN_S).phase == phase


def test_what_still_turns_back_from_the_leg_before_is_boosted_not_braked() -> None:
    driver = LegController(swinging(1.0))
    assert driver.step(-2.9, -1.0, BEGIN_S).force > 0.0
    assert driver.step(-2.95, -1.0, BEGIN_S + 0.05).phase == "transient"


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("elapsed_s", [0.1, 0.2, 1.0])
def test_a_brake_is_over_when_the_thrust_of_its_last_lag_takes_off_the_rest(sign: float, elapsed_s: float) -> None:
    one, asked_s = leg(2.1, sign), min(elapsed_s, LAG_S)
    for share, finished in ((0.99, True), (1.01, False)):
        driver = at_speed(one)
        assert not driver.step(one.end, one.rate, BEGIN_S).finished
        assert driver.step(one.end, sign * share * 2.1 * asked_s, BEGIN_S + elapsed_s).finished is finished


@pytest.mark.parametrize(("axis", "finished"), [("surge", False), ("roll", True)])
def test_an_angle_does_not_wait_for_thrust_that_still_comes(axis: str, finished: bool) -> None:
    one = leg(2.1, axis=axis)
    slow = 0.9 * LAG_S * one.boost / one.inertia
    assert at_speed(one).step(one.end, slow, BEGIN_S).finished is finished


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_carries_it_backward_is_braked_before_the_room_ends_but_not_in_the_boost(sign: float) -> None:
    one = leg(2.1, sign)
    boosting, driver = LegController(one), at_speed(one)
    back_m, mid_m, back_mps = -2.99 * sign, -1.0 * sign, -0.2 * sign
    assert boosting.step(back_m, back_mps, BEGIN_S).force == sign * one.boost
    assert driver.step(mid_m, back_mps, BEGIN_S).force == one.level
    assert driver.step(back_m, back_mps, BEGIN_S) == LegOutput(sign * one.boost, "transit")
    assert driver.step(back_m, 0.0, BEGIN_S + 1.0).finished


def phases(one: Leg, *, slope_mps2: float = 0.0, blind_s: float = math.inf) -> list[tuple[float, str]]:
    """Times and phases in 6 s from the middle of a leg at speed; for one sample its rate is not measured."""
    driver, reported = at_speed(one), list[tuple[float, str]]()
    for index in range(120):
        time_s = STEP_S * index
        rate_mps, trusted = RATE_mps + slope_mps2 * time_s, abs(time_s - blind_s) > 0.5 * STEP_S
        reported.append((time_s, driver.step(0.0, rate_mps, BEGIN_S + time_s, trusted=trusted).phase))
    return reported


WINDOWS_S = {"surge": 2.0, "sway": 2.0, "heave": 0.6, "roll": 0.25, "pitch": 0.25, "yaw": 1.0}


@pytest.mark.parametrize("axis", WINDOWS_S)
def test_a_plateau_begins_when_its_rate_was_measured_steady_for_a_window(axis: str) -> None:
    one, window_s = leg(2.1, axis=axis), WINDOWS_S[axis]
    for reported, since_s in ((phases(one), 0.0), (phases(one, blind_s=3.0), 3.0)):
        unsteady = [time_s for time_s, phase in reported if phase == "transient"]
        assert max(unsteady) - since_s == pytest.approx(window_s, abs=3.0 * STEP_S)


@pytest.mark.parametrize("axis", WINDOWS_S)
@pytest.mark.parametrize(("share", "steady"), [(0.001, True), (0.3, False)])
def test_a_rate_that_still_takes_a_good_part_of_the_force_is_no_plateau(axis: str, share: float, steady: bool) -> None:
    one = leg(2.1, axis=axis)
    reported = phases(one, slope_mps2=share * one.level / one.inertia)
    assert any(phase == "plateau" for _, phase in reported) is steady


def test_what_is_not_reported_to_be_unmeasured_counts_as_measured() -> None:
    driver = at_speed(leg(2.1))
    assert [driver.step(0.0, RATE_mps, BEGIN_S + STEP_S * index).phase for index in range(120)][-1] == "plateau"
