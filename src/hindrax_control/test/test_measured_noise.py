"""Noise by second differences: learned where it lasts, no less than claimed, and not made by a jump or a dive."""

import random

import pytest

from hindrax_control.navigation.measured_noise import MeasuredNoise

CLAIMED = 0.003


def noisy(sigma: float, count: int, slope: float = 0.0, seed: int = 1) -> list[float]:
    draws = random.Random(seed)
    return [slope * k + draws.gauss(0.0, sigma) for k in range(count)]


def learned(values: list[float]) -> float:
    found = MeasuredNoise(CLAIMED)
    return [found.step(value) for value in values][-1]


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_lasting_noise_is_learned_in_a_dive_too(slope: float) -> None:
    long = noisy(0.02, 400, slope)
    assert learned(long) == pytest.approx(0.02, rel=0.4)
    found = MeasuredNoise(CLAIMED)
    course = [(found.step(value), found.known) for value in long]
    assert next(sigma for sigma, known in course if known) > 0.01, "when it counts as known"


def test_a_sensor_that_is_asked_twice_as_often_as_it_measures_has_its_own_noise() -> None:
    assert learned([value for value in noisy(0.02, 400) for _ in range(2)]) == learned(noisy(0.02, 400))


def test_a_quiet_sensor_has_what_is_claimed_for_it() -> None:
    assert learned(noisy(0.001, 200, 0.05)) == CLAIMED


def test_a_jump_is_a_fault_and_no_noise() -> None:
    found = MeasuredNoise(CLAIMED)
    course = [found.step(value) for value in (*noisy(0.002, 100), *(1.0 + one for one in noisy(0.002, 100, seed=2)))]
    assert max(course) < 2.0 * CLAIMED
