"""One axis under control: it follows its reference, comes back as its poles say, and does not wind up."""

import itertools
import math
from dataclasses import replace

import pytest

from hindrax_control.hold.regulator import LoopTuning, Ramp, Regulator, gains, reference_speed
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.vehicle import Drag, Limits, Vehicle

STEP_S = 0.01
HEAVE = PriorDynamics(30.0, Drag(60.0, 5.0))
TUNING = LoopTuning(bandwidth_radps=1.2, damping=1.0, integral_s=4.0, rate=0.25, authority=15.0)
WITHOUT_INTEGRAL = replace(TUNING, authority=0.0)


def flown(
    regulator: Regulator,
    freedom: PriorDynamics,
    goal: float,
    seconds: float,
    *,
    value: float = 0.0,
    push_N: float = 0.0,
) -> list[tuple[float, float]]:
    """Fly the very vehicle of the prior, which starts at rest; values and references after each step."""
    rate, seen = 0.0, list[tuple[float, float]]()
    for _ in range(round(seconds / STEP_S)):
        to_goal, error = goal - regulator.ramp.value, regulator.ramp.value - value
        force = regulator.step(to_goal, error, rate, STEP_S) + push_N
        force -= freedom.drag_force(rate) + freedom.restoring * math.sin(value)
        rate += force / freedom.inertia * STEP_S
        value += rate * STEP_S
        seen.append((value, regulator.ramp.value))
    return seen


@pytest.mark.parametrize("goal_m", [1.0, -1.0])
def test_a_vehicle_as_assumed_is_on_its_reference_all_the_way(goal_m: float) -> None:
    seen = flown(Regulator(HEAVE, WITHOUT_INTEGRAL), HEAVE, goal_m, 10.0)
    assert max(abs(reference_m - value_m) for value_m, reference_m in seen) < 0.004
    assert seen[-1] == pytest.approx((goal_m, goal_m), abs=0.01)


