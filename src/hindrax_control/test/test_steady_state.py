"""The test for steadiness: neither fooled by noise nor by a slow approach."""

import math
import random
from collections import deque
from collections.abc import Callable
from typing import Any

import pytest

from hindrax_control.maneuver.leg import SteadyStateTest, line


def pushed(
    rate_of: Callable[[Any], float],
    seconds: float = 4.0,
    noise: float = 0.0,
    seed: int = 1,
) -> list[Any]:
    """Whether the rate passes for steady, at every sample."""
    rng, steadiness = random.Random(seed), SteadyStateTest(2.0, 0.001)
    times = [0.02 * index for index in range(round(seconds / 0.02))]
    return [(t, steadiness.push(t, rate_of(t) + rng.gauss(0.0, noise))) for t in times]


def test_constant_rate_is_steady_once_the_window_is_full() -> None:
    judged = pushed(lambda _t: 0.3)
    assert not any(steady for t, steady in judged if t < 1.8)
    assert all(steady for t, steady in judged if t > 2.1)


def test_noise_alone_does_not_spoil_a_plateau() -> None:
    for seed in range(20):
        judged = pushed(lambda _t: 0.3, seconds=10.0, noise=0.005, seed=seed)
        assert sum(steady for t, steady in judged if t > 3.0) > 0.95 * sum(t > 3.0 for t, _ in judged)


def test_approach_to_the_plateau_is_not_steady() -> None:
    # Time constant of the Hindrax at 0.2 m/s is about a second.
    judged = pushed(lambda t: 0.2 * (1.0 - math.exp(-t)), seconds=12.0, noise=0.002)
    assert not any(steady for t, steady in judged if t < 3.0)
    assert all(steady for t, steady in judged if t > 8.0)


def test_plateau_that_ends_is_noticed() -> None:
    judged = pushed(lambda t: 0.3 if t < 4.0 else 0.3 - 0.1 * (t - 4.0), seconds=8.0, noise=0.002)
    assert not any(steady for t, steady in judged if t > 5.5)


def test_change_of_force_starts_the_window_anew() -> None:
    steadiness = SteadyStateTest(1.0, 0.001)
    assert [steadiness.push(0.02 * index, 0.3) for index in range(100)][-1]
    steadiness.clear()
    judged = [(t, steadiness.push(t, 0.3)) for t in (2.0 + 0.02 * index for index in range(100))]
    assert min(t for t, steady in judged if steady) == pytest.approx(3.0, abs=0.1)


def test_after_a_gap_it_is_steady_only_when_the_window_is_full_again() -> None:
    steadiness = SteadyStateTest(1.0, 0.001)
    times = [0.02 * index for index in range(100)]
    assert [steadiness.push(t, 0.3) for t in times][-1]
    judged = [(t, steadiness.push(5.0 + t, 0.3)) for t in times]
    assert not any(steady for t, steady in judged if t < 0.9)
    assert judged[-1][1]


def test_a_plateau_bears_a_slope_with_which_none_begins() -> None:
    slight = 0.002
    assert not any(steady for _, steady in pushed(lambda t: 0.3 + slight * t, seconds=8.0))
    assert pushed(lambda t: 0.3 + slight * max(0.0, t - 4.0), seconds=8.0)[-1][1]


def test_after_a_change_of_force_it_bears_no_more_than_at_first() -> None:
    steadiness = SteadyStateTest(2.0, 0.001)
    assert [steadiness.push(0.02 * index, 0.3) for index in range(150)][-1]
    steadiness.clear()
    assert not any(steadiness.push(3.0 + 0.02 * index, 0.3 + 0.00004 * index) for index in range(200))


def test_every_sample_at_20_hz_counts_and_what_comes_in_between_does_not() -> None:
    alone, disturbed = SteadyStateTest(2.0, 0.001), SteadyStateTest(2.0, 0.001)
    for index in range(100):
        t = 100.0 + 0.05 * index
        # A slope, and a scatter that one sees in every second sample only: with it the slope may be zero.
        rate = 0.3 + 0.003 * t + (0.05 if index % 2 else -0.05)
        steady = alone.push(t, rate)
        assert disturbed.push(t, rate) is steady
        assert disturbed.push(t + 0.02, 10.0 * (t - 100.0)) is steady
    assert steady


def test_slope_and_its_scatter_are_those_of_least_squares() -> None:
    slope, sigma = line(deque([(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]))
    assert (slope, sigma) == pytest.approx((1.0, 0.0))
    # Residuals -1/3, 2/3, -1/3: their squares over one degree of freedom and a spread of 2.
    assert line(deque([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])) == pytest.approx((0.0, math.sqrt(2.0 / 3.0 / 2.0)))
    # By hand: residuals 0.25, -0.75, 0.75, -0.25 about 1.2 t + 0.45 ... variance 1.25 / 2 / 5.
    slope, sigma = line(deque([(0.0, 1.0), (1.0, 1.0), (2.0, 3.0), (3.0, 3.0)]))
    assert (slope, sigma) == pytest.approx((0.8, math.sqrt(0.8 / 2.0 / 5.0)))
