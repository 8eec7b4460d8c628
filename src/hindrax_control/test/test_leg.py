"""One leg on a vehicle whose thrust lags: it coasts, and brakes to rest, however strong and light the vehicle is."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import pytest

from hindrax_control.maneuver.leg import LegController
from hindrax_control.maneuver.plan import Leg

STEP_s = 0.05
LAG_s = 0.2
MASS_kg, ADDED_kg, DRAG = 11.5, 5.5, 141.0
"""About a BlueROV2 Heavy in surge; drag in N per (m/s)^2."""
RATE_mps = 0.45


def leg(braking_mps2: float, sign: float = 1.0, *, coast_s: float = 0.0, drag: float = DRAG) -> Leg:
    """Leg of 6 m along the pool; boost and brake take off `braking_mps2`, drag apart. `drag`: what is believed."""
    inertia = MASS_kg + ADDED_kg
    level = drag * RATE_mps * RATE_mps
    boost = braking_mps2 * inertia
    return Leg(
        axis="surge",
        name="surge",
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

    `coasts`: times, forces and speeds of the coast.
    """

    told_mps: float
    rest_mps: float
    furthest_m: float
    coasts: list[tuple[float, float, float]]


def flown(one: Leg) -> End:
    """Fly a leg with thrust that comes a lag after it was asked for; no thrust is asked for after its end."""
    driver, coming = LegController(one), deque([0.0] * round(LAG_s / STEP_s))
    x_m, v_mps, time_s, told_mps, furthest_m = one.start, 0.0, 0.0, math.nan, -math.inf
    rest_s = math.inf
    coasts: list[tuple[float, float, float]] = []
    while time_s < rest_s:
        if math.isnan(told_mps):
            output = driver.step(x_m, v_mps, time_s)
            if output.phase == "coast":
                coasts.append((time_s, output.force, v_mps * one.sign))
            if output.finished:
                told_mps, rest_s = v_mps, time_s + LAG_s
        coming.append(output.force if math.isnan(told_mps) else 0.0)
        v_mps += (coming.popleft() - DRAG * abs(v_mps) * v_mps) / one.inertia * STEP_s
        x_m += v_mps * STEP_s
        furthest_m = max(furthest_m, x_m * one.sign)
        time_s += STEP_s
        assert time_s < 60.0
    return End(told_mps * one.sign, v_mps * one.sign, furthest_m, coasts)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("braking_mps2", [1.8, 2.1, 3.0, 5.0])
def test_a_strong_light_vehicle_brakes_to_rest_before_the_end(braking_mps2: float, sign: float) -> None:
    end = flown(leg(braking_mps2, sign))
    # Two steps of braking are as exact as it gets; drag, which is left out, brakes on.
    assert abs(end.rest_mps) <= max(0.5 * RATE_mps, 2.0 * STEP_s * braking_mps2)
    assert end.rest_mps < 0.1
    assert end.furthest_m <= 3.0


def test_a_vehicle_that_hardly_brakes_ends_in_time_to_come_to_rest() -> None:
    weak = leg(0.5)
    end = flown(weak)
    assert end.told_mps < 0.5 * RATE_mps
    assert abs(end.rest_mps) < 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("believed", [0.3, 0.7, 1.0, 1.5, 2.5])
def test_a_leg_coasts_at_speed_and_ends_within_its_room(believed: float, sign: float) -> None:
    end = flown(leg(5.0, sign, coast_s=2.0, drag=believed * DRAG))
    times_s, forces, speeds = zip(*end.coasts, strict=True)
    assert set(forces) == {0.0}
    assert speeds[0] > 0.5 * RATE_mps
    assert speeds[-1] < 0.8 * speeds[0]
    assert 1.0 < times_s[-1] - times_s[0] <= 2.0 + STEP_s
    assert abs(end.rest_mps) < 0.15
    assert end.furthest_m <= 3.0


def test_a_leg_without_a_coast_keeps_its_force_until_it_brakes() -> None:
    assert flown(leg(2.1)).coasts == []


def test_a_coast_goes_less_far_than_its_first_rate_and_further_than_its_last() -> None:
    assert leg(2.1, coast_s=2.0, drag=0.0).coast(0.4) == (pytest.approx(0.8), 0.4)
    assert leg(2.1, coast_s=0.1).coast(0.4) == (pytest.approx(0.04), 0.4)
    assert leg(2.1, coast_s=2.0).coast(0.0) == (0.0, 0.0)
    way_m, left_mps = leg(2.1, coast_s=2.0).coast(0.4)
    assert left_mps * 2.0 < way_m < 0.4 * 2.0