@pytest.mark.parametrize("begin_mps", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("goal_m", [1.0, -1.0, 0.03])
def test_a_reference_begins_as_the_vehicle_moves_and_stops_at_its_goal(goal_m: float, begin_mps: float) -> None:
    ramp = Ramp(TUNING.bandwidth_radps, TUNING.rate)
    ramp.start(0.0, begin_mps)
    rates_mps, places_m = [begin_mps], [0.0]
    for _ in range(800):
        gained_mps2 = ramp.step(goal_m - ramp.value, STEP_S)
        assert gained_mps2 * STEP_S == pytest.approx(ramp.rate - rates_mps[-1])
        rates_mps.append(ramp.rate)
        places_m.append(ramp.value)
    assert places_m[-1] == pytest.approx(goal_m, abs=0.005)
    assert max(map(abs, rates_mps)) <= TUNING.rate + 1e-9
    # From rest to its rate in no less than two thirds of a time constant, so thrusters can follow.
    most_mps2 = TUNING.rate * 1.5 * TUNING.bandwidth_radps
    assert max(abs(b - a) for a, b in itertools.pairwise(rates_mps)) == pytest.approx(most_mps2 * STEP_S)
    if begin_mps == 0.0:
        assert max(place_m / goal_m for place_m in places_m) < 1.02
    if abs(goal_m) == 1.0:
        assert max(rate_mps * goal_m for rate_mps in rates_mps) == pytest.approx(TUNING.rate)


def test_a_reference_stands_still_while_no_time_passes() -> None:
    ramp = Ramp(TUNING.bandwidth_radps, TUNING.rate)
    ramp.start(0.5, 0.1)
    assert ramp.step(1.0, 0.0) == 0.0
    assert (ramp.value, ramp.rate) == (0.5, 0.1)


@pytest.mark.parametrize("restoring_Nm", [0.0, 12.0])
def test_off_its_reference_it_comes_back_with_both_poles_at_the_bandwidth(restoring_Nm: float) -> None:
    linear = PriorDynamics(30.0, Drag(0.0, 5.0), restoring=restoring_Nm)
    seen = flown(Regulator(linear, WITHOUT_INTEGRAL), linear, 0.0, 5.0, value=0.1)
    for seconds in (0.5, 1.0, 2.0, 4.0):
        turned = TUNING.bandwidth_radps * seconds
        assert seen[round(seconds / STEP_S)][0] == pytest.approx(0.1 * (1.0 + turned) * math.exp(-turned), abs=0.002)


def test_a_fifth_of_the_stiffness_is_always_ours_and_damping_never_negative() -> None:
    upright = PriorDynamics(2.0, Drag(0.0, 1e3), restoring=1e3)
    assert gains(upright, 3.0, 1.0) == pytest.approx((0.2 * 2.0 * 3.0**2, 0.0))
    brisk, gentle = (gains(HEAVE, 1.2, damping)[1] for damping in (2.0, 1.0))
    assert brisk - gentle == pytest.approx(2.0 * 1.2 * HEAVE.inertia)


@pytest.mark.parametrize("push_N", [8.0, -8.0])
def test_a_steady_push_is_learned(push_N: float) -> None:
    regulator = Regulator(HEAVE, TUNING)
    assert flown(regulator, HEAVE, 0.0, 40.0, push_N=push_N)[-1][0] == pytest.approx(0.0, abs=0.002)
    assert regulator.integral == pytest.approx(-push_N, abs=0.1)


@pytest.mark.parametrize("push_N", [40.0, -40.0])
def test_the_integral_part_keeps_to_its_authority(push_N: float) -> None:
    regulator = Regulator(HEAVE, TUNING)
    flown(regulator, HEAVE, 0.0, 40.0, push_N=push_N)
    assert regulator.integral == -math.copysign(TUNING.authority, push_N)


def kept_off(regulator: Regulator, error_m: float, seconds: float, shortfall_N: float = 0.0) -> float:
    """Keep a vehicle at rest off its reference for a while; returns what the integral part has gained [N]."""
    before_N = regulator.integral
    for _ in range(round(seconds / STEP_S)):
        regulator.step(0.0, error_m, 0.0, STEP_S, shortfall_N)
    return regulator.integral - before_N


def test_the_integral_part_repeats_the_proportional_one_in_its_time() -> None:
    regulator = Regulator(HEAVE, TUNING)
    proportional_N = Regulator(HEAVE, WITHOUT_INTEGRAL).step(0.0, 0.1, 0.0, STEP_S)
    assert kept_off(regulator, 0.1, TUNING.integral_s) == pytest.approx(proportional_N)


@pytest.mark.parametrize("error_m", [0.1, -0.1])
def test_the_integral_part_stands_still_only_while_thrust_is_missing_toward_the_reference(error_m: float) -> None:
    regulator = Regulator(HEAVE, TUNING)
    assert kept_off(regulator, error_m, 1.0, shortfall_N=math.copysign(5.0, error_m)) == 0.0
    assert kept_off(regulator, error_m, 1.0, shortfall_N=-math.copysign(5.0, error_m)) * error_m > 0.0
    regulator.start(0.7, 0.1)
    assert (regulator.ramp.value, regulator.ramp.rate, regulator.integral) == (0.7, 0.1, 0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_reference_comes_along_with_a_vehicle_that_is_carried_away(side: float) -> None:
    """It is then as far ahead as it would be after one time constant at its rate."""
    regulator, leash_m = Regulator(HEAVE, WITHOUT_INTEGRAL), TUNING.rate / TUNING.bandwidth_radps
    for far_m in (1.0, 2.0):
        value_m = -side * far_m
        force_N = regulator.step(0.0, regulator.ramp.value - value_m, 0.0, STEP_S, side * 5.0)
        assert regulator.ramp.value == pytest.approx(value_m + side * leash_m, abs=0.001)
        assert force_N == pytest.approx(side * regulator.proportional * leash_m)
    near_m = 0.5 * leash_m
    regulator.step(0.0, side * near_m, 0.0, STEP_S, side * 5.0)
    assert regulator.ramp.value == pytest.approx(-2.0 * side + side * leash_m, abs=0.001)


def test_a_long_gap_counts_as_a_short_step_and_a_step_back_as_none() -> None:
    gained_N = []
    for gap_s in (-1.0, 0.0, 0.05, 3.0, 30.0):
        regulator = Regulator(HEAVE, TUNING)
        regulator.step(0.0, 0.1, 0.0, gap_s)
        gained_N.append(regulator.integral)
    assert gained_N[0] == gained_N[1] == 0.0
    assert 0.0 < gained_N[2] < gained_N[3] == gained_N[4] < 0.1 * gained_N[2] / 0.05 * 3.0


def test_other_gains_keep_the_reference_and_what_was_learned() -> None:
    regulator = Regulator(HEAVE, TUNING)
    flown(regulator, HEAVE, 1.0, 1.5, push_N=5.0)
    before = (regulator.ramp.value, regulator.ramp.rate, regulator.integral)
    brisker = replace(TUNING, bandwidth_radps=2.0, rate=0.5)
    regulator.tune(brisker)
    assert (regulator.ramp.value, regulator.ramp.rate, regulator.integral) == before
    assert regulator.proportional == Regulator(HEAVE, brisker).proportional
    assert regulator.ramp.speed == 0.5


def test_three_references_at_once_stay_below_the_speed_limit_and_a_slow_one_is_as_wanted(hindrax: Vehicle) -> None:
    slow = replace(hindrax, limits=Limits(speed_mps=0.2))
    assert math.sqrt(3.0) * reference_speed(1.0, slow) < 0.2 < 3.0 * reference_speed(1.0, slow)
    assert reference_speed(0.05, slow) == 0.05
