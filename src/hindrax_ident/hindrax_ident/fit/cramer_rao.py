"""Cramer-Rao bound of a record: smallest covariance of unbiased estimates from it (Ljung 1999, section 7.4).

Sensitivities are those at the true parameters; measurement noise is the estimated one, thrust noise the true one where
known.
"""

from dataclasses import replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import delay_impulses
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.output_error_problem import linearize, restarted, whitener_of
from hindrax_ident.records.axis_record import Record
from hindrax_ident.tuning import LAG_DIFFERENCE_S, LAG_SIGMA_S

ROUNDS = 3
DELAYS = 4
"""Columns of `delay_impulses`: lag, latency, and how much longer the lags of what goes and of what turns round are."""
DELAY_SIGMAS_S = (LAG_SIGMA_S, LAG_SIGMA_S, LAG_DIFFERENCE_S)
"""What is known of a lag, a latency, and one longer lag of both before the record."""


def bound_of(
    fit: OutputErrorFit, theta: Array, thrust_s: float | None = None, *, delayed: Record | None = None
) -> Array:
    """Smallest covariance of an unbiased estimate from the fit's record: the inverse of J'J at the true parameters.

    Parameters
    ----------
    fit
        Whose record, grid and noise count.
    theta : (p,)
        True parameters.
    thrust_s : [s]
        True density of the thrust noise: then there are no other unknown forces. None: the noise is that of the fit.
    delayed
        The record, for an estimate that knows no more of its delays than DELAY_SIGMAS_S; None: one that knows them.

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
    known: Array = np.zeros(len(theta))
    noise, columns = fit.noise if thrust_s is None else replace(fit.noise, force=0.0, thrust=thrust_s), None
    if delayed is not None:
        impulses = delay_impulses(delayed, problem.grid, delayed.lagged(), DELAYS)
        columns = array(np.column_stack([impulses[:, :2], impulses[:, 2:].sum(axis=1)]))
        known = np.append(known, 1.0 / np.square(DELAY_SIGMAS_S))
    for _ in range(ROUNDS):
        linear = linearize(problem, theta, path, whitener_of(problem, theta, path, noise), columns)
        if linear is None:
            raise ValueError(f"the simulation diverges with the true parameters {theta.tolist()}")
        # The initial conditions that fit the truth best.
        path, information = restarted(problem, linear, np.zeros(len(known))), linear.information
    return array(np.linalg.inv(information + np.diag(known))[: len(theta), : len(theta)])
