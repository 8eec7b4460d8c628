"""Flying one leg: boost, constant force until its end comes near, coast or swing without thrust, brake.

A statistical test on the slope of the last samples decides whether the speed is steady.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

from hindrax_control.maneuver.plan import CHARACTERS, LAG_S, TURNING, Leg, stopping

PATIENCE = 1.6
"""A stretch that takes this many times as long as planned is given up."""
SAMPLE_S = 0.05
"""Samples nearer to each other than this add no information: the navigator filters them."""
SURE = 2.5
"""Standard deviations of the slope within which it passes for zero."""
OVERSHOOT = 1.1
"""Share of a leg's end beyond which a swing is braked."""
SWING_SHARE = 0.5
"""Share of a leg's end from which a swing is worth its time."""
EASED = 0.7
"""Share of its force with which a plateau goes on that was too fast."""
WORTH = 0.5
"""Share of its way that a shortened leg must keep."""
LET_GO = 3.0
"""A plateau ends when the slope is this many times beyond what it may be."""


@dataclass(frozen=True, slots=True)
class LegOutput:
    """Force along the motion beyond bias and restoring [N, N m], name of the phase, and whether the leg is over."""

    force: float
    phase: str
    finished: bool = False


@dataclass(slots=True)
class Easing:
    """What the legs of a motion share: `share` of the planned forces, less than 1 where those were too fast."""

    share: float = 1.0


class LegController:
    """One leg from wherever the vehicle is. Time is the caller's, in seconds."""

    def __init__(self, leg: Leg, easing: Easing | None = None) -> None:
        self.leg, self.seconds = leg, leg.seconds
        self._planned, self._easing = leg.level, easing or Easing()
        # Drag brakes as well, but fades with the speed: it is left out.
        self._braking = leg.boost / leg.inertia
        self._steadiness = self._steady_state_test()
        self._boost_s = CHARACTERS[leg.axis].boost_s
        self._stretch, self._way = "boost", 1.0
        self._since_s = math.nan

    @property
    def ends(self) -> tuple[float, float]:
        """Where it begins and ends [m, rad]."""
        return self.leg.start, self.leg.end

    def shorten(self, low: float, high: float) -> None:
        """Begin and end between these coordinates, unless too little of the leg were left."""
        start, end = (min(max(one, low), high) for one in self.ends)
        if (end - start) * self.leg.sign >= WORTH * abs(self.leg.end - self.leg.start):
            self.leg = replace(self.leg, start=start, end=end)

    def step(self, coordinate: float, rate: float, time_s: float, *, trusted: bool = True) -> LegOutput:
        """Drive on.

        Parameters
        ----------
        coordinate : [m, rad]
            Along the motion.
        rate : [m/s, rad/s]
            Of the coordinate.
        time_s : [s]
            Since the start of the leg.
        trusted
            Whether the rate is measured.

        Returns
        -------
        LegOutput
            Force beyond bias and restoring [N, N m], phase, and whether the leg is over.
        """
        if math.isnan(self._since_s):
            self._since_s = time_s
            self._ease(1.0)
        forward = rate * self.leg.sign
        self._change(coordinate, forward, time_s)
        if self._stretch == "hold":
            self._lose_patience(coordinate, time_s)
            return self._hold(rate, time_s, trusted=trusted)
        return self._pass(coordinate, forward, time_s)

    def _change(self, coordinate: float, forward: float, time_s: float) -> None:
        """Enter the stretch for which it is time: too fast, near enough to coast, or to brake."""
        if forward > self.leg.most and self._stretch in ("boost", "hold"):
            # What the boost has left, as long as its thrust still comes, is no fault of the plateau's force.
            if self._stretch == "hold" and self._elapsed_s(time_s) > LAG_S:
                self._ease(EASED)
            self._enter("ease", time_s)
        # Thrust that is lost to inflow may never bring it up to speed; it swings all the same.
        driven = ("boost", "hold", "push") if self.leg.natural_radps else ("hold", "ease")
        if self.leg.coast_s > 0.0 and self._stretch in driven and self._may_coast(coordinate, forward):
            self._enter("coast", time_s)
        if self._stretch != "brake" and self._at_an_end(coordinate, forward):
            self._enter("brake", time_s)
            self._way = math.copysign(1.0, forward)

    def _pass(self, coordinate: float, forward: float, time_s: float) -> LegOutput:
        """Fly a stretch that is no plateau."""
        if self._stretch == "boost":
            return self._boost(forward, time_s)
        if self._stretch == "ease":
            if forward <= abs(self.leg.rate):
                self._enter("hold", time_s)
            return LegOutput(0.0, "transient")
        if self._stretch == "push":
            return self._push(time_s)
        if self._stretch == "coast":
            return self._coast(time_s)
        return self._brake(coordinate, forward, time_s)

    def _at_an_end(self, coordinate: float, forward: float) -> bool:
        """Whether it is time to brake: before the leg's end, or before the room's end when it is carried backward."""
        leg = self.leg
        way = stopping(forward, self._braking)
        if leg.natural_radps:
            # Driven, it may still move backward from the leg before; without thrust nothing else stops it there.
            outward = coordinate * leg.sign * forward >= 0.0 and (forward >= 0.0 or self._stretch == "coast")
            allowed = OVERSHOOT * abs(leg.end)
            return outward and abs(coordinate) + way > allowed and self._amplitude(coordinate, forward) > allowed
        if forward >= 0.0:
            return (leg.end - coordinate) * leg.sign <= way
        # During the boost it may still move backward from the leg before.
        return self._stretch == "hold" and (coordinate - leg.back) * leg.sign <= way

    def _ease(self, share: float) -> None:
        """Go on with a share of the force that the legs before had: less drag than the prior, or more thrust."""
        self._easing.share *= share
        if self._easing.share < 1.0:
            self.leg = replace(self.leg, level=self._planned * self._easing.share)
            self._steadiness = self._steady_state_test()

    def _steady_state_test(self) -> "SteadyStateTest":
        character = CHARACTERS[self.leg.axis]
        return SteadyStateTest(character.window_s, character.negligible * abs(self.leg.level) / self.leg.inertia)

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

    def _lose_patience(self, coordinate: float, time_s: float) -> None:
        """End a plateau that takes too long: what swings does so from where it is, or is pushed if that is level."""
        leg = self.leg
        if not leg.natural_radps:
            if self._elapsed_s(time_s) > PATIENCE * leg.seconds + 1.0:
                self._enter("brake", time_s)
        elif self._elapsed_s(time_s) > PATIENCE * (leg.seconds - leg.coast_s) + 1.0:
            self._enter("coast" if abs(coordinate) > SWING_SHARE * abs(leg.end) else "push", time_s)

    def _push(self, time_s: float) -> LegOutput:
        if self._elapsed_s(time_s) > PATIENCE * self._boost_s + 1.0:
            self._enter("coast", time_s)
        return LegOutput(self.leg.sign * self.leg.boost, "transient")

    def _hold(self, rate: float, time_s: float, *, trusted: bool) -> LegOutput:
        if not trusted:
            self._steadiness.clear()
            return LegOutput(self.leg.level, "transient")
        steady = self._steadiness.push(time_s, rate)
        return LegOutput(self.leg.level, "plateau" if steady else "transient")

    def _may_coast(self, coordinate: float, forward: float) -> bool:
        """Whether coast and brake, or a swing, would end where the leg does."""
        leg = self.leg
        if leg.natural_radps:
            ahead = coordinate * leg.sign + forward * LAG_S
            if forward < 0.0:
                # Carried back to where it began, it hangs there as far from level as at its end.
                room = (coordinate - leg.back) * leg.sign
                return room <= (0.0 if self._stretch == "boost" else stopping(forward, self._braking))
            return ahead > 0.0 and self._amplitude(ahead, forward) >= abs(leg.end)
        way, left = leg.coast(forward)
        return (leg.end - coordinate) * leg.sign <= way + stopping(left, self._braking)

    def _amplitude(self, coordinate: float, rate: float) -> float:
        """Angle at which the righting moment of the prior alone would turn it back."""
        return math.hypot(coordinate, rate / self.leg.natural_radps)

    def _coast(self, time_s: float) -> LegOutput:
        if self._elapsed_s(time_s) >= self.leg.coast_s:
            self._enter("brake", time_s)
        return LegOutput(0.0, "coast")

    def _brake(self, coordinate: float, forward: float, time_s: float) -> LegOutput:
        leg = self.leg
        # Thrust asked for in the last lag still comes: what it takes off the speed is as good as gone, and no more.
        # An angle has no wall, and the next leg's boost turns it back: waiting would cost it room for its plateau.
        # But what would swing on beyond its end has no room left, and the boost of a slow leg turns little back.
        swings_on = bool(leg.natural_radps) and self._amplitude(coordinate, forward) > abs(leg.end)
        coming_s = LAG_S if leg.axis in TURNING and not swings_on else min(self._elapsed_s(time_s), LAG_S)
        stopped = forward * self._way <= self._braking * coming_s
        given_up = self._elapsed_s(time_s) > 5.0 * abs(leg.rate) / leg.pace + 2.0
        return LegOutput(-leg.sign * self._way * leg.boost, "transit", finished=stopped or given_up)


