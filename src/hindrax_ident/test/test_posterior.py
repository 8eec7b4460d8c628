"""Draws of the posterior: what the mixture of explanations and the priors of losses make of an estimate."""

import math

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from hindrax_ident.arrays import Array, array
from hindrax_ident.assess import posterior
from hindrax_ident.assess.posterior import DRAWS, LOSSLESS, Explanations, drawn

MEAN, SPREAD = 0.5, math.sqrt(1.0 / 12.0)
"""Of a loss that is anywhere from none to one."""
NO_NOISE = array(np.zeros((1, 1)))
ENDS_68, ENDS_95 = (0.1587, 0.8413), (0.025, 0.975)


def one_loss(mean: float = MEAN, sigma: float = SPREAD, weight: float = 1.0) -> Explanations:
    """What a normal explanation makes of one loss, and a second influence of both signs, independent of it."""
    return Explanations(
        weight=array([weight]),
        mean=array([[mean, 0.0]]),
        covariance=array([np.diag([sigma**2, 4.0])]),
        usual=array([[MEAN, 0.0]]),
        spread=array([[SPREAD, 2.0]]),
        loss=array([1.0, 0.0]),
    )


@pytest.fixture
def sure_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior, "NORMAL_SHARE", 1e-9)


def quantiles(values: Array, weight: Array, ends: tuple[float, ...]) -> list[float]:
    order = np.argsort(values)
    return [float(values[order][np.searchsorted(np.cumsum(weight[order]), end)]) for end in ends]


@pytest.mark.usefixtures("sure_limits")
def test_a_loss_that_no_record_shows_keeps_its_even_prior() -> None:
    draws = drawn(one_loss(), NO_NOISE)
    found = draws.interval(draws.influences)
    assert found.center == pytest.approx([0.5, 0.0], abs=0.05)
    assert [found.low68[0], found.high68[0]] == pytest.approx(ENDS_68, abs=0.02)
    assert [found.low95[0], found.high95[0]] == pytest.approx(ENDS_95, abs=0.01)
    assert [found.low68[1], found.high68[1]] == pytest.approx([-2.0, 2.0], abs=0.1)
    assert [found.low95[1], found.high95[1]] == pytest.approx([-3.92, 3.92], abs=0.2)


@pytest.mark.usefixtures("sure_limits")
def test_what_a_record_shows_of_a_loss_is_cut_off_at_its_limits() -> None:
    """A measurement of 0.1 +- 0.2 beside the even prior is a normal distribution between none and one."""
    at, sigma = 0.1, 0.2
    information = SPREAD**-2 + sigma**-2
    known = one_loss((MEAN * SPREAD**-2 + at * sigma**-2) / information, information**-0.5)
    draws = drawn(known, NO_NOISE)
    exact = truncnorm(-at / sigma, (1.0 - at) / sigma, at, sigma)
    found = draws.interval(draws.influences[:, :1])
    assert found.center[0] == pytest.approx(exact.mean(), abs=0.01)
    assert [found.low68[0], found.high68[0]] == pytest.approx(exact.ppf(ENDS_68), abs=0.015)
    assert [found.low95[0], found.high95[0]] == pytest.approx(exact.ppf(ENDS_95), abs=0.02)
    assert found.high95[0] - found.center[0] > 1.3 * (found.center[0] - found.low95[0]), "it is not symmetric"


def test_no_loss_is_as_probable_as_the_record_leaves_it() -> None:
    """Bayes' rule, of one measurement y of a loss: none, with the prior LOSSLESS, or normal about its mean."""
    y, sigma = 0.0, 0.2
    information = SPREAD**-2 + sigma**-2
    known = one_loss((MEAN * SPREAD**-2 + y * sigma**-2) / information, information**-0.5)
    none = LOSSLESS * norm(0.0, sigma).pdf(y)
    some = (1.0 - LOSSLESS) * norm(MEAN, math.hypot(SPREAD, sigma)).pdf(y)
    both = posterior._perhaps_lossless(known, LOSSLESS)
    assert both.weight[1] == pytest.approx(none / (none + some))
    draws = drawn(known, NO_NOISE, LOSSLESS)
    assert np.any(draws.influences[:, 0] == 0.0)
    assert draws.interval(draws.influences[:, :1]).low68[0] == pytest.approx(0.0, abs=1e-9)


def test_without_a_loss_the_other_influences_are_what_they_are_given_that() -> None:
    covariance = np.array([[0.5, 0.6], [0.6, 2.0]])
    known = one_loss()._replace(covariance=array([covariance]), mean=array([[0.4, 1.0]]))
    none = posterior._perhaps_lossless(known, LOSSLESS)
    assert none.mean[1] == pytest.approx([0.0, 1.0 - 0.6 / 0.5 * 0.4])
    assert none.covariance[1] == pytest.approx(np.diag([0.0, 2.0 - 0.6**2 / 0.5]))


