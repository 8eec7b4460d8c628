"""One leg on a vehicle whose thrust lags: it brakes to rest, however strong and light the vehicle is."""

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


def leg(braking_mps2: float, sign: float = 1.0) -> Leg:
    """Leg of 6 m along the pool; boost and brake take off `braking_mps2`, drag apart."""
    inertia = MASS_kg + ADDED_kg
    level = DRAG * RATE_mps * RATE_mps
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
        seconds=15.0,
    )


@dataclass
class End:
    """Speed when the leg was told to be over, and when the thrust of its last lag had come; the furthest place."""

    told_mps: float
    rest_mps: float
    furthest_m: float


def flown(one: Leg) -> End:
    """Fly a leg with thrust that comes a lag after it was asked for; no thrust is asked for after its end."""
    driver, coming = LegController(one), deque([0.0] * round(LAG_s / STEP_s))
    x_m, v_mps, time_s, told_mps, furthest_m = one.start, 0.0, 0.0, math.nan, -math.inf
    rest_s = math.inf
    while time_s < rest_s:
        if math.isnan(told_mps):
            output = driver.step(x_m, v_mps, time_s)
            if output.finished:
                told_mps, rest_s = v_mps, time_s + LAG_s
        coming.append(output.force if math.isnan(told_mps) else 0.0)
        v_mps += (coming.popleft() - DRAG * abs(v_mps) * v_mps) / one.inertia * STEP_s
        x_m += v_mps * STEP_s
        furthest_m = max(furthest_m, x_m * one.sign)
        time_s += STEP_s
        assert time_s < 60.0
    return End(told_mps * one.sign, v_mps * one.sign, furthest_m)


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
