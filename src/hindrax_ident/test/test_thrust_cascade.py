"""Thrust behind several lags and the filter of the regression, against an integration in small steps."""

import math
from itertools import pairwise

import pytest

from hindrax_ident.online.thrust_cascade import ThrustCascade

LAG_S, RATE, STEP_S = 0.15, 1.3, 0.05
COMMANDS = [3.0 * math.sin(0.2 * index) + (2.0 if index % 40 < 20 else -1.0) for index in range(200)]


def integrated(lags: int) -> list[float]:
    """Thrusts behind one lag, two and so on, filtered, after all commands: by Euler in steps of 20 us."""
    states, filtered, inner = [0.0] * lags, [0.0] * lags, 2500
    h = STEP_S / inner
    for command in COMMANDS:
        for _ in range(inner):
            inputs = [command, *states[:-1]]
            filtered = [f + h * (one - RATE * f) for f, one in zip(filtered, states, strict=True)]
            states = [one + h / LAG_S * (u - one) for one, u in zip(states, inputs, strict=True)]
    return filtered


def advanced(lags: int, commands: list[float]) -> ThrustCascade:
    cascade = ThrustCascade(lags)
    for command in commands:
        cascade.command = command
        cascade.advance(STEP_S, LAG_S, RATE)
    return cascade


def test_shapes_are_differences_of_the_thrust_behind_its_lags() -> None:
    wanted = integrated(3)
    cascade = advanced(3, COMMANDS)
    assert cascade.filtered == pytest.approx(wanted[0], rel=1e-3)
    one, two = ((a - b) / LAG_S for a, b in pairwise(wanted))
    assert cascade.shapes(LAG_S) == pytest.approx((one, (one - two) / LAG_S), rel=1e-2, abs=1e-2)


def test_a_thrust_that_has_been_for_long_has_no_shapes() -> None:
    cascade = ThrustCascade(4)
    cascade.command = 5.0
    cascade.rest()
    for _ in range(20):
        cascade.advance(0.1, LAG_S, RATE)
    assert cascade.lagged == pytest.approx(5.0)
    assert cascade.filtered == pytest.approx(5.0 * (1.0 - math.exp(-2.0 * RATE)) / RATE)
    assert cascade.shapes(LAG_S) == pytest.approx((0.0,) * 3, abs=1e-9)


def test_a_constant_that_is_taken_off_changes_no_shape() -> None:
    whole = advanced(3, COMMANDS)
    lower = advanced(3, COMMANDS)
    for one in (whole, lower):
        one.restart_filter()
    lower.lower(lower.command)
    for one in (whole, lower):
        one.advance(STEP_S, LAG_S, RATE)
    assert lower.command == 0.0
    assert lower.shapes(LAG_S) == pytest.approx(whole.shapes(LAG_S), abs=1e-9)


def test_without_a_lag_thrust_is_its_command() -> None:
    cascade = ThrustCascade(1)
    cascade.command = 2.0
    cascade.advance(0.5, 0.0, RATE)
    assert cascade.lagged == 2.0
    assert cascade.filtered == pytest.approx(2.0 * (1.0 - math.exp(-0.5 * RATE)) / RATE)
    assert cascade.shapes(0.0) == ()
