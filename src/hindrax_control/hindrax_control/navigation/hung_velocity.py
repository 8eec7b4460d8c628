"""A DVL that hangs with live noise: accelerometer and thrusters both show a change of velocity that it does not.

Each of its velocities is within the gate, and the offset of the horizontal filter learns what they are off by. Where
the vehicle gathers speed slowly, neither witness proves that alone: an error of tilt lets gravity into the
accelerometer, 0.1 m/s^2 of it; current, tether and a wrong drag are off by as much in the momentum balance. But these
errors have different causes. So the DVL hangs where both contradict it, by as much and to the same side, and it shows
little of the change that either expects.

Let W be the velocity by the DVL and S the sum of changes by a witness, as complex numbers in level axes that do not
turn with the vehicle: by the gyroscope alone, since a heading that is corrected would turn W and no change of the past.
Then e = W - S is constant for a good one. A witness that errs evenly makes e grow evenly, so what counts is by how much
more e has grown over the last span T than over the one before:

    d = e(t) - 2 e(t - T) + e(t - 2 T),   each growth in the axes of the vehicle at its end, where errors stay

and the contradiction is Re(d_1 d_2*) / max(|d_1|, |d_2|): the shorter of both, along the longer.
"""

import cmath
import math
from collections import deque
from typing import NamedTuple

from hindrax_control.navigation.past_sums import PastSums

SPAN_S = 2.0
"""Shorter, slow changes stay below the limit; longer, a tilt that levels off passes for a change."""
SMOOTH_S = 0.2
LONGEST_GAP_S = 1.0
"""After a longer silence the spans begin again."""
LITTLE = 0.35
"""Change that the DVL shows, as a share of the one that is expected, below which it shows little."""


class Disagreement(NamedTuple):
    """Smoothed: of one velocity, valid at a time of the filter."""

    valid_s: float
    velocity_mps: complex
    """By the DVL, ahead + i to starboard, level."""
    accelerometer_mps: complex
    """The DVL less the accelerometer, in axes that do not turn, up to a constant."""
    thrust_mps: complex
    ahead: complex
    """Direction of the vehicle in these axes."""


class HungVelocity:
    """Takes changes of velocity at every tick, velocities of any number of DVLs as they come."""

    def __init__(self, limit_mps: float) -> None:
        self._limit_mps = limit_mps
        self._sums = PastSums(3, memory_s=1.0)
        self._ahead = 1.0 + 0j
        self._remembered: dict[str, deque[Disagreement]] = {}

    def changed(self, accelerometer_mps: complex, thrust_mps: complex, turned_rad: float, now_s: float) -> None:
        """Take one more change of velocity by either witness.

        Parameters
        ----------
        accelerometer_mps, thrust_mps : [m/s]
            Ahead + i to starboard, level.
        turned_rad : [rad]
            Meanwhile, about the vertical.
        now_s : [s]
            Filter time.
        """
        turn = cmath.rect(1.0, turned_rad)
        # Half the turn: a mean over the tick belongs to its middle. The direction is a sum like the others, so that a
        # late velocity finds the one of its own time.
        middle = self._ahead * cmath.rect(1.0, 0.5 * turned_rad)
        self._sums.add((middle * accelerometer_mps, middle * thrust_mps, self._ahead * (turn - 1.0)), now_s)
        self._ahead *= turn

    def forget(self) -> None:
        """Begin again: a witness is missing."""
        self._remembered.clear()

    def contradicts(self, velocity_mps: complex, valid_s: float, source: str) -> bool:
        """Take a velocity by a DVL, and tell whether it hangs.

        Parameters
        ----------
        velocity_mps : [m/s]
            Ahead + i to starboard, level.
        valid_s : [s]
            In filter time.
        source
            Name of the DVL.

        Returns
        -------
        bool
            Whether both witnesses contradict it.
        """
        past, sums = self._remembered.setdefault(source, deque()), self._sums.at(valid_s)
        if sums is None or (past and valid_s <= past[-1].valid_s):
            return False
        if past and valid_s - past[-1].valid_s > LONGEST_GAP_S:
            past.clear()
        accelerometer, thrust, ahead = sums[0], sums[1], 1.0 + sums[2]
        over_ground = ahead * velocity_mps
        now = Disagreement(valid_s, velocity_mps, over_ground - accelerometer, over_ground - thrust, ahead)
        if past:
            last, share = past[-1], -math.expm1((past[-1].valid_s - valid_s) / SMOOTH_S)
            smooth = (old + share * (new - old) for old, new in zip(last[1:], now[1:], strict=True))
            now = Disagreement(valid_s, *smooth)
        past.append(now)
        while len(past) > 2 and past[1].valid_s <= valid_s - 2.0 * SPAN_S:
            past.popleft()
        return valid_s - past[0].valid_s >= 2.0 * SPAN_S and self._hangs(past)

    def _hangs(self, past: deque[Disagreement]) -> bool:
        first, now = past[0], past[-1]
        middle = next(one for one in past if one.valid_s >= now.valid_s - SPAN_S)
        accelerometer, thrust = (
            _growth(now, middle, which) - _growth(middle, first, which) for which in ("accelerometer_mps", "thrust_mps")
        )
        shown = abs(now.velocity_mps - middle.velocity_mps)
        expected = min(abs(now.velocity_mps - middle.velocity_mps - off) for off in (accelerometer, thrust))
        along = (accelerometer * thrust.conjugate()).real
        most = max(abs(accelerometer), abs(thrust))
        return shown < LITTLE * expected and along > self._limit_mps * most


def _growth(now: Disagreement, then: Disagreement, which: str) -> complex:
    """Growth of a disagreement over a span, in the axes of the vehicle at its end [m/s]."""
    grown: complex = getattr(now, which) - getattr(then, which)
    return grown * now.ahead.conjugate() * SPAN_S / (now.valid_s - then.valid_s)
