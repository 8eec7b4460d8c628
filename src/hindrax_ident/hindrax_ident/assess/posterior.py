"""Posterior of coefficients and drag: the fit, corrected by what is probable of each influence, with its interval.

A known systematic effect is corrected (GUM, JCGM 100, 3.2.4 and 6.3), and where its distribution is not normal the
interval is that of the distribution (JCGM 101, propagation by draws). What is known of the influences is the mixture of
explanations of `uncertainty_budget`, in which losses are normal; here they get the distribution that they have: evenly
anywhere between nothing and their greatest. The explanations are the proposal of an importance sampling.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import Interval

DRAWS = 8192
SEED = 68
"""Of all draws, so that the same record always gives the same numbers."""
NORMAL_SHARE = 0.25
"""Share of the prior of a loss that is normal, of the same mean and deviation: no limit is sure, and what no row has
may look like a gain."""
WITHIN_68, WITHIN_95 = 0.6827, 0.95
UNIFORM_OVER_NORMAL = math.sqrt(math.tau / 12.0)
"""Density of a uniform distribution over that of the normal one of its mean and deviation, at the mean."""
STAND_IN = 3.0
"""Prior deviations beyond which an influence stands in for what no row has: its size counts, and not its sign."""
GAIN = -0.5
"""Loss, in its prior deviations, below which it is a gain: that stands in for what no row has as well."""
LOSSLESS = 0.25
"""Probability that a force that nobody computed from thrusters has no losses: a simulation has none, and one that was
measured in the water is free of them. With it both hold: records without any, and of propellers in MuJoCo (ADR 31)."""


class Explanations(NamedTuple):
    """Mixture of what is known of m influences after a record, from e normal explanations.

    `weight` (e,), `mean` (e, m), `covariance` (e, m, m). Of their prior, which was normal: `usual` and `spread` (e, m).
    `loss` (m,): 1 where the influence acts in one direction.
    """

    weight: Array
    mean: Array
    covariance: Array
    usual: Array
    spread: Array
    loss: Array


class Draws(NamedTuple):
    """Weighted draws of the posterior: `influences` (n, m), `noise` (n, p) of the parameters, `weight` (n,)."""

    influences: Array
    noise: Array
    weight: Array

    def interval(self, values: Array) -> Interval:
        """Of quantities drawn with these, (n, k)."""
        order = np.argsort(values, axis=0)
        ordered = np.take_along_axis(values, order, axis=0)
        # The middle of each step of the distribution function.
        weight = self.weight[order]
        below = np.cumsum(weight, axis=0) - 0.5 * weight
        ends = [0.5 * (1.0 + side * share) for share in (WITHIN_68, WITHIN_95) for side in (-1.0, 1.0)]
        found = [array([float(np.interp(end, p, x)) for p, x in zip(below.T, ordered.T, strict=True)]) for end in ends]
        return Interval(self.weight @ values, *found)

    def covariance(self, values: Array) -> Array:
        """Of quantities drawn with these, (n, k): (k, k)."""
        apart = values - self.weight @ values
        return (self.weight[:, None] * apart).T @ apart


def drawn(known: Explanations, noise: Array, lossless: float = 0.0) -> Draws:
    """Draw influences from their posterior, and the noise of the parameters.

    The explanations are the proposal of an importance sampling; the weight of a draw is the prior that a loss really
    has (anywhere between nothing and its greatest) over the normal one that the explanations assume.

    Parameters
    ----------
    known
        Mixture of normal explanations of m influences.
    noise : (p, p)
        Covariance of the parameters by the fit alone.
    lossless : [-]
        Probability, before the record, that no loss acts at all.

    Returns
    -------
    Draws
        DRAWS of them; the seed is fixed, so that a record always gives the same numbers.
    """
    rng = np.random.default_rng(SEED)
    if lossless > 0.0:
        known = _perhaps_lossless(known, lossless)
    m, p = known.mean.shape[1], len(noise)
    standard = rng.standard_normal((DRAWS, m + p))
    # Systematic: each explanation gets its share of the draws, to one.
    share = np.cumsum(known.weight) / known.weight.sum()
    of = np.minimum(np.searchsorted(share, (np.arange(DRAWS) + 0.5) / DRAWS), len(share) - 1)
    influences = np.empty((DRAWS, m))
    for one in np.unique(of).tolist():
        here = of == one
        influences[here] = known.mean[one] + standard[here, :m] @ root(known.covariance[one]).T
    weight = _importance(known, influences, of)
    return Draws(_either_way(influences, known.loss), standard[:, m:] @ root(noise).T, weight)


def _either_way(influences: Array, loss: Array) -> Array:
    """Draws (n, m) in which what is far greater than usual has either sign, all of it together in every other draw.

    A record that contradicts the model is explained by whatever row resembles the contradiction most, at many times
    what that row may be: curves of other thrusters, by an exponent of the drag of one. That is no known effect to
    correct (GUM 3.2.4); the coefficients may be wrong by as much, in either direction. So is a loss that gives: an
    inflow that added thrust took 20 % onto the drag of a vehicle whose thrust lags by 0.3 s.
    """
    far = np.where(loss > 0.0, influences < GAIN, np.abs(influences) > STAND_IN)
    far[::2] = False
    return np.where(far, -influences, influences)


def _perhaps_lossless(known: Explanations, lossless: float) -> Explanations:
    """Beside each explanation the same one without losses.

    What the record says of them: density of no loss after the record, by that before it (Dickey 1971).
    """
    at, rest = np.flatnonzero(known.loss), np.flatnonzero(known.loss == 0.0)
    along = known.covariance[:, at[:, None], at]
    gain = np.linalg.solve(along, known.covariance[:, at[:, None], rest])
    mean, covariance = np.zeros_like(known.mean), np.zeros_like(known.covariance)
    mean[:, rest] = known.mean[:, rest] - np.einsum("eab,ea->eb", gain, known.mean[:, at])
    covariance[:, rest[:, None], rest] = known.covariance[:, rest[:, None], rest] - np.einsum(
        "eab,eac->ebc", known.covariance[:, at[:, None], rest], gain
    )
    far = np.einsum("ea,ea->e", known.mean[:, at], np.linalg.solve(along, known.mean[:, at][..., None])[..., 0])
    usual, spread = known.usual[:, at], known.spread[:, at]
    log = 0.5 * np.sum((usual / spread) ** 2 + 2.0 * np.log(spread), axis=1)
    log -= 0.5 * (far + np.linalg.slogdet(along)[1])
    weight = np.concatenate([(1.0 - lossless) * known.weight, lossless * known.weight * np.exp(log)])
    return Explanations(
        weight / weight.sum(),
        np.concatenate([known.mean, mean]),
        np.concatenate([known.covariance, covariance]),
        np.concatenate([known.usual, known.usual]),
        np.concatenate([known.spread, known.spread]),
        known.loss,
    )


def _importance(known: Explanations, influences: Array, of: Array) -> Array:
    """Weights of draws (n, m), each of the explanation `of` (n,): even prior over normal prior of each loss."""
    at = np.flatnonzero(known.loss)
    spread, drawn_losses = known.spread[of][:, at], influences[:, at]
    far = (drawn_losses - known.usual[of][:, at]) / spread
    even = np.where(np.abs(far) <= math.sqrt(3.0), UNIFORM_OVER_NORMAL * np.exp(0.5 * np.minimum(far**2, 3.0)), 0.0)
    # No loss is no draw of either.
    log = np.sum(np.where(drawn_losses == 0.0, 0.0, np.log((1.0 - NORMAL_SHARE) * even + NORMAL_SHARE)), axis=1)
    weight = np.exp(log - log.max())
    return array(weight / weight.sum())


def root(covariance: Array) -> Array:
    """Symmetric square root of a covariance: (k, k); what has no variance has none to the last bit."""
    values, vectors = np.linalg.eigh(covariance)
    # Of the roots the one that depends on the covariance alone: equal eigenvalues have any basis, and with it another
    # NumPy, or the last bits of a record, would make other draws.
    made = (vectors * np.sqrt(np.maximum(0.0, values))) @ vectors.T
    varies = np.diagonal(covariance) > 0.0
    return array(np.where(np.outer(varies, varies), made, 0.0))
