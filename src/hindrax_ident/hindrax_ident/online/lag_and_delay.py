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
LONGEST_S = 1.0
"""Longest of each: more is another defect."""
PRIOR = np.diag([LONGEST_S**-2, LONGEST_S**-2, LAG_DIFFERENCE_S**-2])
"""Information about each before [1/s^2]."""
ROUNDING = 1e-12
"""Share of each variance that its digits do not tell: a record without noise has shapes that are all but one."""


class Thruster(NamedTuple):
    """Lag L, delay d and longer lag e (3,) [s]; its c (m,) and their derivatives by these three (m, 3)."""

    delays_s: Array
    c: Array
    slopes: Array


class Delays(NamedTuple):
    """Lag L, delay d and longer lag e of the thrust (3,), their covariance (3, 3), and the estimate under them.

    `estimate`: x and P. `misfit`: mean square distance of the shapes from those of these three, in standard deviations:
    1 is expected [-].
    """

    found_s: Array
    covariance_s2: Array
    estimate: tuple[Array, Array]
    misfit: float


def thruster(delays_s: Array, filter_lag_s: float, shapes: int) -> Thruster:
    """Shapes of a thruster behind the filter.

    Parameters
    ----------
    delays_s : (3,) [s]
        L, d and e.
    filter_lag_s : [s]
        T.
    shapes
        m, of which the last GOES are of the part that goes.

    Returns
    -------
    Thruster
        With these delays.
    """
    lag_s, delay_s, longer_s = delays_s.tolist()
    c, slopes = coefficients(lag_s, delay_s, filter_lag_s, shapes - GOES)
    c_goes, slopes_goes = coefficients(lag_s + longer_s, delay_s, filter_lag_s, GOES)
    whole = np.zeros((shapes, FREE))
    whole[:-GOES, :2] = slopes
    whole[-GOES:, :2] = slopes_goes - slopes[:GOES]
    whole[-GOES:, 2] = slopes_goes[:, 0]
    return Thruster(delays_s, np.concatenate([c, c_goes - c[:GOES]]), whole)


def conditioned(values: Array, covariance: Array, shapes: slice, about: Thruster) -> Delays:
    """Estimate that is conditioned on one thruster, near the one given: one Gauss-Newton step from there.

    Parameters
    ----------
    values, covariance : (n,), (n, n)
        x and P; mu above zero.
    shapes
        Where they are among x, mu before them.
    about
        Of m > FREE shapes.

    Returns
    -------
    Delays
        The estimate is conditioned by as much of the update as agrees: all of it where the misfit is no more than
        expected, 1 / misfit of it elsewhere, which is the update by a pseudo-measurement whose own variance is what the
        misfit has beyond P.
    """
    r, jacobian, along = _whitened(values, covariance, shapes, about)
    spread_s2 = np.linalg.inv(jacobian.T @ jacobian + PRIOR)
    found_s = about.delays_s - spread_s2 @ (jacobian.T @ r)
    if np.any(found_s != _possible(found_s)):
        # The three move together: at the end of what is possible for one, the others would go without it.
        found_s = about.delays_s
    r = r + jacobian @ (found_s - about.delays_s)
    misfit = float(r @ r) / (len(r) - FREE)
    moves, agrees = along.T @ jacobian, 1.0 / max(1.0, misfit)
    told = moves @ spread_s2 @ moves.T - along.T @ along
    estimate = array(values - agrees * (along.T @ r)), array(covariance + agrees * told)
    return Delays(found_s, array(spread_s2 * max(1.0, misfit)), estimate, misfit)