def test_explanations_have_their_shares_and_noise_is_added() -> None:
    two = Explanations(
        weight=array([0.25, 0.75]),
        mean=array([[-2.0], [2.0]]),
        covariance=array(np.full((2, 1, 1), 1e-6)),
        usual=array(np.zeros((2, 1))),
        spread=array(np.ones((2, 1))),
        loss=array([0.0]),
    )
    noise = array([[4.0, 1.0], [1.0, 1.0]])
    draws = drawn(two, noise)
    assert np.mean(draws.influences[:, 0] < 0.0) == pytest.approx(0.25, abs=1.0 / DRAWS)
    assert draws.covariance(draws.noise) == pytest.approx(noise, abs=0.15)
    found = draws.interval(draws.influences)
    assert found.center[0] == pytest.approx(1.0, abs=0.01)
    assert (found.low68[0], found.high68[0]) == pytest.approx((-2.0, 2.0), abs=0.01)


def test_what_is_far_greater_than_usual_stands_in_for_another_cause_and_widens_either_way() -> None:
    """A real ArduSub: sway was corrected by 20 deviations of one row and 8 of another, to half of what it was."""
    far = Explanations(
        weight=array([1.0]),
        mean=array([[-20.0, 1.0]]),
        covariance=array(np.diag([1e-6, 1e-6])[None]),
        usual=array(np.zeros((1, 2))),
        spread=array(np.ones((1, 2))),
        loss=array(np.zeros(2)),
    )
    found = drawn(far, NO_NOISE).interval(drawn(far, NO_NOISE).influences)
    assert found.center == pytest.approx([0.0, 1.0], abs=0.01)
    assert (found.low95[0], found.high95[0]) == pytest.approx((-20.0, 20.0), abs=0.01)
    assert (found.low95[1], found.high95[1]) == pytest.approx((1.0, 1.0), abs=0.01)


LOSSES = [1, 4, 7]


def correlated(m: int = 12) -> Explanations:
    """One explanation of m influences that a record has correlated, three of them losses; most are as before it."""
    rng = np.random.default_rng(3)
    seen = rng.standard_normal((m, 2))
    covariance = np.eye(m) - 0.4 * seen @ np.linalg.solve(np.eye(2) + seen.T @ seen, seen.T)
    usual, loss = np.zeros((1, m)), np.zeros(m)
    usual[:, LOSSES], loss[LOSSES] = 1.7, 1.0
    return Explanations(
        weight=array([1.0]),
        mean=array(0.5 * usual),
        covariance=array([covariance]),
        usual=array(usual),
        spread=array(np.ones((1, m))),
        loss=array(loss),
    )


def test_a_draw_without_losses_has_none_to_the_last_bit() -> None:
    """Else its weight is one of a small loss: what the draws make of the two hypotheses is decided by rounding."""
    known = posterior._perhaps_lossless(correlated(), LOSSLESS)
    draws = drawn(known, NO_NOISE)
    without = round(DRAWS * float(known.weight[1] / known.weight.sum()))
    exact = np.all(draws.influences[:, LOSSES] == 0.0, axis=1)
    assert without > 100
    assert abs(int(exact.sum()) - without) <= 1


def test_the_last_bits_of_a_covariance_do_not_make_other_draws() -> None:
    known = correlated()
    noise = np.random.default_rng(4).standard_normal((12, 12))
    other = known._replace(covariance=array(known.covariance + 1e-14 * (noise + noise.T)))
    (found, same) = (drawn(one, NO_NOISE) for one in (known, other))
    assert np.max(np.abs(found.influences - same.influences)) < 1e-9
    others = np.flatnonzero(known.loss == 0.0)
    wanted = known.covariance[0][np.ix_(others, others)]
    assert np.cov(found.influences[:, others].T) == pytest.approx(wanted, abs=0.1), "and they have it"


def test_a_loss_that_gives_is_no_known_effect() -> None:
    """A negative inflow loss took 20 % onto a drag: the record resembled it, and nothing that can be."""
    gives = drawn(one_loss(-1.3, 0.1), NO_NOISE)
    found = gives.interval(gives.influences[:, :1])
    assert abs(float(found.center[0])) < 0.1
    assert [found.low68[0], found.high68[0]] == pytest.approx([-1.3, 1.3], abs=0.15)
    small = drawn(one_loss(-0.1, 0.1), NO_NOISE)
    assert float(small.interval(small.influences[:, :1]).high95[0]) < 0.4


def test_the_same_record_gives_the_same_numbers() -> None:
    first, second = (drawn(one_loss(), NO_NOISE, LOSSLESS) for _ in range(2))
    assert np.array_equal(first.influences, second.influences)
    assert np.array_equal(first.weight, second.weight)
