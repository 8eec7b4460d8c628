"""Whitening of residuals of a simulated motion by a Kalman filter.

A residual is measurement noise plus the effect of unknown forces (thrust noise, eddies) on the motion, which decays
with the drag. Thruster lag filters the thrust noise, so an unknown force is correlated over that time; and thrust noise
grows with the thrust, so part of its density is proportional to the squared thrust. One state stands for all unknown
forces, so eddies are given the memory of the thrust noise; that theirs is as long is assumed. The filter of the
linearized error (velocity, position, unknown acceleration) predicts each residual from the previous ones; the
innovations are white. The same filter runs over every column of the sensitivities, so least squares on the result is
maximum likelihood to first order (Ljung 1999, sections 4.3 and 7.4). Without unknown forces it is plain output error.

Symbols. The error x = (v, s, a): velocity [m/s], position [m] and unknown acceleration [m/s^2] (rad for turning) of the
simulated motion against the true one. Between two measurements

    v' = -d v - k s + a,    s' = v,    a' = -a / T + white noise of density q / T^2

with d, k from `ErrorDynamics`, T = memory_s and q = `ErrorDynamics.density`. Over a step, x+ = A x + w, cov w = q Q.
P = cov x is symmetric: vv, vs, va, ss, sa, aa name its upper triangle. A measurement is y = H x + noise, where H picks
v (channel 0) or s (channel 1); S is the variance of its innovation, K = P H' / S the gain. n measurements, m columns.
"""

import math
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Flags, Index, array
from hindrax_ident.model.thrust_lag import LEAST_MEMORY_S

NEGLIGIBLE_Hz = 1e-4
"""Density of the unknown acceleration, in measurement variances, below which it is neglected."""
SHORT_STEP = 0.1
"""Step, in units of the fastest time constant, over which the series of the transition is exact."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Variances of measured velocity and position; density of the unknown acceleration [m^2/s^3, rad^2/s^3].

    `thrust` [s]: density proportional to the thrust, per squared acceleration due to the thrusters.
    """

    velocity: float = 1.0
    position: float = 1.0
    force: float = 0.0
    thrust: float = 0.0


@dataclass(frozen=True, slots=True)
class ErrorDynamics:
    """Measurements of all stretches in time order, (n,) each, and the linearized error dynamics between them.

    `channel`: 0 velocity, 1 position; `step_s`: time since the previous one, zero at a start; `damping` and
    `stiffness`: d and k of the error's v' = -d v - k s + a at the measurement [1/s, 1/s^2]; `counts`: false for
    outliers; `thrust`: sum of the squared accelerations due to the thrusters over the step [m^2/s^4, rad^2/s^4];
    `memory_s`: time constant of the unknown acceleration a.
    """

    channel: Index
    starts: Flags
    step_s: Array
    damping: Array
    stiffness: Array
    counts: Flags
    thrust: Array
    memory_s: float

    def density(self, noise: Noise) -> Array:
        """Density of the unknown acceleration over each step: (n,) [m^2/s^3, rad^2/s^3]."""
        return noise.force + noise.thrust * self.thrust


@np.errstate(over="ignore", invalid="ignore")  # parameters that make the error grow for ever; they are not finite then
def transitions(chain: ErrorDynamics) -> tuple[Array, Array]:
    """Transition of the error (v, s, a) over each step, and its covariance for unit density.

    The matrix exponential of F h for every measurement at once: d and k change along the path, so there are thousands
    of different ones (SciPy takes them one by one: 8 s for 5000; this, 6 ms). So: a Taylor series over h = step /
    2^doublings, short enough that its error stays below 1e-7, and squaring back. The covariance

        Q(h) = integral of e^(F u) D e^(F' u) du from 0 to h,   D = diag(0, 0, 1 / T^2)

    is Simpson's rule over the short step; Q(2h) = Q(h) + A Q(h) A' then doubles it along with A.

    Parameters
    ----------
    chain
        Of n measurements: d, k, steps and the memory T.

    Returns
    -------
    tuple[Array, Array]
        A and Q: (n, 3, 3) each, SI.
    """
    n, rate = len(chain.step_s), 1.0 / max(LEAST_MEMORY_S, chain.memory_s)
    fastest = rate + float(np.abs(chain.damping).max() + np.sqrt(np.abs(chain.stiffness).max()))
    doublings = math.ceil(math.log2(max(1.0, fastest * float(chain.step_s.max()) / SHORT_STEP)))
    h = chain.step_s / 2**doublings
    F = np.zeros((n, 3, 3))
    F[:, 0, 0], F[:, 0, 1], F[:, 0, 2] = -chain.damping * h, -chain.stiffness * h, h
    F[:, 1, 0], F[:, 2, 2] = h, -rate * h
    drive = np.zeros((3, 3))
    drive[2, 2] = rate * rate
    A, middle = _series(F), _series(0.5 * F)
    at_middle, at_end = middle @ drive @ middle.mT, A @ drive @ A.mT
    Q = h[:, None, None] / 6.0 * (drive + 4.0 * at_middle + at_end)
    for _ in range(doublings):
        Q = Q + A @ Q @ A.mT
        A = A @ A
    return A, Q


def _series(F: Array) -> Array:
    """Matrix exponential to fourth order: (n, 3, 3). Its error is SHORT_STEP^5 / 120 of the step at most."""
    square = F @ F
    return np.eye(3) + F + square / 2.0 + F @ square / 6.0 + square @ square / 24.0