class SteadyStateTest:
    """Judges the slope of a rate over a window by least squares.

    Steady is a slope that could be zero given its scatter, and that would matter no more than `negligible`
    [m/s^2, rad/s^2] beyond that. Once steady, it takes a clearly larger slope to be unsteady again.
    """

    def __init__(self, window_s: float, negligible: float) -> None:
        self._window_s, self._negligible = window_s, negligible
        self._samples: deque[tuple[float, float]] = deque()
        self._steady = False

    def push(self, time_s: float, rate: float) -> bool:
        """Take a sample and return whether the rate is steady now."""
        samples = self._samples
        if samples and time_s - samples[-1][0] < SAMPLE_S * 0.9:
            return self._steady
        samples.append((time_s, rate))
        while time_s - samples[0][0] > self._window_s + 0.5 * SAMPLE_S:
            samples.popleft()
        if time_s - samples[0][0] < self._window_s - 1.5 * SAMPLE_S:
            self._steady = False
            return False
        slope, sigma = line(samples)
        allowed = SURE * sigma + self._negligible
        self._steady = abs(slope) < (LET_GO * allowed if self._steady else allowed)
        return self._steady

    def clear(self) -> None:
        """Forget all samples: the force has changed."""
        self._samples.clear()


def line(samples: deque[tuple[float, float]]) -> tuple[float, float]:
    """Slope of a least-squares line through (time, value) and the slope's standard deviation."""
    n = len(samples)
    mean_t = sum(t for t, _ in samples) / n
    mean_v = sum(v for _, v in samples) / n
    spread = sum((t - mean_t) ** 2 for t, _ in samples)
    slope = sum((t - mean_t) * v for t, v in samples) / spread
    rest = sum((v - mean_v - slope * (t - mean_t)) ** 2 for t, v in samples)
    return slope, math.sqrt(rest / max(1, n - 2) / spread)
