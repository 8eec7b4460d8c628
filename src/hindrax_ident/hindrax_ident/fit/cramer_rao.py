"""Cramer-Rao bound of a record: smallest covariance of unbiased estimates from it (Ljung 1999, section 7.4).

Sensitivities are those at the true parameters; measurement noise is the estimated one, thrust noise the true one where
known.
"""

from dataclasses import replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error_problem import linearize, restarted, whitener_of

ROUNDS = 3


def bound_of(fit: OutputErrorFit, theta: Array, thrust_s: float | None = None) -> Array:
    """Smallest covariance of an unbiased estimate from the fit's record: the inverse of J'J at the true parameters.

    Parameters
    ----------
    fit
        Whose record, grid and noise count.
    theta : (p,)
        True parameters.
    thrust_s : [s]
        True density of the thrust noise: then there are no other unknown forces. None: the noise is that of the fit.

    Returns
    -------
    Array
        (p, p), in the units of the parameters.

    Raises
    ------
    ValueError
        Where the simulation diverges with the true parameters.
    """
    problem, path = fit.problem, fit.linear.path
    noise = fit.noise if thrust_s is None else replace(fit.noise, force=0.0, thrust=thrust_s)
    for _ in range(ROUNDS):
        linear = linearize(problem, theta, path, whitener_of(problem, theta, path, noise))
        if linear is None:
            raise ValueError(f"the simulation diverges with the true parameters {theta.tolist()}")
        # The initial conditions that fit the truth best.
        path, information = restarted(problem, linear, np.zeros(len(theta))), linear.information
    return array(np.linalg.inv(information))
