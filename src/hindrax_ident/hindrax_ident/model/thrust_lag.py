"""Thrust between commands: piecewise-constant commands through a first-order lag, integrated exactly.

l' = (c - l) / T. Between two commands l(t) = c + (l0 - c) exp(-t / T), so neither the thrust nor its integral needs a
step size.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hindrax_ident.arrays import Array, Index

LEAST_MEMORY_S = 0.02
"""Shortest time constant of an unknown force, where the thrusters have no lag: it is a state of the filters of
`fit.whitening` and `online.filtered_regression`, and white noise cannot be one."""

ONE_LAG = 0.0, 0.0
"""By how much the lags of thrust that goes, and that turns round, are longer than that of what comes, where they are
the same [s]."""
SHORT_S = 1e-9
"""A lag below this is none."""
SHORTEST_S = 0.01
"""Lag of thrust that comes, beside others: of one at once, Newton's method finds no thrust after a change of lags."""
MOST_STEPS, SETTLED = 50, 1e-13
"""Steps of Newton's method, and the change, of the largest command, from which it has settled [-]."""


class LaggedThrust:
    """Thrust on one axis over a whole record: `times_s` (n,) increasing, `commands` (n,) [N, N m] from each time on.

    What goes, toward zero, may have a lag that is longer by `later_s` than that of what comes, and so may what goes
    because it turns round, whose command is on the other side of zero.
    """

    __slots__ = ("_commands", "_impulses", "_lagged", "_lags_s", "_times")

    def __init__(self, times_s: Array, commands: Array, lag_s: float, later_s: tuple[float, float] = ONE_LAG) -> None:
        if len(times_s) == 0:
            raise ValueError("no thrust in the record, wanted at least one command")
        self._times, self._commands = np.asarray(times_s, float), np.asarray(commands, float)
        self._lags_s: Array | float = lag_s
        if any(later_s):
            lags = _Lags(max(lag_s, SHORTEST_S), *(max(0.0, lag_s + one) for one in later_s))
            self._times, self._commands, self._lagged, self._lags_s = _pieces(self._times, self._commands, lags)
        else:
            self._lagged = _lagged(self._commands, np.diff(self._times), lag_s)
        pieces = self._since(np.arange(len(self._times) - 1), np.diff(self._times))
        self._impulses = np.append(0.0, np.cumsum(pieces))

    def force(self, at_s: Array) -> Array:
        """Thrust after the lag: (n,) [N, N m]; before the first command, that command."""
        index, since = self._locate(at_s)
        command = self._commands[index]
        return np.asarray(command + (self._lagged[index] - command) * _decay(since, self._lag_s(index)))

    def impulse(self, at_s: Array) -> Array:
        """Integral of the thrust from the first command to each time: (n,) [N s, N m s]; negative before it."""
        index, since = self._locate(at_s)
        return np.asarray(self._impulses[index] + self._since(index, since))

    def _since(self, index: Index, since_s: Array) -> Array:
        """Impulse since a command: (n,) [N s, N m s]."""
        command, lag_s = self._commands[index], self._lag_s(index)
        fading = (self._lagged[index] - command) * lag_s * (1.0 - _decay(since_s, lag_s))
        return np.asarray(command * since_s + fading)

    def _lag_s(self, index: Index) -> Array | float:
        """Lag after each of these commands [s]."""
        return self._lags_s[index] if isinstance(self._lags_s, np.ndarray) else self._lags_s

    def _locate(self, at_s: Array) -> tuple[Index, Array]:
        """Index of the command in force, (n,), and time since it, (n,) [s]."""
        index = np.maximum(np.searchsorted(self._times, at_s, side="right") - 1, 0)
        return index, np.asarray(at_s, float) - self._times[index]


class SumOfThrusts:
    """Thrust on one axis as a sum of others, each of a weight."""

    __slots__ = ("_parts",)

    def __init__(self, parts: Sequence[tuple[float, LaggedThrust]]) -> None:
        self._parts = parts

    def force(self, at_s: Array) -> Array:
        """Thrust: (n,) [N, N m]."""
        return sum((weight * one.force(at_s) for weight, one in self._parts), start=np.zeros(len(at_s)))

    def impulse(self, at_s: Array) -> Array:
        """Integral of the thrust to each time: (n,) [N s, N m s]."""
        return sum((weight * one.impulse(at_s) for weight, one in self._parts), start=np.zeros(len(at_s)))


