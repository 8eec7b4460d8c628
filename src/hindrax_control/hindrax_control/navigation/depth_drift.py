"""Depth by pressure that drifts: found where the DVL and the floor both contradict it, the same way.

A pressure sensor that warms up or clogs drifts by centimeters a second, which no gate refuses: accelerometer and filter
follow. Two witnesses remember. The way down by DVL less that by pressure is summed up, each sign by itself, less what
the DVL may be wrong by, never below zero (CUSUM, Page 1954). The floor (depth and altitude) must be where it was when
the vehicle was at the same place before: what slopes or has steps comes back. Either errs as slowly by itself, a DVL by
its bias and by the way ahead that its mount turns into the vertical, the floor by an echo of something else; both
together, by as much and with the same sign, do not.

Where a pressure repeats one value to the last digit, it is a witness against itself, and the floor alone decides: so a
sensor that hangs is found without a DVL too.
"""

import math

BIAS_mps = 0.003
"""What a DVL reads too much at rest; as much as the wall guard reckons with."""
LEAK = 0.005
"""Part of the way ahead that it may take for a way down. A mount is off by more; the floor then contradicts it."""
REPEATED_S = 3.0
"""Time of one and the same pressure from which on it counts as hung: its noise is many counts."""
PLACE_m = 1.0
REMEMBERED_S = 240.0
"""After that, the dead reckoning may have come to another place."""


class DepthDrift:
    """Two sums of the way by DVL less that by pressure, and the floor by place."""

    def __init__(self) -> None:
        self._gone_m = [0.0, 0.0]
        self._floors: dict[tuple[int, int], tuple[float, float]] = {}
        """Depth of the floor and time of the visit, by place."""
        self._fell_m = 0.0
        self._pressure_Pa = self._changed_s = self._now_s = math.nan

    def pressure(self, pressure_Pa: float, now_s: float) -> None:
        """Take a pressure as it was measured."""
        if pressure_Pa != self._pressure_Pa:
            self._pressure_Pa, self._changed_s = pressure_Pa, now_s
        self._now_s = now_s

    def step(self, off_mps: float, ahead_mps: float, span_s: float) -> None:
        """Take a velocity of the DVL.

        Parameters
        ----------
        off_mps : [m/s]
            Way down by it less that by pressure.
        ahead_mps : [m/s]
            Speed over ground.
        span_s : [s]
            Its time.
        """
        for at, sign in enumerate((1.0, -1.0)):
            gone_m = self._gone_m[at] + span_s * (sign * off_mps - BIAS_mps - LEAK * ahead_mps)
            self._gone_m[at] = max(0.0, gone_m)

    def floor(self, floor_m: float, place_m: tuple[float, float], now_s: float) -> None:
        """Take a depth of the floor, where the place is known; what is not (NaN) changes nothing.

        Parameters
        ----------
        floor_m : [m]
            Depth of the vehicle and range below it.
        place_m : (2,) [m]
            North and east.
        now_s : [s]
            Filter time.
        """
        if math.isfinite(floor_m + sum(place_m)):
            place = (math.floor(place_m[0] / PLACE_m), math.floor(place_m[1] / PLACE_m))
            then_m, then_s = self._floors.setdefault(place, (floor_m, now_s))
            self._fell_m = floor_m - then_m
            if now_s - then_s > REMEMBERED_S:
                self._floors[place] = floor_m, now_s

    @property
    def off_m(self) -> float:
        """How much too deep the depth has become, as far as both agree; negative where it is too high [m]."""
        hung = self._now_s - self._changed_s >= REPEATED_S
        too_high, too_deep = (math.inf, math.inf) if hung else self._gone_m
        return max(0.0, min(too_deep, self._fell_m)) - max(0.0, min(too_high, -self._fell_m))
