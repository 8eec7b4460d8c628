"""Data that packages exchange: navigation state, allocation, identification samples and estimates.

All in SNAME body axes (x forward, y starboard, z down; order surge, sway, heave, roll, pitch, yaw) and SI units.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple, TypeAlias

from hindrax_core.events import Stamp
from hindrax_core.readings import Vec3, Vec6

NAN = math.nan
UNKNOWN6: Vec6 = (NAN, NAN, NAN, NAN, NAN, NAN)
ZERO6: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NEVER = Stamp(0)


@dataclass(frozen=True, slots=True)
class Consistency:
    """Evidence of the filters for and against a state.

    `began`: when this state began, from nothing; `gravity_off_rad`: angle between gravity as measured and as estimated,
    smoothed; `refused_depths`, `refused_velocities`: how many more were refused than accepted lately; `sunk_off_m`: way
    down by DVL less that by pressure and accelerometer, of the last seconds; `frozen_s`: time for which the inertial
    sensor has repeated one sample; `velocity_gain`: changes of velocity by DVL over those by the accelerometer, as
    north + i east, which is 1 but for a wrong scale or mount, and its standard deviation; `drifted_off_m`: by how much
    the depth is too large, as DVL and range to the floor agree.
    """

    began: Stamp = NEVER
    tilt_sigma_rad: float = 0.0
    gravity_off_rad: float = 0.0
    refused_depths: int = 0
    refused_velocities: int = 0
    sunk_off_m: float = 0.0
    frozen_s: float = 0.0
    velocity_gain: complex = 1.0 + 0j
    velocity_gain_sigma: float = math.inf
    drifted_off_m: float = 0.0


CONSISTENT = Consistency()


@dataclass(frozen=True, slots=True)
class Navigation:
    """Estimated motion of the vehicle. NaN where unknown; `ages_s` is the age of what was last used of each sensor.

    `depth_age_s` and `altitude_age_s` are the ages of the measurements that those two come from, whichever sensor gave
    them; infinite before the first.

    `attitude_rad` is roll, pitch, yaw (z-y-x, yaw clockwise from north); `velocity_mps` is u, v, w; `rate_radps` is
    p, q, r; `position_m` is north and east of the point of start, by dead reckoning, `position_sigma_m` the standard
    deviation of each since the position was last known; depth is below the surface, altitude above the bottom, both of
    the body origin.
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
    consistency: Consistency = CONSISTENT
    position_sigma_m: float = NAN
    depth_age_s: float = math.inf
    altitude_age_s: float = math.inf


@dataclass(frozen=True, slots=True)
class Allocation:
    """One allocation: wanted and achieved wrench, shortfall, and the reason for it.

    `exact`: the forces give the largest part of the wrench that can be had in order of priority. It is False only
    where the limits leave none, and that is a fault of the curves or of the allocator.
    """

    wanted: Vec6
    achieved: Vec6
    shortfall: Vec6
    forces_N: tuple[float, ...]
    pulses_us: tuple[int, ...]
    saturated: tuple[bool, ...]
    disabled: tuple[str, ...] = ()
    lost_axes: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    exact: bool = True


class Command(NamedTuple):
    """Pulses wanted: thrusters and lamps in the order of the vehicle file [us]. No lights: leave them as they are."""

    pulses_us: tuple[float, ...]
    lights_us: tuple[float, ...]
    stamp: Stamp
    sequence: int


class AppliedOutput(NamedTuple):
    """Output: whether armed, pulses [us] with the time of theirs, sequence of the last command, armings so far.

    `phase` of the output guard and `reason`, where they are known.
    """

    stamp: Stamp
    armed: bool
    pulses_us: tuple[float, ...]
    sequence: int
    armings: int
    phase: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Velocity:
    """A velocity measurement in body axes at the center of mass; NaN where the source has no value."""

    nu: Vec6
    source: str


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll, pitch, yaw [rad] and depth [m], for the restoring terms; NaN where unknown."""

    attitude_rad: Vec3
    depth_m: float = NAN


@dataclass(frozen=True, slots=True)
class Way:
    """Distance covered along the body axes, forward, to starboard and down [m], from any origin; NaN where unknown.

    Of what measures a place and no velocity: a sonar that looks at a wall, a pose. The fit takes it as it is, since
    the difference of two places divides their noise by the time between them.
    """

    way_m: Vec3
    source: str


class Supply(IntEnum):
    """How the supply voltage is known with which forces were computed; more is better."""

    ASSUMED = 0
    """The nominal one of the vehicle file."""
    AT_REST = 1
    """Between those that were measured before and after, with the thrusters at rest."""
    MEASURED = 2
    """Measured while the thrusters worked."""


@dataclass(frozen=True, slots=True)
class Thrust:
    """The wrench that the applied pulses achieve, from this stamp until the next (before thruster lag) [N, N m].

    `forces_N`: what each thruster gives, in the order of the vehicle file; empty where unknown.
    `supply`: how the supply voltage is known that they were computed with.
    """

    wrench: Vec6
    forces_N: tuple[float, ...] = ()
    supply: Supply = Supply.ASSUMED


BLOCKED = "blocked"
PHASES = ("settle", "hover", "transit", "transient", "plateau", "coast", "excite", BLOCKED)
"""Phases of a maneuver: "settle" (holds only), "transit" (turning back, approaching), "transient" (force applied, speed
still changing), "plateau" (speed steady), "coast" (force taken away at speed), "hover" (at rest: its thrust weighs it),
"excite" (information-rich excitation), "blocked" (thrust without motion: no data, nor what led to it)."""


@dataclass(frozen=True, slots=True)
class Phase:
    """State of the maneuver: motion ("surge", "heave_down", ...; empty: none) and phase, one of `PHASES`."""

    motion: str
    phase: str


IdentEvent: TypeAlias = Velocity | Attitude | Way | Thrust | Phase


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
