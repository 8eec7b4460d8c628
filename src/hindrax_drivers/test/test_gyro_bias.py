"""The gyroscope's offset: found at rest, never in motion."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_drivers.gyro_bias import GyroBias, GyroBiasKnobs

KNOBS = GyroBiasKnobs(samples=200)
BIASES = st.tuples(*[st.floats(-0.1, 0.1)] * 3)


@given(BIASES, st.integers(0, 1000))
def test_the_offset_of_a_still_sensor_is_found_within_its_error(bias: tuple[float, float, float], seed: int) -> None:
    draw, found = random.Random(seed), GyroBias(KNOBS)
    for _ in range(KNOBS.samples):
        rates = tuple(one + draw.gauss(0.0, 0.002) for one in bias)
        done = found.add(rates, (draw.gauss(0.0, 0.02), 0.0, 9.8))  # type: ignore[arg-type]
    assert done
    assert found.found == pytest.approx(bias, abs=6 * max(found.sigma))
    assert max(found.sigma) < 0.0002


@pytest.mark.parametrize(
    ("rates", "forces"),
    [
        ([0.0, 0.05], [9.8, 9.8]),  # turns to and fro
        ([0.0, 0.0], [9.6, 10.1]),  # is shaken
        ([0.5, 0.5], [9.8, 9.8]),  # turns steadily, faster than any offset
    ],
)
def test_motion_is_not_taken_for_an_offset(rates: list[float], forces: list[float]) -> None:
    found = GyroBias(KNOBS)
    for turn in range(10 * KNOBS.samples):
        assert not found.add((0.0, 0.0, rates[turn % 2]), (0.0, 0.0, forces[turn % 2]))
    assert found.found is None
    assert found.windows_in_motion == 10


def test_rest_after_motion_is_used() -> None:
    found = GyroBias(KNOBS)
    for turn in range(KNOBS.samples):
        found.add((turn % 2 * 0.1, 0.0, 0.0), (0.0, 0.0, 9.8))
    for _ in range(KNOBS.samples):
        found.add((0.01, 0.02, 0.03), (0.0, 0.0, 9.8))
    assert found.found == pytest.approx((0.01, 0.02, 0.03))
    assert not found.add((1.0, 1.0, 1.0), (0.0, 0.0, 9.8))
