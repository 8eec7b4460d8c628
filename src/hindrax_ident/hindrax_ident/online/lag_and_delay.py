"""What the shapes of the thrust's delay tell together: they are those of one delay, and of one lag or two.

`FilteredRegression` has a coefficient for each shape, which together describe thrust that answers in whatever way. A
thruster behind a first-order lag L, seen with a delay d, has but these two numbers, and a third e where thrust goes by
a lag that is longer than that by which it comes. Behind the filter of lag T, with u = s / (1 + s T), it is

    exp(-s d) (1 + s T) / (1 + s L) = exp(-d u / (1 - u T)) / (1 - u (T - L)) = 1 + c_1 u + c_2 u^2 + ...

(an expansion in Laguerre functions: Wahlberg 1991, IEEE Transactions on Automatic Control 36, 551), so the coefficients
of the thrust are c_k(L, d) / M, those of the part that goes (c_k(L + e, d) - c_k(L, d)) / M: as many unknowns as there
are shapes become three. The mass, with which they are mixed up, is known twice to three times better by that, so the
estimate is conditioned on it, as far as it agrees.

Symbols. x (n,) what the regression estimates and P (n, n) its covariance; among x g (m,), the coefficients of the
shapes, and mu = 1 / M before them. With r = g - c mu, of covariance S, the distance from one thruster is r' S^-1 r.
"""

from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.tuning import LAG_DIFFERENCE_S

GOES = 2
"""Shapes of the part that goes."""
FREE = 3
"""Lag, delay, and by how much longer thrust goes."""
STEPS, HALVINGS = 20, 6
"""Most Gauss-Newton steps of these, and how often one is halved that makes it worse."""
SETTLED = 0.1
"""Step in standard deviations below which they are found."""
SMALL_S = 1e-6
"""Step of a difference quotient."""
LONGEST_S = 1.0
"""Longest of each: more is another defect."""


class Delays(NamedTuple):
    """Lag L, delay d and longer lag e of the thrust (3,), their covariance (3, 3), and the estimate under them.

    `estimate`: x and P. `misfit`: mean square distance of the shapes from those of these three, in standard deviations:
    1 is expected [-].
    """

    found_s: Array
    covariance_s2: Array
    estimate: tuple[Array, Array]
    misfit: float


def lag_and_delay(
    values: Array, covariance: Array, shapes: slice, filter_lag_s: float, start_s: Array | None = None
) -> Delays:
    """Find the lag and the delay that the shapes tell, and what the estimate is under them.

    Gauss-Newton over the three; all other unknowns follow from them linearly.

    Parameters
    ----------
    values, covariance : (n,), (n, n)
        x and P; mu above zero.
    shapes
        Where they are among x: m > FREE, of the thrust from the first on, of the part that goes the last GOES.
    filter_lag_s : [s]
        T.
    start_s : (3,) [s]
        To begin with; None: the lag of the filter, the delay that is left of the first shape, and no other lag.

    Returns
    -------
    Delays
        The estimate is conditioned by as much of the update as agrees: all of it where the misfit is no more than
        expected, 1 / misfit of it elsewhere, which is the update by a pseudo-measurement whose own variance is what the
        misfit has beyond P.
    """
    before = shapes.start - 1
    g, mu = values[shapes], float(values[before])
    of_g, of_mu = covariance[:, shapes], covariance[:, before]
    within, across, alone = of_g[shapes], of_mu[shapes], float(of_mu[before])
    prior = np.diag([LONGEST_S**-2, LONGEST_S**-2, LAG_DIFFERENCE_S**-2])

    def distance(c: Array) -> tuple[Array, Array]:
        """Lower root of S (m, m), and r in standard deviations (m,)."""
        mixed = np.outer(c, across)
        root = np.linalg.cholesky(within - mixed - mixed.T + alone * np.outer(c, c))
        return array(root), array(np.linalg.solve(root, g - mu * c))

    def c_of(delays_s: Array) -> Array:
        lag_s, delay_s, longer_s = delays_s.tolist()
        comes = coefficients(lag_s, delay_s, filter_lag_s, len(g) - GOES)
        return array(np.append(comes, coefficients(lag_s + longer_s, delay_s, filter_lag_s, GOES) - comes[:GOES]))

    delays_s = _possible(np.array([filter_lag_s, -g[0] / mu, 0.0]) if start_s is None else start_s)
    c = c_of(delays_s)
    root, r = distance(c)
    for _ in range(STEPS):
        slope = -mu * np.stack([c_of(delays_s + small) - c for small in SMALL_S * np.eye(FREE)], axis=1) / SMALL_S
        jacobian = np.linalg.solve(root, slope)
        information = jacobian.T @ jacobian + prior
        step = -np.linalg.solve(information, jacobian.T @ r)
        if step @ information @ step < SETTLED**2:
            break
        for _ in range(HALVINGS):
            tried = _possible(delays_s + step)
            c = c_of(tried)
            after = distance(c)
            if after[1] @ after[1] < r @ r:
                break
            step *= 0.5
        else:
            break
        delays_s, (root, r) = tried, after
    along = np.linalg.solve(root, (of_g - np.outer(of_mu, c)).T)
    spread_s2, misfit = np.linalg.inv(information), float(r @ r) / (len(g) - FREE)
    moves, agrees = along.T @ jacobian, 1.0 / max(1.0, misfit)
    told = moves @ spread_s2 @ moves.T - along.T @ along
    estimate = array(values - agrees * (along.T @ r)), array(covariance + agrees * told)
    return Delays(array(delays_s), array(spread_s2 * max(1.0, misfit)), estimate, misfit)


def _possible(delays_s: Array) -> Array:
    """Neither lag below zero, and none of the three too long."""
    lag_s, delay_s, longer_s = np.clip(delays_s, [0.0, -LONGEST_S, -LONGEST_S], LONGEST_S).tolist()
    return array(np.array([lag_s, delay_s, max(-lag_s, longer_s)]))


def coefficients(lag_s: float, delay_s: float, filter_lag_s: float, shapes: int) -> Array:
    """Coefficients of the shapes of thrust behind a lag and a delay, times M: (m,) [s, s^2, ...].

    Parameters
    ----------
    lag_s, delay_s : [s]
        L and d.
    filter_lag_s : [s]
        T.
    shapes
        m.
    """
    # Of exp(p(u)) with p = -d (u + T u^2 + T^2 u^3 ...): k e_k is the sum of i p_i e_(k - i).
    exponent = [-delay_s * filter_lag_s ** (order - 1) for order in range(1, shapes + 1)]
    delayed = [1.0]
    for order in range(1, shapes + 1):
        delayed.append(sum(at * exponent[at - 1] * delayed[order - at] for at in range(1, order + 1)) / order)
    lagged = (filter_lag_s - lag_s) ** np.arange(shapes + 1)
    return array(np.convolve(delayed, lagged)[1 : shapes + 1])
