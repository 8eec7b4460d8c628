"""Estimates that must respect bounds: the most likely parameters within them, given mean and covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hindrax_ident.arrays import Array


def bounded(values: Array, covariance: Array, low: Sequence[float], high: Sequence[float]) -> Array:
    """Most likely parameters within [low, high]: (p,).

    One bound after the other is made exact, the worst violated first, and the others follow along their correlation.
    Bounds that hold cost nothing: within them the values come back as they are.
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