def gains(chain: ErrorDynamics, transition: tuple[Array, Array], noise: Noise) -> tuple[Array, Array]:
    """Kalman gains, and standard deviations of the innovations.

    They depend on the noise and on which channel is measured when, not on the residuals: computed once per noise, they
    serve all columns. Velocity and position at the start of a stretch count as exact: their errors are nuisance
    parameters, and `output_error_problem` projects them out. The unknown acceleration starts at its stationary variance
    q / (2 T).

    Parameters
    ----------
    chain
        Of n measurements; one that does not count (an outlier) has no gain: the filter predicts across it.
    transition : (n, 3, 3), (n, 3, 3)
        A and Q of `transitions`.
    noise
        Variances of both channels, and the density q.

    Returns
    -------
    tuple[Array, Array]
        Gains (n, 3) of v, s and a; deviations (n,) [m/s, rad/s, m, rad].
    """
    A, Q = transition
    density, variances = chain.density(noise), (noise.velocity, noise.position)
    grown = Q * density[:, None, None]
    first = (density / (2.0 * max(LEAST_MEMORY_S, chain.memory_s))).tolist()
    rows = zip(
        chain.channel.tolist(),
        chain.starts.tolist(),
        chain.counts.tolist(),
        first,
        A[:, :2].reshape(len(A), 6).tolist(),
        A[:, 2, 2].tolist(),
        grown.reshape(len(A), 9).tolist(),
        strict=True,
    )
    # Scalars of the upper triangle instead of 3 by 3 products: to start a numpy product takes longer than to compute
    # it, and this loop runs for every noise that a fit tries. The last row of A is (0, 0, g).
    vv = vs = ss = va = sa = aa = 0.0
    K, S = [], []
    for channel, start, counts, begin, (a, b, e, c, d, f), g, (qvv, qvs, qva, _, qss, qsa, _, _, qaa) in rows:
        if start:
            vv = vs = ss = va = sa = 0.0
            aa = begin
        else:
            # P+ = A P A' + q Q: first both rows of A P that are needed, then their products with the rows of A.
            pv, ps, pa = a * vv + b * vs + e * va, a * vs + b * ss + e * sa, a * va + b * sa + e * aa
            rv, rs, ra = c * vv + d * vs + f * va, c * vs + d * ss + f * sa, c * va + d * sa + f * aa
            vv, vs, va = pv * a + ps * b + pa * e + qvv, pv * c + ps * d + pa * f + qvs, pa * g + qva
            ss, sa, aa = rv * c + rs * d + ra * f + qss, ra * g + qsa, g * g * aa + qaa
        # P H' is the column of P that belongs to the channel; P - K (P H')' is the covariance after the measurement.
        hv, hs, ha = (vs, ss, sa) if channel else (vv, vs, va)
        total = (ss if channel else vv) + variances[channel]
        S.append(total)
        if not counts:
            K.append((0.0, 0.0, 0.0))
            continue
        kv, ks, ka = hv / total, hs / total, ha / total
        K.append((kv, ks, ka))
        vv, vs, va = vv - kv * hv, vs - kv * hs, va - kv * ha
        ss, sa, aa = ss - ks * hs, sa - ks * ha, aa - ka * ha
    return np.array(K), np.sqrt(S)


class Whitener:
    """The filter for one chain and one noise, computed once and applied to many columns."""

    __slots__ = ("_A", "_K", "_chain", "_weight", "noise")

    def __init__(self, chain: ErrorDynamics, noise: Noise) -> None:
        """With negligible unknown forces, whitening is only scaling."""
        self._chain, self.noise = chain, noise
        self._A: Array | None = None
        scale = np.where(chain.channel == 0, math.sqrt(noise.velocity), math.sqrt(noise.position))
        if float(chain.density(noise).mean()) > NEGLIGIBLE_Hz * min(noise.velocity, noise.position):
            transition = transitions(chain)
            self._A = transition[0]
            self._K, scale = gains(chain, transition, noise)
        self._weight = (chain.counts / scale)[:, None]

    def __call__(self, table: Array) -> Array:
        """Innovations of each column in units of their standard deviation: (n, m) to (n, m); zero for outliers."""
        if self._A is None:
            return array(table * self._weight)
        return array((table - _predicted(self._chain, self._A, self._K, table)) * self._weight)


def _predicted(chain: ErrorDynamics, A: Array, K: Array, table: Array) -> Array:
    """Predicted measurements for all columns, from one banded system: (n, m).

    The filter's predicted states obey x_k = A_k ((I - K H) x_(k-1) + K y_(k-1)), zero at each start. That is one lower
    banded linear system in all 3 n states with the m columns as right-hand sides, so LAPACK runs the recursion once for
    all columns: a third of the time of a loop over the measurements for the eight columns of a usual fit.
    """
    n, m = table.shape
    inside = ~chain.starts[1:]
    H = np.eye(3)[chain.channel]
    corrected = np.eye(3) - K[:, :, None] * H[:, None, :]
    moved = (A[1:] @ corrected[:-1]) * inside[:, None, None]
    drive = np.zeros((n, 3, m))
    drive[1:] = (A[1:] @ K[:-1, :, None]) @ table[:-1, None, :]
    drive[chain.starts] = 0.0
    # Row 3 k + i, column 3 (k - 1) + j of the lower band lies 3 + i - j below the diagonal.
    bands = np.zeros((6, 3 * n))
    bands[0] = 1.0
    for i in range(3):
        for j in range(3):
            bands[3 + i - j, j : 3 * n - 3 : 3] = -moved[:, i, j]
    # Of a triangle with ones on its diagonal: a general banded solver would factor it first, in six times the time.
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415  # slow, and the live estimate does without

    states, _ = dtbtrs(bands, drive.reshape(3 * n, m), uplo="L", diag="U")
    return array(states.reshape(n, 3, m)[np.arange(n), chain.channel])