class LaggedInput:
    """The same for an input that is not over: its value behind the lag, and its integral from one time to the next."""

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

    def at(self, t_s: float) -> float:
        """Value behind the lag at this time."""
        self._advance(t_s)
        return self._lagged

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


def _decay(spans_s: Array, lag_s: Array | float) -> Array:
    """Share of a lag's transient that is left after each span: (n,) [-]; of no lag nothing."""
    lags_s = np.asarray(lag_s)
    kept = np.exp(-np.maximum(spans_s, 0.0) / np.maximum(lags_s, SHORT_S))
    return np.asarray(np.where(lags_s > 0.0, kept, 0.0))


class _Lags(NamedTuple):
    """Lags of thrust that comes, which is not zero, that goes toward zero, and that turns round, up to zero [s]."""

    comes_s: float
    goes_s: float
    turns_s: float

    def of(self, thrusts: Array, commands: Array) -> tuple[Array, Array]:
        """First lag of each thrust (n,) that follows its command, and when it passes zero: (n,) [s], else never."""
        turns = thrusts * commands < 0.0
        lags_s = np.where(turns, self.turns_s, np.where(np.abs(commands) < np.abs(thrusts), self.goes_s, self.comes_s))
        ratios = np.divide(thrusts, commands, out=np.zeros_like(thrusts), where=turns)
        return lags_s, np.where(turns, self.turns_s * np.log1p(-ratios), np.inf)

    def after(self, thrusts: Array, commands: Array, steps_s: Array) -> tuple[Array, Array]:
        """Thrusts (n,) that followed their commands for so long, and their derivatives by those at the begin."""
        lags_s, zero_s = self.of(thrusts, commands)
        kept = _decay(steps_s, lags_s)
        # What has passed zero comes for the rest of the step, and later by what it begins with.
        come = _decay(steps_s - np.minimum(zero_s, steps_s), self.comes_s)
        passed = zero_s < steps_s
        share = np.divide(commands, commands - thrusts, out=np.zeros_like(thrusts), where=passed)
        slope = np.where(passed, share * self.turns_s / self.comes_s * come, kept)
        return np.where(passed, commands * (1.0 - come), commands + (thrusts - commands) * kept), slope


def _pieces(times_s: Array, commands: Array, lags: _Lags) -> tuple[Array, Array, Array, Array]:
    """Pieces of one lag each: begins [s], commands and thrusts at the begin [N, N m], lags [s], (m,) each."""
    steps_s = np.diff(times_s)
    thrusts = _lagged(commands, steps_s, lags.comes_s)
    # Each thrust is a function of the one before, which the commands bend: Newton's method on all of them at once.
    for _ in range(MOST_STEPS):
        reached, slope = lags.after(thrusts[:-1], commands[:-1], steps_s)
        before, thrusts = thrusts, _recursion(slope, np.append(commands[:1], reached - slope * thrusts[:-1]))
        if np.abs(thrusts - before).max() <= SETTLED * np.abs(commands).max():
            break
    lags_s, zero_s = lags.of(thrusts, commands)
    passed = np.flatnonzero(zero_s < np.append(steps_s, np.inf))
    at = passed + 1
    return (
        np.insert(times_s, at, times_s[passed] + zero_s[passed]),
        np.insert(commands, at, commands[passed]),
        np.insert(thrusts, at, 0.0),
        np.insert(lags_s, at, lags.comes_s),
    )


def _lagged(commands: Array, steps: Array, lag_s: float) -> Array:
    """Thrust after the lag at each command: (n,) [N, N m]; steady at the first."""
    if lag_s <= 0.0:
        return commands.copy()
    decay = _decay(steps, lag_s)
    return _recursion(decay, np.append(commands[:1], (1.0 - decay) * commands[:-1]))


def _recursion(kept: Array, driven: Array) -> Array:
    """Values x_k+1 = d_k x_k + c_k+1 with x_0 = c_0: (n,)."""
    # One forward substitution, with -d below a diagonal of ones.
    bands = np.zeros((2, len(driven)), order="F")
    bands[1, :-1] = -kept
    from scipy.linalg import blas  # noqa: PLC0415  # slow, and the live estimate does without

    return np.asarray(blas.dtbsv(1, bands, driven, lower=1, diag=1))
