"""Lag, delay and longer lag of the thrust from the coefficients of its shapes, and what the mass gains by them."""

import math

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.online.lag_and_delay import GOES, Delays, coefficients, conditioned, settled, thruster

T, PER_MASS, SHAPES = 0.15, 0.05, slice(1, 7)


def series(lag_s: float, delay_s: float) -> Array:
    """First Taylor coefficients of exp(-s d) (1 + s T) / (1 + s L) in u = s / (1 + s T): (4,), by a circle about 0."""
    n = 64
    u = 0.5 * np.exp(2j * math.pi * np.arange(n) / n)
    s = u / (1.0 - u * T)
    taylor = np.fft.fft(np.exp(-s * delay_s) * (1.0 + s * T) / (1.0 + s * lag_s)) / n
    return array(np.array([float((taylor[order] / 0.5**order).real) for order in (1, 2, 3, 4)]))


def estimate_of(lag_s: float, delay_s: float, longer_s: float) -> tuple[Array, Array]:
    """A mass of 20 kg known to 2 %, and shapes mixed up with it: (7,), (7, 7)."""
    goes = (series(lag_s + longer_s, delay_s) - series(lag_s, delay_s))[:GOES]
    values = PER_MASS * np.array([1.0, *series(lag_s, delay_s), *goes])
    sigmas = PER_MASS * np.array([0.02, 0.01, 3e-3, 1e-3, 3e-4, 0.01, 3e-3])
    together = np.full((7, 7), 0.7) + 0.3 * np.eye(7)
    return array(values), array(np.outer(sigmas, sigmas) * together)


def found_of(values: Array, covariance: Array) -> Delays:
    """The nearest thruster, begun from the filter's lag and no delay, and the estimate under it."""
    about = settled(values, covariance, SHAPES, thruster(array(np.array([T, 0.0, 0.0])), T, 6), T)
    assert settled(values, covariance, SHAPES, about, T) is about
    return conditioned(values, covariance, SHAPES, about)


@pytest.mark.parametrize(("lag_s", "delay_s"), [(0.05, 0.0), (0.3, 0.0), (0.1, 0.07), (0.2, -0.04), (0.0, 0.1)])
def test_lag_and_delay_have_one_coefficient_for_each_shape(lag_s: float, delay_s: float) -> None:
    c, slopes = coefficients(lag_s, delay_s, T, 4)
    assert c == pytest.approx(series(lag_s, delay_s), abs=1e-9)
    for column, (d_lag, d_delay) in enumerate([(1e-5, 0.0), (0.0, 1e-5)]):
        ends = [series(lag_s + sign * d_lag, delay_s + sign * d_delay) for sign in (1.0, -1.0)]
        assert slopes[:, column] == pytest.approx((ends[0] - ends[1]) / 2e-5, abs=1e-6)


@pytest.mark.parametrize(
    "delays_s", [(0.05, 0.02, 0.0), (0.25, 0.0, 0.0), (0.1, 0.07, 0.05), (0.2, -0.04, -0.08), (0.15, 0.0, 0.1)]
)
def test_shapes_tell_the_delays(delays_s: tuple[float, float, float]) -> None:
    values, covariance = estimate_of(*delays_s)
    found = found_of(values, covariance)
    sigmas_s = np.sqrt(np.diag(found.covariance_s2))
    # The prior of a longer lag takes a little of it.
    assert np.abs((found.found_s - delays_s) / sigmas_s).max() < 0.3
    assert found.misfit < 0.1
    assert found.estimate[0] == pytest.approx(values, rel=0.02, abs=1e-4)


@pytest.mark.parametrize("lost_s", [(0.66, -1.0, 0.0), (0.0, 0.9, 0.0)])
def test_a_false_beginning_is_left(lost_s: tuple[float, float, float]) -> None:
    values, covariance = estimate_of(0.1, 0.2, 0.0)
    found = settled(values, covariance, SHAPES, thruster(array(np.array(lost_s)), T, 6), T)
    assert found.delays_s == pytest.approx([0.1, 0.2, 0.0], abs=0.01)


def test_one_thruster_leaves_less_to_be_known_and_scatters_as_it_says() -> None:
    values, covariance = estimate_of(0.12, 0.04, 0.02)
    rng, masses, told, misfits = np.random.default_rng(3), [], [], []
    for noisy in rng.multivariate_normal(values, covariance, 400):
        found = found_of(array(noisy), covariance)
        masses.append(found.estimate[0][0] / values[0] - 1.0)
        told.append(math.sqrt(found.estimate[1][0, 0]) / values[0])
        misfits.append(found.misfit)
    assert np.median(told) < 0.75 * 0.02
    assert float(np.std(masses)) == pytest.approx(float(np.median(told)), rel=0.15)
    assert abs(float(np.mean(masses))) < 0.2 * float(np.std(masses))
    assert 0.6 < float(np.mean(misfits)) < 1.2


def test_shapes_of_something_else_are_left_as_they_are() -> None:
    """Thrust that answers in two steps is no lag: the less agrees, the less of the estimate moves."""
    values, covariance = estimate_of(0.1, 0.05, 0.0)
    other = array(values + PER_MASS * np.array([0.0, 0.0, 0.0, 0.02, -0.01, 0.0, 0.0]))
    found = found_of(other, covariance)
    assert found.misfit > 30.0
    assert np.abs((found.estimate[0] - other) / np.sqrt(np.diag(covariance))).max() < 1.0
    assert np.sqrt(np.diag(found.estimate[1])) == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.05)


@pytest.mark.parametrize("first", [50.0, -50.0])
def test_shapes_that_no_delay_has_do_no_harm(first: float) -> None:
    values, covariance = estimate_of(0.1, 0.05, 0.0)
    values[1] = PER_MASS * first
    found = found_of(values, covariance)
    assert np.all(np.isfinite(found.estimate[0]))
    assert np.all(np.isfinite(found.estimate[1]))
    assert np.all(np.abs(found.found_s) <= 1.0)


@pytest.mark.parametrize("noise", [1e-9, 1e-14, 0.0])
def test_a_record_without_noise_has_a_singular_covariance_and_is_told_all_the_same(noise: float) -> None:
    """Six shapes that the record cannot tell apart: all that it says is along one direction."""
    values, covariance = estimate_of(0.12, 0.04, 0.0)
    sigmas = np.sqrt(np.diag(covariance))
    singular = array(np.outer(sigmas, sigmas) * (np.ones((7, 7)) + noise * np.eye(7)))
    found = found_of(values, singular)
    assert np.all(np.isfinite(found.estimate[0]))
    assert np.all(np.diag(found.estimate[1]) >= -1e-9 * sigmas**2)
