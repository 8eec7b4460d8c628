"""The gyroscope's offset: what a window shows of it, never surer than it is right, at rest and in motion."""

import math
import random
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.navigation.attitude_filter import SPANS, FINEST_radps, Offset, Span, mean, offset_at_rest
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3

SPAN_S = 0.2
OFFSETS = st.tuples(*[st.floats(-0.08, 0.08)] * 3)


def shown(rate: Callable[[Any], float], roll: Callable[[Any], float], *, noise: float = 0.0, seed: int = 0) -> Offset:
    """What a window shows of a vehicle with this roll rate [rad/s] at this roll [rad], both told of time."""
    draw = random.Random(seed)
    window: list[Span] = []
    for number in range(SPANS):
        instants = [(number + (k + 0.5) / 20) * SPAN_S for k in range(20)]
        p = sum(map(rate, instants)) / 20
        y, z = (sum(trig(roll(t)) for t in instants) / 20 for trig in (math.sin, math.cos))
        rate_radps = (p + draw.gauss(0.0, noise), draw.gauss(0.0, noise), draw.gauss(0.0, noise))
        window.append((rate_radps, (0.0, -GRAVITY_mps2 * y, -GRAVITY_mps2 * z)))
    return offset_at_rest(window, SPAN_S)


@given(OFFSETS, st.integers(0, 1000))
def test_the_offset_of_a_still_sensor_is_found_within_its_error(offset: Vec3, seed: int) -> None:
    draw = random.Random(seed)
    window: list[Span] = []
    for _ in range(SPANS):
        x, y, z = (one + draw.gauss(0.0, 3.5e-4) for one in offset)
        window.append(((x, y, z), (0.0, 0.0, -GRAVITY_mps2)))
    found = offset_at_rest(window, SPAN_S)
    assert found.rate_radps == pytest.approx(offset, abs=1e-3)
    assert FINEST_radps <= found.sigma_radps < math.radians(0.1)


@given(st.floats(0.005, 0.3), st.floats(1.5, 8.0), st.floats(0.0, math.tau))
def test_a_swing_is_never_taken_for_an_offset_with_confidence(
    amplitude_rad: float, period_s: float, phase: float
) -> None:
    turn = math.tau / period_s
    found = shown(
        lambda t: amplitude_rad * turn * math.cos(turn * t + phase),
        lambda t: amplitude_rad * math.sin(turn * t + phase),
    )
    assert abs(found.rate_radps[0]) < 2.0 * found.sigma_radps


def test_turning_to_and_fro_about_the_vertical_shows_nothing() -> None:
    window: list[Span] = [((0.0, 0.0, 0.1 * (-1) ** number), (0.0, 0.0, -GRAVITY_mps2)) for number in range(SPANS)]
    assert offset_at_rest(window, SPAN_S).sigma_radps > 0.09


def test_gravity_that_turns_steadily_is_a_turn_whatever_the_rates_say() -> None:
    window: list[Span] = []
    for number in range(SPANS):
        roll_rad = 0.02 * number
        force = (0.0, -GRAVITY_mps2 * math.sin(roll_rad), -GRAVITY_mps2 * math.cos(roll_rad))
        window.append(((0.0, 0.0, 0.0), force))
    assert offset_at_rest(window, SPAN_S).sigma_radps == pytest.approx(0.02 / SPAN_S, rel=0.01)
    assert mean(force for _, force in window)[1] == pytest.approx(-GRAVITY_mps2 * 0.04, rel=0.01)


@given(OFFSETS, st.floats(1e-4, 1.0), st.floats(1e-4, 1.0))
def test_two_sources_together_are_surer_than_each(rate: Vec3, one: float, other: float) -> None:
    found = Offset(rate, one).combined(Offset(rate, other))
    assert found.rate_radps == pytest.approx(rate)
    assert found.sigma_radps == pytest.approx(1.0 / math.hypot(1.0 / one, 1.0 / other))


def test_the_surer_of_two_sources_weighs_more_by_its_variance() -> None:
    found = Offset((0.0, 0.02, 0.01), 0.02).combined(Offset((0.03, 0.02, -0.02), 0.01))
    assert found.rate_radps == pytest.approx((0.8 * 0.03, 0.02, 0.2 * 0.01 - 0.8 * 0.02))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", range(3))
def test_two_sources_contradict_each_other_beyond_three_standard_deviations(axis: int, sign: float) -> None:
    mine = Offset((0.01, 0.02, 0.03), 0.003)
    for share, counts in ((0.99, True), (1.01, False)):
        rate = list(mine.rate_radps)
        rate[axis] += sign * share * 3.0 * 0.005  # the deviations 0.003 and 0.004 together
        assert (mine.combined(Offset((rate[0], rate[1], rate[2]), 0.004)) != mine) is counts


def test_an_offset_that_cannot_be_true_adds_nothing() -> None:
    unknown = Offset((0.0, 0.0, 0.0), math.radians(5.0))
    assert unknown.combined(Offset((0.0, 0.0, 0.5), 1e-3)) == unknown
