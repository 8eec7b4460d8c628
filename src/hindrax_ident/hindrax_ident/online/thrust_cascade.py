"""Thrust behind one first-order lag, two and so on, each behind the filter of the regression as well.

With T the lag, they are 1 / (1 + s T)^k of the commands; the filter is 1 / (s + rate). Differences of them are the
columns from which any delay of the thrust is estimated (`lag_and_delay`).
"""

import itertools
import math
from operator import mul


class ThrustCascade:
    """Commands that are constant between calls. Forces in N or N m, times in seconds."""

    __slots__ = ("_filtered", "_lagged", "command")

    def __init__(self, lags: int) -> None:
        """`lags`: how many in a row, one at least. `command`: the present one, which may be set at any time."""
        self.command = 0.0
        self._lagged, self._filtered = (0.0,) * lags, (0.0,) * lags

    @property
    def lagged(self) -> float:
        """Thrust behind one lag."""
        return self._lagged[0]

    @property
    def filtered(self) -> float:
        """Thrust behind one lag and the filter [N s, N m s]."""
        return self._filtered[0]

    def rest(self) -> None:
        """Let the thrust have been for long what is commanded now."""
        self._lagged = (self.command,) * len(self._lagged)

    def lower(self, by: float) -> None:
        """Take a constant off all thrusts: of one that grows without end only differences count."""
        self.command -= by
        self._lagged = tuple(one - by for one in self._lagged)

    def restart_filter(self) -> None:
        """Forget what went through the filter."""
        self._filtered = (0.0,) * len(self._filtered)

    def advance(self, step: float, lag_s: float, rate: float) -> None:
        """Advance: the lags exactly, and the filter exactly behind the first of them.

        Behind the others it takes the thrust for linear over the step.

        Parameters
        ----------
        step : [s]
            Time since the last call, above zero.
        lag_s : [s]
            T; 0 where there is but one.
        rate : [1/s]
            Pole of the filter.
        """
        kept = math.exp(-rate * step)
        constant = (1.0 - kept) / rate
        if lag_s <= 0.0:
            self._lagged = (self.command,)
            self._filtered = (kept * self._filtered[0] + self.command * constant,)
            return
        part, command = step / lag_s, self.command
        decay = math.exp(-part)
        # Lists and `map`: a generator costs as much as what it computes, and this runs at every command and velocity.
        gaps = [one - command for one in self._lagged]
        powers = [1.0]
        for order in range(1, len(gaps)):
            powers.append(powers[-1] * part / order)
        after = [command + decay * sum(map(mul, gaps[at::-1], powers)) for at in range(len(gaps))]
        ramp = (step - constant) / (rate * step)
        first = constant - ramp
        parts = zip(self._filtered, self._lagged, after, strict=True)
        filtered = [kept * total + first * was + ramp * now for total, was, now in parts]
        both = two_poles(rate, 1.0 / lag_s, step, kept, decay)
        filtered[0] = kept * self._filtered[0] + command * constant + gaps[0] * both
        self._lagged, self._filtered = tuple(after), tuple(filtered)

    def shapes(self, lag_s: float) -> tuple[float, ...]:
        """Differences of the thrust behind one lag, two and so on, all filtered, over powers of the lag.

        The k-th is u^k of the filtered thrust behind one lag, with u = s / (1 + s T).

        Parameters
        ----------
        lag_s : [s]
            T.

        Returns
        -------
        tuple[float, ...]
            One less than there are lags [N, N/s, ...; N m, N m/s, ...].
        """
        row, out = list(self._filtered), []
        while len(row) > 1:
            row = [(one - other) / lag_s for one, other in itertools.pairwise(row)]
            out.append(row[0])
        return tuple(out)


def two_poles(a: float, b: float, step: float, at_a: float, at_b: float) -> float:
    """Integral of exp(-a (h - s)) exp(-b s) over s from 0 to h; the poles may coincide.

    Parameters
    ----------
    a, b : [1/s]
        Poles.
    step : [s]
        h.
    at_a, at_b
        exp(-a h) and exp(-b h), which the caller has.

    Returns
    -------
    float
        [s].
    """
    apart = a - b
    return (at_b - at_a) / apart if abs(apart) * step > 1e-6 else step * at_a
