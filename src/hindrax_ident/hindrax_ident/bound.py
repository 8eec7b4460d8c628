"""The Cramer-Rao bound of a record: how well anybody could know the parameters from it (Ljung 1999, section 7.4).

The sensitivities are taken at the truth; the noise of the measurements is what was found, that of the thrust the true
one where it is known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.models import Model, motions_of
from hindrax_ident.problem import linearize, restarted, whitener_of
from hindrax_ident.refine import Fit

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


def bound_of(fit: Fit, theta: Array, thrust_s: float | None = None) -> Array:
    """Smallest covariance that an unbiased estimate from the fit's record can have: (p, p).

    With `thrust_s`, the true density of the thrust's gusts [s], no other unknown force counts.
    """
    problem, path = fit.problem, fit.linear.path
    noise = fit.noise if thrust_s is None else replace(fit.noise, force=0.0, thrust=thrust_s)
    for _ in range(ROUNDS):
        linear = linearize(problem, theta, path, whitener_of(problem, theta, path, noise))
        if linear is None:
            raise ValueError(f"no motion follows from the true parameters {theta.tolist()}")
        # The initial conditions that fit the truth best.
        path, information = restarted(problem, linear, np.zeros(len(theta))), linear.information
    return array(np.linalg.inv(information))
