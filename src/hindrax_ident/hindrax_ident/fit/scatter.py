"""Scatter between the blocks of a record against the deviations of its fit: a larger one shows an incomplete model."""

from collections.abc import Sequence

import numpy as np

from hindrax_ident.arrays import Array

BLOCK_S = 15.0
LIMIT_QUANTILE = 0.999


def scatter_inflation(gradients: Array, informations: Sequence[Array], inverse: Array, covariance: Array) -> Array:
    """Ratios of the scatter between blocks to the standard deviations, where it is significantly above 1.

    At the minimum the gradients J'r of all blocks sum to nearly zero. H^-1 times that of one block is what the block
    would like to change; the sum of the squares of these changes is the variance of the estimate if blocks are
    independent, whatever the residuals look like within them. It is rough with few blocks: hence the limit, a quantile
    of chi squared over its degrees of freedom.

    Parameters
    ----------
    gradients : (blocks, p)
        Of the cost, by block.
    informations : (p, p) each
        Of the blocks.
    inverse : (p, p)
        Of the sum of the informations and that of the prior: H^-1.
    covariance : (p, p)
        Of the parameters by the noise.

    Returns
    -------
    Array
        (p,) [-], 1 or more.
    """
    blocks = len(gradients)
    if blocks < 4:
        return np.ones(len(inverse))
    scatter = np.sum((gradients @ inverse) ** 2, axis=0) * blocks / (blocks - 1)
    # A parameter of which the record knows nothing has no scatter, and none to compare it with.
    ratio = _ratio(scatter, np.diag(covariance))
    # Blocks with little information on a parameter add few degrees of freedom to its scatter.
    shares = np.array([np.diag(inverse @ information @ inverse) for information in informations])
    freedom = np.maximum(1.0, _ratio(shares.sum(axis=0) ** 2, np.sum(shares**2, axis=0)) - 1.0)
    from scipy.special import chdtri  # noqa: PLC0415  # slow, and the live estimate does without

    limit = chdtri(freedom, 1.0 - LIMIT_QUANTILE) / freedom
    return np.where(ratio > limit, np.sqrt(ratio), 1.0)


def _ratio(over: Array, under: Array) -> Array:
    """Quotient, (n,); zero where the divisor is."""
    return np.divide(over, under, out=np.zeros_like(over), where=under > 0.0)
