"""Estimates within bounds: the most likely ones, not just clipped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from hindrax_ident.arrays import Array
from hindrax_ident.model.model_parameters import bounded


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_one_violated_bound_gives_the_constrained_optimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 3))
    C, mean = A @ A.T + 0.1 * np.eye(3), rng.standard_normal(3)
    low = [mean[0] + 0.5, -np.inf, -np.inf]
    W = np.linalg.inv(C)

    def cost(x: Array) -> float:
        return float((x - mean) @ W @ (x - mean))

    def gradient(x: Array) -> Array:
        return 2.0 * W @ (x - mean)

    best = minimize(
        cost,
        mean + 1.0,
        jac=gradient,
        bounds=[(low[0], None), (None, None), (None, None)],
        options={"ftol": 1e-14, "gtol": 1e-10},
    )
    assert bounded(mean, C, low) == pytest.approx(best.x, abs=1e-4)


def test_within_bounds_nothing_changes() -> None:
    values = np.array([1.0, 2.0, 3.0])
    assert bounded(values, np.eye(3), [0.0] * 3).tolist() == values.tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_result_is_always_within(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((4, 4))
    out = bounded(rng.standard_normal(4) * 3.0, A @ A.T + 0.01 * np.eye(4), [-1.0] * 4)
    assert np.all(out >= -1.0)
