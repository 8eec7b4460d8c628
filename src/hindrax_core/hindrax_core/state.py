"""What the rooms tell each other: navigation state, allocation, identification samples and estimates.

All in SNAME body axes (x forward, y starboard, z down; order surge, sway, heave, roll, pitch, yaw) and SI units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from hindrax_core.readings import Vec3, Vec6

NAN = math.nan
UNKNOWN6: Vec6 = (NAN, NAN, NAN, NAN, NAN, NAN)
ZERO6: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Navigation:
    """Best knowledge of the vehicle's motion. NaN where nothing is known; `ages_s` says how old each source is.

    `attitude_rad` is roll, pitch, yaw (z-y-x, yaw clockwise from north); `velocity_mps` is u, v, w; `rate_radps` is
    p, q, r; `position_m` is north and east of the point of start, by dead reckoning; depth is below the surface,
    altitude above the bottom, both of the body origin.
    """

    attitude_rad: Vec3
    rate_radps: Vec3
    velocity_mps: Vec3
    depth_m: float
    altitude_m: float
    position_m: tuple[float, float]
    dvl_locked: bool
    ages_s: Mapping[str, float] = field(default_factory=dict)
    velocity_sigma_mps: Vec3 = (NAN, NAN, NAN)


@dataclass(frozen=True, slots=True)
class Allocation:
    """One allocation: what was wanted, what the pulses achieve, what is missing, and why."""

    wanted: Vec6
    achieved: Vec6
    shortfall: Vec6
    forces_N: tuple[float, ...]
    pulses_us: tuple[int, ...]
    saturated: tuple[bool, ...]
    disabled: tuple[str, ...] = ()
    lost_axes: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Velocity:
    """A velocity measurement in body axes at the center of mass; NaN where this source says nothing."""

    nu: Vec6
    sigma: Vec6
    source: str


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll, pitch, yaw [rad] and depth [m], for the restoring terms; NaN where unknown."""

    attitude_rad: Vec3
    depth_m: float = NAN


@dataclass(frozen=True, slots=True)
class Thrust:
    """The wrench that the applied pulses achieve, from this stamp until the next (before thruster lag) [N, Nm].

    `forces_N`: what each thruster gives, in the order of the vehicle file; empty where nobody says.
    """

    wrench: Vec6
    forces_N: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Phase:
    """What the maneuver is doing: motion ("surge", "heave_down", ...; empty: none) and phase.

    Phases: "settle" (holds only), "transit" (turning back, approaching), "transient" (force applied, speed still
    changing), "plateau" (speed steady), "hover" (at rest: its thrust weighs it), "excite" (information-rich
    excitation).
    """

    motion: str
    phase: str


IdentEvent: TypeAlias = Velocity | Attitude | Thrust | Phase


@dataclass(frozen=True, slots=True)
class Estimate:
    """A model estimate: coefficients in the order of `names`, covariance row by row, and whether it is learning."""

    motion: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    samples: int
    effective_samples: float
    learning: bool
    reason: str
    innovation: float = NAN

    @property
    def sigmas(self) -> tuple[float, ...]:
        """Standard deviations, the square roots of the diagonal."""
        return tuple(math.sqrt(row[index]) for index, row in enumerate(self.covariance))
