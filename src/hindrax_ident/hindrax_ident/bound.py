"""The Cramer-Rao bound of a record: how well anybody could know the parameters from it (Ljung 1999, section 7.4).

The sensitivities are taken at the truth, the noise (that of the measurements and that of the thrust) is what the record
shows about the truth.
"""

from __future__ import annotations

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.likelihood import fit_noise
from hindrax_ident.models import Model, motions_of
from hindrax_ident.problem import Linear, Problem, chain_of, linearize, restarted
from hindrax_ident.refine import Fit
from hindrax_ident.whitening import Whitener

ROUNDS = 3


def true_parameters(model: Model, truth: dict[str, dict[str, float]]) -> Array:
    """Parameters in the model's order from the coefficients of each motion: (p,)."""
    motions = motions_of(model.axis)
    values = {}
    for motion in motions:
        told = truth[motion.name]
        for name in model.names_of(motion.side):
            plain = name.removesuffix("_negative")
            values[name] = told["added_mass"] + model.rigid if plain == "mass" else told[plain]
    return np.array([values[name] for name in model.names])


def bound_of(fit: Fit, theta: Array) -> Array:
    """Smallest covariance that an unbiased estimate from the fit's record can have: (p, p)."""
    problem, noise = fit.problem, fit.noise
    linear = _at(problem, theta, fit, fit.whitener)
    for _ in range(ROUNDS - 1):
        chain = chain_of(problem, theta, linear.path)
        noise = fit_noise(chain, linear.raw, noise, given_position=problem.model.restores)
        linear = _at(problem, theta, fit, Whitener(chain, noise))
    return array(np.linalg.inv(linear.information))


def _at(problem: Problem, theta: Array, fit: Fit, white: Whitener) -> Linear:
    """Linearization at the truth, with the initial conditions that fit it best."""
    linear, path = None, fit.linear.path
    for _ in range(ROUNDS):
        linear = linearize(problem, theta, path, white)
        if linear is None:
            break
        path = restarted(problem, linear, np.zeros(len(theta)))
    if linear is None:
        raise ValueError(f"no motion follows from the true parameters {theta.tolist()}")
    return linear
