"""How far off dead reckoning may be: what the errors of its DVL do to the position since it was last known.

A bias b of the DVL is constant in body axes, so it adds the integral of R(heading) b: a vehicle that turns around
takes it back. A wrong speed of sound and a wrong angle of mount or heading scale and turn the whole way, so their
error is a share of the distance from where the position was known. Noise of the single velocities is a random walk.
A velocity that is not measured errs the same way all the time.

    sigma^2 = bias^2 |integral of R(heading) dt|^2 + share^2 distance^2 + sum of (sigma_v interval)^2 + unmeasured^2

The priors are knobs. Bias: the maker of the DVL-75 promises a drift of less than 1 m per minute, 17 mm/s, over ground
with plants and with the vehicle's control in it (Tracker 650, page "Expectations"); over the hard floor of a pool we
take 3 mm/s, three times the resolution. Share: 1 % of scale (Water Linked A50, long-term accuracy of its standard
edition), 1 degree of mount by eye, and 1 degree of heading, in squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_core.knobs import knob


@dataclass(frozen=True)
class PositionKnobs:
    """What is believed of the errors of the DVL before anything is known of them."""

    dvl_bias_mps: float = knob(0.003, 0.0, 1.0, "standard deviation of a constant bias of the DVL, each axis [m/s]")
    dvl_share: float = knob(0.027, 0.0, 1.0, "error of the distance by scale, mount and heading, as a share of it [-]")


class PositionUncertainty:
    """Standard deviation of north and of east, the same for both, since the position was last known."""

    def __init__(self, knobs: PositionKnobs) -> None:
        self._knobs = knobs
        self.known()

    def known(self) -> None:
        """Begin anew: the position is known now."""
        self._ahead_s = self._aside_s = self._north_m = self._east_m = 0.0
        self._noise_m2 = self._unmeasured_m = 0.0

    def move(self, heading_rad: float, north_m: float, east_m: float, dt_s: float) -> None:
        """Count a step of dead reckoning with this heading."""
        self._ahead_s += dt_s * math.cos(heading_rad)
        self._aside_s += dt_s * math.sin(heading_rad)
        self._north_m += north_m
        self._east_m += east_m

    def measured(self, sigma_mps: float, interval_s: float) -> None:
        """Count the noise of one velocity, the mean over an interval."""
        self._noise_m2 += (sigma_mps * interval_s) ** 2

    def unmeasured(self, sigma_mps: float, dt_s: float) -> None:
        """Count a time in which the velocity was only predicted, or not known at all."""
        self._unmeasured_m += sigma_mps * dt_s

    @property
    def sigma_m(self) -> float:
        """Standard deviation of each coordinate [m]."""
        bias_m = self._knobs.dvl_bias_mps * math.hypot(self._ahead_s, self._aside_s)
        share_m = self._knobs.dvl_share * math.hypot(self._north_m, self._east_m)
        return math.hypot(bias_m, share_m, math.sqrt(self._noise_m2), self._unmeasured_m)