def settled(values: Array, covariance: Array, shapes: slice, about: Thruster, filter_lag_s: float) -> Thruster:
    """Thruster that is nearest to the shapes, by Gauss-Newton steps from the one given, and from the first shape alone.

    The noise of the first samples may lead to a lag and a delay of half a second with opposite signs, from which no
    step leads back: pitch stayed there, and was 4.9 deviations off.

    Parameters
    ----------
    values, covariance, shapes, about
        As of `conditioned`.
    filter_lag_s : [s]
        T.

    Returns
    -------
    Thruster
        The one given where it is near enough.
    """
    m = len(about.c)

    def nearest(one: Thruster) -> tuple[float, Thruster]:
        r, jacobian, _ = _whitened(values, covariance, shapes, one)
        for _ in range(STEPS):
            information = jacobian.T @ jacobian + PRIOR
            step_s = -np.linalg.solve(information, jacobian.T @ r)
            if step_s @ information @ step_s < SETTLED**2:
                break
            for _ in range(HALVINGS):
                tried = thruster(_possible(one.delays_s + step_s), filter_lag_s, m)
                then = _whitened(values, covariance, shapes, tried)
                if then[0] @ then[0] < r @ r:
                    break
                step_s *= 0.5
            else:
                break
            one, (r, jacobian, _) = tried, then
        return float(r @ r), one

    far, found = nearest(about)
    first = _possible(np.array([filter_lag_s, -values[shapes.start] / values[shapes.start - 1], 0.0]))
    other_far, other = nearest(thruster(first, filter_lag_s, m))
    return other if other_far < far - SETTLED else found


def _whitened(values: Array, covariance: Array, shapes: slice, one: Thruster) -> tuple[Array, Array, Array]:
    """In standard deviations of r: r (m,), its derivatives by L, d and e (m, 3), its covariance with x (m, n)."""
    before = shapes.start - 1
    mu = values[before]
    # Covariance of x and r; the rows of r in it are S.
    along = covariance[:, shapes] - np.outer(covariance[:, before], one.c)
    S = along[shapes] - np.outer(one.c, along[before])
    columns = np.concatenate([(values[shapes] - mu * one.c)[:, None], -mu * one.slopes, along.T], axis=1)
    whitened = np.linalg.solve(_root(S), columns)
    return array(whitened[:, 0]), array(whitened[:, 1 : 1 + FREE]), array(whitened[:, 1 + FREE :])


def _root(covariance: Array) -> Array:
    """Lower root of a covariance (m, m), also of one that is singular."""
    sigmas = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigmas, sigmas) + ROUNDING * np.eye(len(sigmas))
    return array(sigmas[:, None] * np.linalg.cholesky(correlation))


def _possible(delays_s: Array) -> Array:
    """Neither lag below zero, and none of the three too long."""
    lag_s, delay_s, longer_s = (min(LONGEST_S, max(-LONGEST_S, one)) for one in delays_s.tolist())
    lag_s = max(0.0, lag_s)
    return array(np.array([lag_s, delay_s, max(-lag_s, longer_s)]))


def coefficients(lag_s: float, delay_s: float, filter_lag_s: float, shapes: int) -> tuple[Array, Array]:
    """Coefficients of the shapes of thrust behind a lag and a delay, times M, and their derivatives by both.

    Parameters
    ----------
    lag_s, delay_s : [s]
        L and d.
    filter_lag_s : [s]
        T.
    shapes
        m.

    Returns
    -------
    tuple[Array, Array]
        (m,) [s, s^2, ...], and (m, 2).
    """
    order = np.arange(shapes + 1)
    # With p(u) = -d (u + T u^2 + T^2 u^3 ...), and e_k the coefficients of exp(p): k e_k is the sum of i p_i e_(k - i).
    powers = [filter_lag_s**at for at in range(shapes)]
    delayed = [1.0]
    for at in range(1, shapes + 1):
        delayed.append(-delay_s * sum(i * powers[i - 1] * delayed[at - i] for i in range(1, at + 1)) / at)
    off_s = filter_lag_s - lag_s
    lagged = off_s**order
    by_lag = np.concatenate([[0.0], -order[1:] * lagged[:-1]])
    c = np.convolve(delayed, lagged)[: shapes + 1]
    by_delay = -np.convolve(c, powers)[:shapes]
    return array(c[1:]), array(np.stack([np.convolve(delayed, by_lag)[1 : shapes + 1], by_delay], axis=1))
