"""Whitening of rows: what a disturbed vehicle leaves in them is predicted, and what is left is white."""

import math

import numpy as np
import pytest

from hindrax_ident.arrays import Array
from hindrax_ident.online.filtered_regression import LEAST_NOISE, THRUST_NOISE_S, UNKNOWN, RowWhitener

STEP_S, POLE, LAG_S, MASS, MOMENT_Nm = 0.015, 1.3, 0.15, 0.7, 2.0


def disturbed(seed: int, acting: Array) -> tuple[Array, Array]:
    """Rows y of a vehicle at rest behind the filter, in rad/s, and the disturbance in them: (n,) each."""
    rng = np.random.default_rng(seed)
    inner = 20
    h = STEP_S / inner
    pushed = moved = 0.0
    kept = []
    for on in acting:
        for _ in range(inner):
            white = rng.standard_normal() * math.sqrt(THRUST_NOISE_S / h) * MOMENT_Nm / MASS * on
            pushed += h / LAG_S * (white - pushed)
            moved += h * (pushed - POLE * moved)
        kept.append(moved)
    moves = np.array(kept)
    return moves + LEAST_NOISE * rng.standard_normal(len(moves)), moves


def whitened(rows: Array, acting: Array) -> tuple[Array, Array]:
    """Whitened rows [rad/s] and their weights [-]: (n,) each."""
    whitener, out = RowWhitener(2, LAG_S, MASS), []
    for index, (y, on) in enumerate(zip(rows, acting, strict=True)):
        whitener.effort(index * STEP_S, on * MOMENT_Nm**2)
        whitener.advance((index + 1) * STEP_S, POLE)
        *_, new = whitener.unpredicted((1.0, y))
        out.append((new * whitener.scale, whitener.scale))
        whitener.update([0.0, new])
    values, scales = np.array(out).T
    return values, scales


def correlation(values: Array) -> float:
    return float(np.corrcoef(values[1:], values[:-1])[0, 1])


def test_what_is_left_of_disturbed_rows_is_white_noise_of_the_velocity() -> None:
    acting = np.ones(6000)
    rows, _ = disturbed(1, acting)
    assert correlation(rows) > 0.95
    left, scales = whitened(rows, acting)
    assert abs(correlation(left[100:])) < 0.05
    assert left[100:].std() == pytest.approx(LEAST_NOISE, rel=0.05)
    assert scales[-1] < 0.9


def test_thrusters_at_rest_disturb_nobody_and_their_rows_count_in_full() -> None:
    acting = np.array([1.0] * 2000 + [0.0] * 400)
    rows, _ = disturbed(2, acting)
    left, scales = whitened(rows, acting)
    assert scales[1999] < 0.9
    assert scales[-1] > 0.99
    assert left[-200:].std() == pytest.approx(LEAST_NOISE, rel=0.15)


def test_the_first_row_after_a_restart_only_shows_the_disturbance() -> None:
    whitener = RowWhitener(2, LAG_S, MASS)
    for t_s in (0.0, STEP_S):
        whitener.effort(t_s, 0.0)
        whitener.advance(t_s, POLE)
    assert whitener.scale == pytest.approx(1.0 / math.sqrt(UNKNOWN), rel=0.05)
    whitener.update(whitener.unpredicted((3.0, 5.0)))
    assert whitener.unpredicted((3.0, 5.0)) == pytest.approx([0.0, 0.0], abs=1e-4)
    whitener.restart()
    assert whitener.unpredicted((3.0, 5.0)) == [3.0, 5.0]


@pytest.mark.parametrize("lag_s", [0.0, 1.0 / POLE])
def test_no_lag_and_a_lag_like_the_filter_give_finite_weights(lag_s: float) -> None:
    whitener = RowWhitener(1, lag_s, MASS)
    for index in range(200):
        whitener.effort(index * STEP_S, 4.0)
        whitener.advance((index + 1) * STEP_S, POLE)
        whitener.update(whitener.unpredicted((0.0,)))
    assert 0.1 < whitener.scale < 1.0


@pytest.mark.parametrize("effort", [1e300, math.inf, math.nan])
def test_an_effort_that_cannot_be_is_forgotten_again(effort: float) -> None:
    whitener = RowWhitener(1, LAG_S, MASS)
    for index in range(2000):
        whitener.effort(index * STEP_S, effort if index < 3 else 0.0)
        whitener.advance((index + 1) * STEP_S, POLE)
        whitener.update(whitener.unpredicted((0.1,)))
    assert whitener.scale > 0.9


def adapted(rows: Array, acting: Array, most: float = 1.0) -> RowWhitener:
    """A whitener that has followed the innovations of rows [rad/s]."""
    whitener = RowWhitener(1, LAG_S, MASS)
    for index, (y, on) in enumerate(zip(rows.tolist(), acting.tolist(), strict=True)):
        whitener.effort(index * STEP_S, on * MOMENT_Nm**2)
        whitener.advance((index + 1) * STEP_S, POLE)
        (new,) = whitener.unpredicted((y,))
        whitener.adapt(new * whitener.scale, most)
        whitener.update([new])
    return whitener


@pytest.mark.parametrize("noise", [LEAST_NOISE, 0.01, 0.02])
def test_the_noise_of_a_velocity_beside_that_of_the_thrust_is_found(noise: float) -> None:
    acting = np.ones(6000)
    _, moves = disturbed(3, acting)
    rows = moves + noise * np.random.default_rng(4).standard_normal(len(moves))
    assert adapted(rows, acting).noise == pytest.approx(noise, rel=0.3)
    assert adapted(rows, acting, 0.5 * noise).noise <= max(LEAST_NOISE, 0.5 * noise)


def test_forces_that_nobody_knows_are_no_noise_of_the_velocity() -> None:
    acting = np.ones(3000)
    _, moves = disturbed(5, acting)
    assert adapted(30.0 * moves, acting).noise == LEAST_NOISE


def test_what_was_before_a_gap_is_not_alike() -> None:
    whitener = RowWhitener(1, LAG_S, MASS)
    for index in range(200):
        whitener.adapt(0.01 * (-1.0) ** index, 1.0)
    grown = whitener.noise
    assert grown > 3.0 * LEAST_NOISE
    whitener.restart()
    whitener.adapt(1e6, math.inf)
    assert whitener.noise == pytest.approx(grown, rel=0.05)
