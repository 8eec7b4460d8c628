"""Whitening by a Kalman filter, against the covariance of the residuals written out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_ident.fit.whitening import Noise, Whitener, gains, transitions
from hindrax_ident.testing.error_covariance import covariance_of, error_dynamics_of, moved


@pytest.mark.parametrize("channels", [(0,), (1,), (0, 1)], ids=["velocity", "position", "both"])
@pytest.mark.parametrize("stiffness", [0.0, 4.0])
def test_innovations_are_white_and_of_unit_variance(channels: tuple[int, ...], stiffness: float) -> None:
    rng = np.random.default_rng(5)
    chain = error_dynamics_of(60, rng, channels, stiffness=stiffness, starts=(0, 25))
    noise = Noise(1e-4, 4e-6, 3e-4, 2e-4)
    C = covariance_of(chain, noise)
    W = Whitener(chain, noise)(np.eye(60))
    assert pytest.approx(np.eye(60), abs=1e-6) == W @ C @ W.T


def test_without_unknown_forces_only_the_scale_changes() -> None:
    rng = np.random.default_rng(1)
    chain = error_dynamics_of(30, rng, (0, 1))
    table = rng.standard_normal((30, 2))
    scale = np.where(chain.channel == 0, 0.1, 0.02)
    assert Whitener(chain, Noise(0.01, 0.0004))(table) == pytest.approx(table / scale[:, None])


def test_by_default_there_are_no_unknown_forces() -> None:
    assert Noise() == Noise(velocity=1.0, position=1.0, force=0.0, thrust=0.0)


@pytest.mark.parametrize("larger", [0, 1])
def test_unknown_forces_of_a_ten_thousandth_of_the_smaller_variance_per_second_are_neglected(larger: int) -> None:
    rng = np.random.default_rng(1)
    chain = error_dynamics_of(30, rng, (0, 1))
    table = rng.standard_normal((30, 2))
    large = Noise(4e-3, 1e-4) if larger == 0 else Noise(1e-4, 4e-3)
    plain = Whitener(chain, large)(table)
    for share, neglected in ((0.9e-4, True), (1.1e-4, False)):
        thrust = share * 1e-4 / float(chain.thrust.mean())
        for noise in (replace(large, force=share * 1e-4), replace(large, thrust=thrust)):
            assert bool(np.all(Whitener(chain, noise)(table) == plain)) is neglected


@pytest.mark.parametrize("left_out", [10, 13])
def test_a_measurement_that_does_not_count_changes_nothing(left_out: int) -> None:
    rng = np.random.default_rng(2)
    chain = error_dynamics_of(30, rng, (0, 1), stiffness=4.0)
    table = rng.standard_normal((30, 1))
    counts = chain.counts.copy()
    counts[left_out] = False
    without = replace(chain, counts=counts)
    spoiled = table.copy()
    spoiled[left_out] = 1e6
    noise = Noise(1e-4, 4e-6, 3e-4)
    assert Whitener(without, noise)(spoiled) == pytest.approx(Whitener(without, noise)(table))
    assert Whitener(without, noise)(table)[left_out] == 0.0
    # The others are white without it.
    kept = np.flatnonzero(counts)
    C = covariance_of(chain, noise)[np.ix_(kept, kept)]
    W = Whitener(without, noise)(np.eye(30))[np.ix_(kept, kept)]
    assert pytest.approx(np.eye(29), abs=1e-6) == W @ C @ W.T


@pytest.mark.parametrize(("share", "doublings"), [(0.0999, 0), (0.1001, 1), (0.1999, 1), (0.2001, 2), (0.39, 2)])
def test_the_series_goes_over_a_tenth_of_the_fastest_time_at_most(share: float, doublings: int) -> None:
    """Its fourth order, squared again and again: over shorter steps than necessary, digits would get lost."""
    chain = error_dynamics_of(2, np.random.default_rng(4), damping=-1.5, stiffness=-4.0)
    fastest = 1.0 / chain.memory_s + 1.5 + 2.0
    h = share / fastest
    chain = replace(chain, step_s=np.array([0.0, h]), damping=np.array([1.0, -1.5]), stiffness=np.array([0.0, -4.0]))
    F = np.array([[1.5, 4.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0 / chain.memory_s]]) * h / 2**doublings
    series = sum((np.linalg.matrix_power(F, order) / math.factorial(order) for order in range(1, 5)), np.eye(3))
    assert transitions(chain)[0][1] == pytest.approx(np.linalg.matrix_power(series, 2**doublings), rel=1e-13)


def test_a_long_step_is_as_exact_as_a_short_one() -> None:
    rng = np.random.default_rng(4)
    chain = error_dynamics_of(6, rng, stiffness=4.0)
    chain = replace(chain, step_s=np.array([0.0, 0.02, 1.0, 0.3, 0.6, 0.05]))
    A, Q = transitions(chain)
    expected = moved(chain)
    assert pytest.approx(expected[0], abs=1e-5) == A
    assert pytest.approx(expected[1], abs=1e-5) == Q


@pytest.mark.parametrize("memory_s", [0.0, 0.01])
def test_an_unknown_force_has_some_memory_at_least(memory_s: float) -> None:
    chain, noise = error_dynamics_of(30, np.random.default_rng(4)), Noise(1e-4, 1.0, 1e-3)
    least, short = (Whitener(replace(chain, memory_s=memory), noise)(np.eye(30)) for memory in (0.02, memory_s))
    assert np.array_equal(least, short)


def test_an_error_that_grows_for_ever_is_not_finite_but_no_failure() -> None:
    chain = error_dynamics_of(40, np.random.default_rng(4), damping=-1e5)
    with np.errstate(over="ignore", invalid="ignore"):
        assert not np.all(np.isfinite(Whitener(chain, Noise(1.0, 1.0, 1.0))(np.ones((40, 1)))))


def test_gain_is_between_nothing_and_all() -> None:
    rng = np.random.default_rng(3)
    chain = error_dynamics_of(200, rng)
    K, S = gains(chain, transitions(chain), Noise(1e-4, 1.0, 1e-3))
    assert np.all((K[:, 0] >= 0.0) & (K[:, 0] < 1.0))
    assert np.all(S >= 0.01)
