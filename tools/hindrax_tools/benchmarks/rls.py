"""Speed of one recursive least-squares update with three and six parameters, compared with other libraries."""

from __future__ import annotations

from importlib.metadata import version
from itertools import cycle
from typing import Any

import numpy as np
import padasip
from filterpy.kalman import KalmanFilter
from sysidentpy.parameter_estimation import RecursiveLeastSquares

from hindrax_ident.arrays import Array
from hindrax_ident.online.rls import Rls
from hindrax_tools.benchmarks import median_us, row

SAMPLES, REPEATS = 400, 9
WINDOW = 100
SEED = 1


def rows() -> list[dict[str, Any]]:
    """One row per number of parameters and peer: name, ours_us, peer, peer_us, ratio. Medians over repeats."""
    return [one for n in (3, 6) for one in _compared(n)]


def _compared(n: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(SEED)
    X = rng.standard_normal((SAMPLES, n))
    y = X @ np.arange(1.0, n + 1.0) + 0.1 * rng.standard_normal(SAMPLES)
    ours = _ours_us(X, y)
    peers = {
        f"filterpy {version('filterpy')} KalmanFilter": _filterpy_us(X, y),
        f"padasip {version('padasip')} FilterRLS": _padasip_us(X, y),
        f"sysidentpy {version('sysidentpy')} RecursiveLeastSquares": _sysidentpy_us(X, y),
        f"numpy lstsq, {WINDOW} samples again": _lstsq_us(X, y),
    }
    return [row(f"rls-{n}", ours, name, theirs) for name, theirs in peers.items()]


def _ours_us(X: Array, y: Array) -> float:
    rls = Rls([0.0] * X.shape[1], [1e4] * X.shape[1])
    samples = cycle([(tuple(row), value) for row, value in zip(X.tolist(), y.tolist(), strict=True)])
    return median_us(lambda: rls.update(*next(samples)), SAMPLES, REPEATS)


def _filterpy_us(X: Array, y: Array) -> float:
    n = X.shape[1]
    kalman = KalmanFilter(dim_x=n, dim_z=1)
    kalman.P *= 1e4
    samples = cycle(zip(X[:, None, :], y, strict=True))

    def update() -> None:
        row, value = next(samples)
        kalman.update(value, R=1.0, H=row)

    return median_us(update, SAMPLES, REPEATS)


def _padasip_us(X: Array, y: Array) -> float:
    rls = padasip.filters.FilterRLS(X.shape[1], mu=0.999)
    samples = cycle(zip(X, y, strict=True))

    def update() -> None:
        row, value = next(samples)
        rls.adapt(value, row)

    return median_us(update, SAMPLES, REPEATS)


def _sysidentpy_us(X: Array, y: Array) -> float:
    """Whole batches only: its time is divided by the number of samples."""
    estimator = RecursiveLeastSquares(lam=0.999)
    return median_us(lambda: estimator.optimize(X, y[:, None]), 1, REPEATS) / SAMPLES


def _lstsq_us(X: Array, y: Array) -> float:
    A, b = X[:WINDOW], y[:WINDOW]
    return median_us(lambda: np.linalg.lstsq(A, b, rcond=None), SAMPLES, REPEATS)
