"""Covariance of the residuals of a simulated motion, written out in full: Kalman filters are held against it."""

import functools

import numpy as np
from scipy.linalg import expm

from hindrax_ident.arrays import Array
from hindrax_ident.fit.whitening import ErrorDynamics, Noise

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
    """A chain of measurements at uneven steps, of velocities (0) or positions (1) at random."""
    flags = np.zeros(n, bool)
    flags[list(starts)] = True
    steps = np.where(flags, 0.0, rng.uniform(0.02, 0.06, n))
    channel = rng.choice(channels, n).astype(np.intp)
    thrust = np.repeat(rng.uniform(0.0, 4.0, n // 20 + 1), 20)[:n]
    damped, stiff = np.full(n, damping), np.full(n, stiffness)
    return ErrorDynamics(channel, flags, steps, damped, stiff, np.ones(n, bool), thrust, MEMORY_S)


def moved(chain: ErrorDynamics) -> tuple[Array, Array]:
    """Transitions and gained covariances over each step, for unit density: (n, 3, 3) each."""
    steps = zip(chain.step_s.tolist(), chain.damping.tolist(), chain.stiffness.tolist(), strict=True)
    A, Q = zip(*(_moved(*one, chain.memory_s) for one in steps), strict=True)
    return np.array(A), np.array(Q)


@functools.cache
def _moved(step_s: float, damping: float, stiffness: float, memory_s: float) -> tuple[Array, Array]:
    """Transition and gained covariance of one step: Van Loan 1978, IEEE TAC 23."""
    rate = 1.0 / memory_s
    F = np.array([[-damping, -stiffness, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -rate]])
    drive = np.diag([0.0, 0.0, rate * rate])
    block = expm(np.block([[-F, drive], [np.zeros((3, 3)), F.T]]) * step_s)
    A = block[3:, 3:].T
    return A, A @ block[:3, 3:]


def covariance_of(chain: ErrorDynamics, noise: Noise, wide: float = 0.0) -> Array:
    """Noise of each measurement, and what unknown forces have done to the motion: (n, n).

    `wide`: variance of velocity and position at the start of each stretch.
    """
    n = len(chain.step_s)
    density, at = noise.force + noise.thrust * chain.thrust, chain.channel
    C = np.diag(np.where(at == 0, noise.velocity, noise.position))
    P, with_earlier = np.zeros((3, 3)), np.zeros((3, n))
    for k, (A, Q) in enumerate(zip(*moved(chain), strict=True)):
        if chain.starts[k]:
            P, with_earlier[:] = np.diag([wide, wide, density[k] / (2.0 * chain.memory_s)]), 0.0
        else:
            P, with_earlier = A @ P @ A.T + density[k] * Q, A @ with_earlier
        with_earlier[:, k] = P[:, at[k]]
        C[k, :k] = C[:k, k] = with_earlier[at[k], :k]
        C[k, k] += P[at[k], at[k]]
    return C
