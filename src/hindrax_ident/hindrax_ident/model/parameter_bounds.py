"""Bounded estimates: the most likely parameters within bounds, given mean and covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hindrax_ident.arrays import Array


def bounded(values: Array, covariance: Array, low: Sequence[float], high: Sequence[float]) -> Array:
    """Most likely parameters within [low, high]: (p,), in the units of `values`.

    The most violated bound is enforced first; the other parameters follow through their correlation, then the next
    bound is enforced. Values within all bounds are returned unchanged.
    """
    theta, C = np.array(values, float), np.array(covariance, float)
    if all(a <= x <= b for a, x, b in zip(low, theta.tolist(), high, strict=True)):
        return theta
    for _ in range(len(theta)):
        sigma = np.sqrt(np.maximum(np.diag(C), 0.0))
        excess = np.abs(theta - np.clip(theta, low, high)) / np.where(sigma > 0.0, sigma, np.inf)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            break
        limits = np.clip(theta, low, high)
        gain = C[:, worst] / C[worst, worst]
        theta = theta + gain * (limits[worst] - theta[worst])
        theta[worst] = limits[worst]
        C = C - np.outer(gain, C[worst])
        C[worst, :] = C[:, worst] = 0.0
    return np.asarray(np.clip(theta, low, high))
