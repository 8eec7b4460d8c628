"""The record of the benchmark of identification, without measuring anything."""

import numpy as np
import pytest

from hindrax_laboratory.benchmark.foreign_plants import DOPPLER_mps, read
from hindrax_tools.benchmarks.identification import RECORD, LASTS_s, repeated


def test_a_record_that_is_repeated_has_every_velocity_at_20_hertz_and_fresh_noise() -> None:
    flown = read(RECORD).recording
    found = repeated(flown, 2)
    half = len(found.velocity) // 2
    assert np.diff(found.velocity_t[:half]) == pytest.approx(0.05)
    assert np.all(np.diff(found.wrench_t) > 0.0)
    assert found.velocity_t[half:] - found.velocity_t[:half] == pytest.approx(LASTS_s)
    assert np.all(np.isfinite(found.velocity))
    apart = found.velocity[half:, 0] - found.velocity[:half, 0]
    assert np.std(apart) == pytest.approx(np.sqrt(2.0) * DOPPLER_mps, rel=0.1)
    assert np.array_equal(found.wrench[len(flown.wrench_t) :], flown.wrench)
