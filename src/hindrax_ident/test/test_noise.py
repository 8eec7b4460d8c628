"""The color of noise, on noise whose color is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hindrax_ident.fit.autoregression import (
    Correlator,
    autocorrelation,
    color_backward,
    effective_samples,
    fit_autoregression,
    ljung_box,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_white_noise_has_no_color(rng: np.random.Generator) -> None:
    assert len(fit_autoregression([rng.standard_normal(500) for _ in range(4)])) == 0


@pytest.mark.parametrize("a", [[0.7], [-0.5], [1.2, -0.5]])
def test_an_autoregression_is_found(rng: np.random.Generator, a: list[float]) -> None:
    pieces = [lfilter([1.0], [1.0, *(-x for x in a)], rng.standard_normal(3000)) for _ in range(3)]
    found = fit_autoregression(pieces)
    assert found[: len(a)] == pytest.approx(a, abs=0.07)
    white = [lfilter([1.0, *(-found)], [1.0], piece)[5:] for piece in pieces]
    assert np.abs(autocorrelation(white, 10)[1:]).max() < 0.05


def test_too_few_residuals_are_taken_as_white(rng: np.random.Generator) -> None:
    assert len(fit_autoregression([np.cumsum(rng.standard_normal(30))])) == 0


def test_backward_coloring_is_the_transpose_of_coloring(rng: np.random.Generator) -> None:
    a = np.array([0.8, -0.2])
    x, e = rng.standard_normal((40, 1)), rng.standard_normal((40, 1))
    colored = lfilter([1.0], [1.0, -0.8, 0.2], e, axis=0)
    assert float((x.T @ colored)[0, 0]) == pytest.approx(float((color_backward(a, x).T @ e)[0, 0]))


def test_factor_is_that_of_the_variance_of_a_mean(rng: np.random.Generator) -> None:
    correlator = Correlator(lags=30)
    for value in np.asarray(lfilter([1.0], [1.0, -0.6], rng.standard_normal(40_000))).tolist():
        correlator.add(value)
    # (1 + a) / (1 - a) for a first-order autoregression.
    assert correlator.factor == pytest.approx(4.0, rel=0.15)


def test_factor_without_residuals_is_one() -> None:
    assert Correlator().factor == 1.0


def test_a_break_is_not_bridged() -> None:
    correlator = Correlator(lags=1)
    for value in (1.0, -1.0) * 50:
        correlator.add(value)
        correlator.restart()
    assert correlator.factor == 1.0


def test_ljung_box_expects_its_number_of_lags_for_white_noise(rng: np.random.Generator) -> None:
    statistic, expected = ljung_box([rng.standard_normal(4000)])
    assert statistic < 2.5 * expected
    colored, _ = ljung_box([lfilter([1.0], [1.0, -0.3], rng.standard_normal(4000))])
    assert colored > 10.0 * expected


@pytest.mark.parametrize("a", [0.0, 0.6, 0.9])
def test_correlated_residuals_are_worth_fewer_samples(rng: np.random.Generator, a: float) -> None:
    pieces = [lfilter([1.0], [1.0, -a], rng.standard_normal(5000)) for _ in range(4)]
    assert effective_samples(pieces) == pytest.approx(20_000 * (1.0 - a) / (1.0 + a), rel=0.2)
