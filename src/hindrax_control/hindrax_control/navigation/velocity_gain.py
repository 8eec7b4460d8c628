"""How a DVL's changes of velocity compare with those by the accelerometer: one complex number, which should be 1.

A filter that fuses both cannot tell a DVL that is turned about the vertical, or whose scale is wrong: while the vehicle
gathers speed each sample is only a little off, and the filter follows. Over a whole push the two disagree plainly.

With north + i east as one complex number, let x be the velocity by the accelerometer alone (the integral of its
horizontal part) and y that by the DVL. An offset of the accelerometer, or gravity through an error of tilt, makes x run
away, so both pass the same high pass of time constant `WINDOW_S`; what is left of the offset is nearly constant, and an
intercept takes it: with the means taken off, and weighted, the newest most, over `MEMORY_S`,

    c = sqrt(E[y* y] / E[x* x]) e^(i arg E[x* y])

is the scale of the DVL times e^(i mount), because a turn about the vertical and a turn of the heading commute.

Both sides err: a vehicle that turns on the spot carries the offset of its accelerometer around, so that x is all error,
and a slope over x would be zero. So c is told only where both x and y show a push and follow each other, and turning is
left out. A DVL that shows nothing at all is no case for c; `shows_little` says of the last window whether it does.
"""

import cmath
import math
from typing import NamedTuple

from hindrax_control.navigation.past_sums import PastSums

WINDOW_S = 0.6
"""A push of these vehicles lasts about as long; with 1 s and 2 s the tilt that changes under thrust took c to 0.75."""
MEMORY_S = 8.0
LONGEST_STEP_S = 1.0
"""After a longer silence the windows begin again."""
TURNING_radps = 0.3
FLOOR_mps = 0.02
"""Least deviation of a residual: noise and latency of a good DVL."""
LEAST_PUSH_mps = 0.04
"""Root mean square of x and of y from which c is told."""
LEAST_COHERENCE = 0.85
"""|E[x* y]|^2 / (E[x* x] E[y* y]) from which x and y follow each other."""

LITTLE = 0.5
"""|y| / |x| below which a DVL shows little of what the accelerometer does."""


class Gain(NamedTuple):
    """The gain c [-], and its standard deviation in each direction."""

    value: complex
    sigma: float


UNKNOWN = Gain(1.0 + 0j, math.inf)


class VelocityGain:
    """Takes accelerations at every tick, velocities as they come; `gain` is that of the last velocity."""

    def __init__(self) -> None:
        self.gain = UNKNOWN
        self._sums = PastSums(1, LONGEST_STEP_S)
        self._turned_s = -math.inf
        self._last: tuple[float, complex, complex] | None = None
        self._x = self._y = 0j
        self._weight = self._xx = self._yy = self._mean_step_s = 0.0
        self._sx = self._sy = self._xy = 0j

    def accelerated(self, change_mps: complex, yaw_rate_radps: float, now_s: float) -> None:
        """Take one more change of velocity by the accelerometer.

        Parameters
        ----------
        change_mps : [m/s]
            North + i east, gravity taken off.
        yaw_rate_radps : [rad/s]
            Meanwhile: in turns no gain can be told.
        now_s : [s]
            Filter time.
        """
        self._sums.add((change_mps,), now_s)
        if abs(yaw_rate_radps) > TURNING_radps:
            self._turned_s = now_s

    def measured(self, velocity_mps: complex, valid_s: float) -> None:
        """Take a velocity by the DVL, valid at a time of the past; one before the last, or too old, is left out."""
        sums, last = self._sums.at(valid_s), self._last
        if sums is None or (last is not None and valid_s <= last[0]):
            return
        self._last = valid_s, (x := sums[0]), velocity_mps
        if last is None or valid_s - last[0] > LONGEST_STEP_S or valid_s - self._turned_s < WINDOW_S:
            self._x = self._y = 0j
            return
        dt = valid_s - last[0]
        keep, forget = math.exp(-dt / WINDOW_S), math.exp(-dt / MEMORY_S)
        self._x = x = keep * self._x + (x - last[1])
        self._y = y = keep * self._y + (velocity_mps - last[2])
        self._weight = forget * self._weight + 1.0
        self._mean_step_s += (dt - self._mean_step_s) / min(self._weight, 50.0)
        self._sx, self._sy = forget * self._sx + x, forget * self._sy + y
        self._xx, self._yy = forget * self._xx + abs(x) ** 2, forget * self._yy + abs(y) ** 2
        self._xy = forget * self._xy + x.conjugate() * y
        self.gain = self._slope()

    @property
    def shows_little(self) -> bool:
        """Whether the DVL's velocity changed by far less than that by the accelerometer, in the last window.

        So it is with one that hangs; and at rest, where x is but an offset: alone it proves nothing.
        """
        return abs(self._y) < LITTLE * abs(self._x)

    def _slope(self) -> Gain:
        """The gain c of the module's head; unknown where x or y shows no push, or they do not follow each other.

        Its deviation is that of a slope over x: the residual of y over the sum of squares of x, with as many
        independent samples as there are windows.
        """
        weight = self._weight
        xx = self._xx - abs(self._sx) ** 2 / weight
        yy = self._yy - abs(self._sy) ** 2 / weight
        xy = self._xy - self._sx.conjugate() * self._sy / weight
        if min(xx, yy) < LEAST_PUSH_mps**2 * weight or abs(xy) ** 2 < LEAST_COHERENCE * xx * yy:
            return UNKNOWN
        residual = max(yy - abs(xy) ** 2 / xx, 0.0) / weight
        within_a_window = max(1.0, WINDOW_S / max(self._mean_step_s, 1e-3))
        value = cmath.rect(math.sqrt(yy / xx), cmath.phase(xy))
        return Gain(value, math.sqrt(max(residual, FLOOR_mps**2) * within_a_window / xx))


def described(gain: complex) -> str:
    """A gain in words: "1.48 times as large, turned by 3 deg"."""
    return f"{abs(gain):.2f} times as large, turned by {math.degrees(cmath.phase(gain)):.0f} deg"
