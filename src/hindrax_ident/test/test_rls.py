"""Recursive least squares against the batch solution, and against everything that makes others wind up."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

from hindrax_core.readings import Vec3
from hindrax_core.testing import THOROUGH
from hindrax_ident.arrays import Array
from hindrax_ident.online.rls import Rls, WideRls

MANY = 1_000_000 if THOROUGH else 30_000
TRUTH = (66.48, 1.25, 0.4)


def regressor(v: float) -> Vec3:
    return (abs(v) * v, v, 1.0)


def force(v: float) -> float:
    return sum(k * x for k, x in zip(TRUTH, regressor(v), strict=True))


@st.composite
def problems(draw: DrawFn) -> tuple[Array, Array, Array, Array]:
    n = draw(st.integers(1, 6))
    rows = draw(st.integers(1, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scale = 10.0 ** rng.uniform(-2, 2, n)
    X = rng.standard_normal((rows, n)) * scale
    return X, rng.standard_normal(rows) * 5.0, rng.standard_normal(n), 10.0 ** rng.uniform(-1, 2, n)


@pytest.mark.parametrize("kind", [Rls, WideRls])
@settings(max_examples=60, deadline=None)
@given(problem=problems())
def test_equals_batch_least_squares_when_nothing_is_forgotten(
    kind: type[Rls | WideRls], problem: tuple[Array, Array, Array, Array]
) -> None:
    X, y, prior, sigmas = problem
    rls = kind(prior.tolist(), sigmas.tolist())
    for row, value in zip(X.tolist(), y.tolist(), strict=True):
        rls.update(row, value)
    # The prior is one more row per parameter.
    A = np.vstack([np.diag(1.0 / sigmas), X])
    solved, *_ = np.linalg.lstsq(A, np.concatenate([prior / sigmas, y]), rcond=None)
    covariance = np.linalg.inv(A.T @ A)
    spread = np.sqrt(np.diag(covariance))
    assert np.abs((np.array(rls.values) - solved) / spread).max() < 1e-9
    assert np.abs((rls.unit_covariance - covariance) / np.outer(spread, spread)).max() < 1e-9


@pytest.mark.parametrize("forgetting", [1.0, 0.98])
def test_many_parameters_are_learned_as_few_are(forgetting: float) -> None:
    """Directional forgetting, its gate and what is not finite included."""
    rng = np.random.default_rng(4)
    one, other = (kind([1.0] * 5, [30.0] * 5, forgetting) for kind in (Rls, WideRls))
    for index in range(400):
        x = (rng.standard_normal(5) * (1.0, 10.0, 0.1, 1.0, float(index < 100))).tolist()
        y = float(np.dot(x, (2.0, -1.0, 5.0, 0.5, 1.0)) + 0.3 * rng.standard_normal())
        y = math.nan if index % 50 == 7 else 1e-9 * y if index % 50 == 9 else y
        x = [1e-6 * value for value in x] if index % 50 == 11 else x
        assert other.evaluate(x, y) == pytest.approx(one.evaluate(x, y), rel=1e-8, nan_ok=True)
        assert other.update(x, y) == pytest.approx(one.update(x, y), rel=1e-8, nan_ok=True)
    assert other.samples == one.samples
    assert other.weight == pytest.approx(one.weight)
    assert other.values == pytest.approx(one.values, rel=1e-9)
    assert other.unit_covariance == pytest.approx(one.unit_covariance, rel=1e-8, abs=1e-12)
    assert other.variance == pytest.approx(one.variance, rel=1e-9)


def test_residual_variance_is_that_of_equation_8() -> None:
    rng = np.random.default_rng(1)
    X = rng.standard_normal((200, 3))
    y = X @ TRUTH + 0.3 * rng.standard_normal(200)
    rls = Rls([0.0] * 3, [1e6] * 3)
    for row, value in zip(X.tolist(), y.tolist(), strict=True):
        rls.update(row, value)
    _, squares, *_ = np.linalg.lstsq(X, y, rcond=None)
    assert rls.variance == pytest.approx(squares[0] / (200 - 3), rel=1e-6)
    expected = np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * squares[0] / 197)
    assert np.sqrt(np.diag(rls.unit_covariance * rls.variance)) == pytest.approx(expected, rel=1e-6)


def test_residual_variance_needs_more_samples_than_parameters() -> None:
    rls = Rls([0.0] * 3, [1e6] * 3)
    for samples, v in enumerate((0.1, -0.2, 0.3, 0.4)):
        assert math.isnan(rls.variance), f"after {samples} samples"
        rls.update(regressor(v), force(v))
    assert math.isfinite(rls.variance)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_order_of_the_samples_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X, y = rng.standard_normal((30, 3)), rng.standard_normal(30)
    forward, backward = Rls([0.0] * 3, [10.0] * 3), Rls([0.0] * 3, [10.0] * 3)
    for row, value in zip(X.tolist(), y.tolist(), strict=True):
        forward.update(row, value)
    for row, value in zip(X[::-1].tolist(), y[::-1].tolist(), strict=True):
        backward.update(row, value)
    assert forward.values == pytest.approx(backward.values, abs=1e-9)


def learned(forgetting: float) -> tuple[Rls, np.random.Generator]:
    rng = np.random.default_rng(7)
    rls = Rls([0.0] * 3, [1e4] * 3, forgetting)
    for v in rng.uniform(-0.45, 0.45, 4000).tolist():
        rls.update(regressor(v), force(v) + 0.2 * rng.standard_normal())
    return rls, rng


@pytest.mark.parametrize("keep", [0.95, 0.999])
def test_forgets_as_directional_forgetting_does(keep: float) -> None:
    """Kulhavy and Zarrop 1993, "On a general concept of forgetting": the covariance grows only along the regressor."""
    rng = np.random.default_rng(5)
    rls = Rls([0.0] * 3, [30.0] * 3, keep)
    theta, P, squares, weight = np.zeros(3), 900.0 * np.eye(3), 0.0, 0.0
    for x in np.vstack([rng.standard_normal((60, 3)), 0.01 * rng.standard_normal((20, 3))]):
        y = float(x @ TRUTH + rng.standard_normal())
        rls.update(x.tolist(), y)
        information, error = float(x @ P @ x), y - float(x @ theta)
        theta = theta + P @ x * error / (1.0 + information)
        squares, weight = keep * squares + error**2 / (1.0 + information), keep * weight + 1.0
        kept = keep - (1.0 - keep) / information
        if kept > 0.0:
            P = P - np.outer(P @ x, P @ x) / (1.0 / kept + information)
    assert rls.values == pytest.approx(theta.tolist(), rel=1e-9)
    assert rls.unit_covariance == pytest.approx(P, rel=1e-9)
    assert rls.weight == pytest.approx(weight)
    assert rls.samples == 80
    assert rls.variance == pytest.approx(squares / (weight * (1.0 - 3 / 80)))


@pytest.mark.parametrize("speeds", [(0.0,), (0.3,), (0.1, 0.2)], ids=["parked", "one speed", "one direction"])
def test_does_not_wind_up_without_excitation(speeds: tuple[float, ...]) -> None:
    rls, rng = learned(0.99)
    before = np.diag(rls.unit_covariance).copy()
    noise = rng.standard_normal(MANY) * 0.2
    for index, e in enumerate(noise.tolist()):
        v = speeds[index % len(speeds)]
        rls.update(regressor(v), force(v) + e)
    assert all(math.isfinite(value) for value in rls.values)
    assert np.all(np.diag(rls.unit_covariance) <= before * (1.0 + 1e-9))
    assert np.all(np.linalg.eigvalsh(rls.unit_covariance) > 0.0)
    # "Right": the drag at the tested speeds is still that of the vehicle, within the memory's own noise.
    for v in (0.2, 0.4):
        drag = sum(k * x for k, x in zip(rls.values, regressor(v), strict=True))
        assert drag == pytest.approx(force(v), abs=0.25)


def test_stays_definite_under_rich_excitation_with_forgetting() -> None:
    rng = np.random.default_rng(3)
    rls = Rls([0.0] * 3, [1e4] * 3, 0.99)
    for v in rng.uniform(-0.45, 0.45, MANY).tolist():
        rls.update(regressor(v), force(v) + 0.2 * rng.standard_normal())
    assert np.all(np.linalg.eigvalsh(rls.unit_covariance) > 0.0)
    drag = sum(k * x for k, x in zip(rls.values, regressor(0.4), strict=True))
    assert drag == pytest.approx(force(0.4), abs=0.3)


def test_follows_a_vehicle_that_changes() -> None:
    rls, rng = learned(0.99)
    for v in rng.uniform(-0.45, 0.45, 4000).tolist():
        rls.update(regressor(v), 1.5 * force(v) + 0.2 * rng.standard_normal())
    drag = sum(k * x for k, x in zip(rls.values, regressor(0.4), strict=True))
    assert drag == pytest.approx(1.5 * force(0.4), rel=0.05)


def test_information_of_a_sample_can_be_asked_without_learning() -> None:
    rls, _ = learned(1.0)
    before = rls.values
    innovation, information = rls.evaluate(regressor(0.2), force(0.2) + 3.0)
    assert rls.values == before
    assert innovation == pytest.approx(3.0, abs=0.1)
    x = np.array(regressor(0.2))
    assert information == pytest.approx(x @ rls.unit_covariance @ x)


def test_a_copy_learns_by_itself() -> None:
    """The identifier judges a copy of its session, while the session learns on."""
    rls, _ = learned(0.99)
    before = (rls.values, rls.samples, rls.unit_covariance)
    judged = copy.deepcopy(rls)
    rls.update(regressor(0.3), force(0.3) + 5.0)
    assert (judged.values, judged.samples) == before[:2]
    assert np.array_equal(judged.unit_covariance, before[2])
    assert rls.values != before[0]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_refuses_what_is_not_a_number(bad: float) -> None:
    rls, _ = learned(0.99)
    before = (rls.values, rls.samples)
    rls.update((bad, 0.1, 1.0), 1.0)
    rls.update((0.1, 0.1, 1.0), bad)
    assert (rls.values, rls.samples) == before


@pytest.mark.parametrize(
    ("values", "sigmas", "forgetting", "sentence"),
    [
        ([0.0], [1.0, 1.0], 1.0, "1 values and 2 sigmas"),
        ([], [], 1.0, "0 values"),
        ([0.0], [0.0], 1.0, "above zero"),
        ([0.0], [math.inf], 1.0, "finite"),
        ([0.0], [1.0], 1.1, "at most 1"),
        ([0.0], [1.0], 0.0, "above 0"),
    ],
)
def test_a_senseless_start_is_refused(
    values: list[float], sigmas: list[float], forgetting: float, sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        Rls(values, sigmas, forgetting)
