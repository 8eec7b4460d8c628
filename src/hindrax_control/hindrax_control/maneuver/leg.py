"""Flying one leg: boost, constant force until its end comes near, coast without thrust, brake."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_control.maneuver.plan import CHARACTERS, LAG_S, TURNING, Leg, stopping
from hindrax_control.maneuver.steady_state import SteadyStateTest

PATIENCE = 1.6
"""A stretch that takes this many times as long as planned is given up."""


@dataclass(frozen=True, slots=True)
class LegOutput:
    """Force along the motion beyond bias and restoring [N, Nm], name of the phase, and whether the leg is over."""

    force: float
    phase: str
    finished: bool = False


class LegController:
    """One leg from wherever the vehicle is. Time is the caller's, in seconds."""

    def __init__(self, leg: Leg) -> None:
        self.leg, self.seconds, self.ends = leg, leg.seconds, (leg.start, leg.end)
        # Drag brakes as well, but fades with the speed: it is left out.
        self._braking = leg.boost / leg.inertia
        character = CHARACTERS[leg.axis]
        self._steadiness = SteadyStateTest(character.window_s, character.negligible * abs(leg.level) / leg.inertia)
        self._boost_s = character.boost_s
        self._stretch, self._way = "boost", 1.0
        self._since_s = math.nan

    def step(self, coordinate: float, rate: float, time_s: float, *, trusted: bool = True) -> LegOutput:
        """Drive on, given where the vehicle is along the motion and how fast; `trusted`: the rate is measured."""
        leg = self.leg
        if math.isnan(self._since_s):
            self._since_s = time_s
        forward = rate * leg.sign
        if self._stretch != "brake" and self._at_an_end(coordinate, forward):
            self._enter("brake", time_s)
            self._way = math.copysign(1.0, forward)
        if self._stretch == "boost":
            return self._boost(forward, time_s)
        if self._stretch == "hold":
            return self._hold(coordinate, rate, time_s, trusted=trusted)
        if self._stretch == "coast":
            return self._coast(time_s)
        return self._brake(forward, time_s)

    def _at_an_end(self, coordinate: float, forward: float) -> bool:
        """Whether it is time to brake: before the leg's end, or before the room's end when it is carried backward."""
        leg = self.leg
        way = stopping(forward, self._braking)
        if forward >= 0.0:
            return (leg.end - coordinate) * leg.sign <= way
        # During the boost it may still move backward from the leg before.
        return self._stretch == "hold" and (coordinate - leg.back) * leg.sign <= way

    def _enter(self, stretch: str, time_s: float) -> None:
        self._stretch, self._since_s = stretch, time_s

    def _elapsed_s(self, time_s: float) -> float:
        return time_s - self._since_s

    def _boost(self, forward: float, time_s: float) -> LegOutput:
        leg = self.leg
        fast_enough = forward >= abs(leg.rate) - leg.pace * LAG_S
        if fast_enough or self._elapsed_s(time_s) > PATIENCE * self._boost_s + 1.0:
            self._enter("hold", time_s)
            return LegOutput(leg.level, "transient")
        return LegOutput(leg.sign * leg.boost, "transient")

    def _hold(self, coordinate: float, rate: float, time_s: float, *, trusted: bool) -> LegOutput:
        leg = self.leg
        way, left = leg.coast(rate * leg.sign)
        if leg.coast_s and (leg.end - coordinate) * leg.sign <= way + stopping(left, self._braking):
            self._enter("coast", time_s)
            return self._coast(time_s)
        if self._elapsed_s(time_s) > PATIENCE * self.leg.seconds + 1.0:
            self._enter("brake", time_s)
        if not trusted:
            self._steadiness.clear()
            return LegOutput(self.leg.level, "transient")
        steady = self._steadiness.push(time_s, rate)
        return LegOutput(self.leg.level, "plateau" if steady else "transient")

    def _coast(self, time_s: float) -> LegOutput:
        if self._elapsed_s(time_s) >= self.leg.coast_s:
            self._enter("brake", time_s)
        return LegOutput(0.0, "coast")

    def _brake(self, forward: float, time_s: float) -> LegOutput:
        leg = self.leg
        # Thrust asked for in the last lag still comes: what it takes off the speed is as good as gone, and no more.
        # An angle has no wall, and the next leg's boost turns it back: waiting would cost it room for its plateau.
        coming_s = LAG_S if leg.axis in TURNING else min(self._elapsed_s(time_s), LAG_S)
        stopped = forward * self._way <= self._braking * coming_s
        given_up = self._elapsed_s(time_s) > 5.0 * abs(leg.rate) / leg.pace + 2.0
        return LegOutput(-leg.sign * self._way * leg.boost, "transit", finished=stopped or given_up)
