"""Thrust between commands: piecewise-constant commands through a first-order lag, integrated exactly.

l' = (c - l) / T. Between two commands l(t) = c + (l0 - c) exp(-t / T), so neither the thrust nor its integral needs a
step size.
"""

import math

import numpy as np
from scipy.linalg import blas

from hindrax_ident.arrays import Array, Index

LEAST_MEMORY_S = 0.02
"""Shortest time constant of an unknown force, where the thrusters have no lag: it is a state of the filters of
`fit.whitening` and `online.filtered_regression`, and white noise cannot be one."""


class LaggedThrust:
    """Thrust on one axis over a whole record: `times_s` (n,) increasing, `commands` (n,) [N, N m] from each time on."""

    __slots__ = ("_commands", "_impulses", "_lagged", "_times", "lag_s")

    def __init__(self, times_s: Array, commands: Array, lag_s: float) -> None:
        if len(times_s) == 0:
            raise ValueError("no thrust in the record, wanted at least one command")
        self.lag_s = lag_s
        self._times, self._commands = np.asarray(times_s, float), np.asarray(commands, float)
        steps = np.diff(self._times)
        self._lagged = _lagged(self._commands, steps, lag_s)
        decay = _decay(steps, lag_s)
        pieces = self._commands[:-1] * steps + (self._lagged[:-1] - self._commands[:-1]) * lag_s * (1.0 - decay)
        self._impulses = np.concatenate([[0.0], np.cumsum(pieces)])

    def force(self, at_s: Array) -> Array:
        """Thrust after the lag: (n,) [N, N m]; before the first command, that command."""
        index, since = self._locate(at_s)
        command = self._commands[index]
        return np.asarray(command + (self._lagged[index] - command) * _decay(since, self.lag_s))

    def impulse(self, at_s: Array) -> Array:
        """Integral of the thrust from the first command to each time: (n,) [N s, N m s]; negative before it."""
        index, since = self._locate(at_s)
        command, gap = self._commands[index], self._lagged[index] - self._commands[index]
        fading = gap * self.lag_s * (1.0 - _decay(since, self.lag_s))
        return np.asarray(self._impulses[index] + command * since + fading)

    def _locate(self, at_s: Array) -> tuple[Index, Array]:
        """Index of the command in force, (n,), and time since it, (n,) [s]."""
        index = np.maximum(np.searchsorted(self._times, at_s, side="right") - 1, 0)
        return index, np.asarray(at_s, float) - self._times[index]


class LaggedInput:
    """The same for an input that is not over: its integral behind the lag, from one time to the next."""

    __slots__ = ("_integral", "_lag_s", "_lagged", "_t_s", "_value")

    def __init__(self, lag_s: float) -> None:
        self._lag_s, self._t_s = lag_s, math.nan
        self._value = self._lagged = self._integral = 0.0

    def set(self, t_s: float, value: float) -> None:
        """Value before the lag from this time on; steady at the first."""
        if math.isnan(self._t_s):
            self._t_s, self._lagged = t_s, value
        self._advance(t_s)
        self._value = value

    def taken(self, t_s: float) -> float:
        """Integral up to this time since it was taken last."""
        self._advance(t_s)
        taken, self._integral = self._integral, 0.0
        return taken

    def _advance(self, t_s: float) -> None:
        """Add the integral over the step h since the last time: c h + (l - c) T (1 - exp(-h / T))."""
        step = t_s - self._t_s
        if not step > 0.0:
            return
        self._t_s = t_s
        gap, decay = self._lagged - self._value, math.exp(-step / self._lag_s) if self._lag_s > 0.0 else 0.0
        self._integral += self._value * step + gap * self._lag_s * (1.0 - decay)
        self._lagged = self._value + gap * decay


def _decay(spans_s: Array, lag_s: float) -> Array:
    """Share of a lag's transient that is left after each span: (n,) [-]."""
    if lag_s <= 0.0:
        return np.zeros_like(spans_s)
    return np.asarray(np.exp(-np.maximum(spans_s, 0.0) / lag_s))


def _lagged(commands: Array, steps: Array, lag_s: float) -> Array:
    """Thrust after the lag at each command: (n,) [N, N m]; steady at the first."""
    if lag_s <= 0.0:
        return commands.copy()
    # The recursion l_k+1 = d l_k + (1 - d) c_k is one forward substitution, with -d below a diagonal of ones.
    decay = _decay(steps, lag_s)
    bands = np.zeros((2, len(commands)), order="F")
    bands[1, :-1] = -decay
    driven = np.append(commands[:1], (1.0 - decay) * commands[:-1])
    return np.asarray(blas.dtbsv(1, bands, driven, lower=1, diag=1))
