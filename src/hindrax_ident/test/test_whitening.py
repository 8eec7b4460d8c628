"""Whitening by a Kalman filter, against the covariance of the residuals written out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from hindrax_ident.arrays import Array
from hindrax_ident.fit.noise_likelihood import fit_noise
from hindrax_ident.fit.whitening import ErrorDynamics, Noise, Whitener, gains, transitions

MEMORY_S = 0.15


def error_dynamics_of(
    n: int,
    rng: np.random.Generator,
    channels: tuple[int, ...] = (0,),
    *,
    damping: float = 1.2,
    stiffness: float = 0.0,
    starts: tuple[int, ...] = (0,),
) -> ErrorDynamics:
    flags = np.zeros(n, bool)
    flags[list(starts)] = True
    steps = np.where(flags, 0.0, rng.uniform(0.02, 0.06, n))
    channel = rng.choice(channels, n).astype(np.intp)
    thrust = np.repeat(rng.uniform(0.0, 4.0, n // 20 + 1), 20)[:n]
    damped, stiff = np.full(n, damping), np.full(n, stiffness)
    return ErrorDynamics(channel, flags, steps, damped, stiff, np.ones(n, bool), thrust, MEMORY_S)


def moved(chain: ErrorDynamics, k: int) -> tuple[Array, Array]:
    """Transition and gained covariance over one step, for unit density: Van Loan 1978, IEEE TAC 23."""
    rate = 1.0 / chain.memory_s
    F = np.array([[-chain.damping[k], -chain.stiffness[k], 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -rate]])
    drive = np.diag([0.0, 0.0, rate * rate])
    block = expm(np.block([[-F, drive], [np.zeros((3, 3)), F.T]]) * chain.step_s[k])
    A = block[3:, 3:].T
    return A, A @ block[:3, 3:]


def covariance_of(chain: ErrorDynamics, noise: Noise) -> Array:
    """Covariance of the residuals: noise of each measurement, and what unknown forces have done to the motion."""
    n = len(chain.step_s)
    density = noise.force + noise.thrust * chain.thrust
    P, moves = np.zeros((3, 3)), [moved(chain, k) for k in range(n)]
    C = np.diag(np.where(chain.channel == 0, noise.velocity, noise.position))
    for k in range(n):
        A, Q = moves[k]
        if chain.starts[k]:
            P = np.diag([0.0, 0.0, density[k] / (2.0 * chain.memory_s)])
        else:
            P = A @ P @ A.T + density[k] * Q
        reach = np.eye(3)
        for later in range(k, n):
            if chain.starts[later] and later > k:
                break
            if later > k:
                reach = moves[later][0] @ reach
            C[k, later] += (P @ reach.T)[chain.channel[k], chain.channel[later]]
            C[later, k] = C[k, later]
    return C


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


def test_a_measurement_that_does_not_count_changes_nothing() -> None:
    rng = np.random.default_rng(2)
    chain = error_dynamics_of(30, rng)
    table = rng.standard_normal((30, 1))
    counts = chain.counts.copy()
    counts[10] = False
    left_out = replace(chain, counts=counts)
    spoiled = table.copy()
    spoiled[10] = 1e6
    noise = Noise(1e-4, 1.0, 3e-4)
    assert Whitener(left_out, noise)(spoiled) == pytest.approx(Whitener(left_out, noise)(table))
    assert Whitener(left_out, noise)(table)[10] == 0.0


def test_a_long_step_is_as_exact_as_a_short_one() -> None:
    rng = np.random.default_rng(4)
    chain = error_dynamics_of(6, rng, stiffness=4.0)
    chain = replace(chain, step_s=np.array([0.0, 0.02, 1.0, 0.3, 0.6, 0.05]))
    A, Q = transitions(chain)
    for k in range(1, 6):
        expected = moved(chain, k)
        assert A[k] == pytest.approx(expected[0], abs=1e-5), k
        assert Q[k] == pytest.approx(expected[1], abs=1e-5), k


@pytest.mark.parametrize(("force", "thrust"), [(0.0, 0.0), (1e-4, 0.0), (1e-2, 0.0), (0.0, 1e-2), (1e-3, 1e-3)])
def test_noise_is_found_again(force: float, thrust: float) -> None:
    rng = np.random.default_rng(8)
    n = 4000
    chain = error_dynamics_of(n, rng)
    A, Q = transitions(chain)
    density = force + thrust * chain.thrust
    state = np.array([0.0, 0.0, np.sqrt(density[0] / (2.0 * MEMORY_S)) * rng.standard_normal()])
    residual = np.zeros(n)
    for k in range(n):
        gained = np.linalg.cholesky(Q[k] * density[k] + 1e-18 * np.eye(3))
        state = A[k] @ state + gained @ rng.standard_normal(3)
        residual[k] = state[0] + 0.01 * rng.standard_normal()
    found = fit_noise(chain, residual, Noise(1e-3, 1e-3, 1e-3))
    assert found.velocity == pytest.approx(1e-4, rel=0.1)
    total = float(chain.density(found).mean())
    assert total == pytest.approx(float(density.mean()), rel=0.35, abs=4e-6)
    part = found.thrust * float(chain.thrust.mean()) / max(total, 1e-9)
    if force + thrust > 1e-3:
        assert part == pytest.approx(thrust * float(chain.thrust.mean()) / float(density.mean()), abs=0.3)


def test_a_candidate_whose_filter_diverges_is_never_the_most_likely() -> None:
    rng = np.random.default_rng(1)
    chain = error_dynamics_of(400, rng, damping=-1000.0)
    found = fit_noise(chain, rng.normal(size=400), Noise())
    assert math.isfinite(found.velocity)
    assert found.velocity > 0.1, "no confidence from a sum that is not a number"


def test_gain_is_between_nothing_and_all() -> None:
    rng = np.random.default_rng(3)
    chain = error_dynamics_of(200, rng)
    K, S = gains(chain, transitions(chain), Noise(1e-4, 1.0, 1e-3))
    assert np.all((K[:, 0] >= 0.0) & (K[:, 0] < 1.0))
    assert np.all(S >= 0.01)
