"""Velocities that are means over time: what a moving average, or differences of positions, leave of a motion.

A mean over T about a time is the change of position over T, by T. So it is predicted exactly from the motion itself,
and so are its sensitivities, which are linear in those of velocity and position.
"""

from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Index, array


@dataclass(frozen=True, slots=True)
class MeanVelocities:
    """Mean velocities of k measurements: `lasts_s` (k,), and where they begin and end, (2, k) each.

    `at`: index of the step of the grid; `within_s`: time since its begin; `steps_s`: its length.
    """

    at: Index
    within_s: Array
    steps_s: Array
    lasts_s: Array

    def of(self, states: Array) -> Array:
        """Mean velocities.

        Parameters
        ----------
        states : (n, 2, ...)
            Velocity and position on the grid, or derivatives of both.

        Returns
        -------
        Array
            (k, ...), like the velocity.
        """
        begin, end = (_positions(states, *step) for step in zip(self.at, self.within_s, self.steps_s, strict=True))
        return array((end - begin) / _column(self.lasts_s, begin.ndim))


def mean_velocities(t: Array, times_s: Array, bounds: Index, mean_over_s: float) -> MeanVelocities:
    """Find the steps in which means begin and end.

    Parameters
    ----------
    t : (k,) [s]
        Of the measurements.
    times_s : (n,) [s]
        Of the grid.
    bounds : (2, k)
        First and last point of the grid in the stretch of each; a mean ends there.
    mean_over_s : [s]
        Duration of the others.

    Returns
    -------
    MeanVelocities
        Of these measurements.
    """
    first, last = bounds
    ends_s = np.clip(t + 0.5 * mean_over_s * np.array([[-1.0], [1.0]]), times_s[first], times_s[last])
    at = np.clip(np.searchsorted(times_s, ends_s, side="right") - 1, first, last - 1)
    return MeanVelocities(at, ends_s - times_s[at], times_s[at + 1] - times_s[at], ends_s[1] - ends_s[0])


def _positions(states: Array, at: Index, within_s: Array, steps_s: Array) -> Array:
    """Positions (k, ...) within steps whose velocity changes evenly."""
    v, s = states[at, 0], states[at, 1]
    x = _column(within_s, v.ndim)
    return array(s + x * v + x**2 / _column(2.0 * steps_s, v.ndim) * (states[at + 1, 0] - v))


def _column(values: Array, ndim: int) -> Array:
    return values.reshape(-1, *[1] * (ndim - 1))
