"""Maneuvers: legs of constant force, planned from pool, limits and prior so that plateaus fit.

A leg drives one degree of freedom in one direction: a boost up to the speed that the prior expects, then the constant
force, a coast without it, then braking before its end. Forward and backward legs alternate, so the vehicle never has to
turn around, and each backward leg ends where the next forward one begins. What rights itself (roll, pitch) ends each
leg back with a free decay instead: one period of its swing with all thrusters at rest.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.goal import ALONG, require_servable
from hindrax_control.pool_bounds import PoolBounds
from hindrax_control.prior_dynamics import PriorDynamics, prior_dynamics
from hindrax_core.errors import UsageError
from hindrax_core.knobs import knob
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.vehicle import AXES, Vehicle

TURNING = ("roll", "pitch", "yaw")
RESTING = ("heave", "roll", "pitch")
"""Their coasts rest all thrusters: what holds the vehicle down meanwhile would lose thrust to the inflow along them."""

LAG_S = 0.25
"""Thrusters and navigation together."""
RISE_m = 0.3
"""While all thrusters rest, net buoyancy may move the vehicle by this much."""
PACE_LEAST = 0.2
"""A boost accelerates at least this much [m/s^2, rad/s^2], however slow the plateau."""
LEVEL_SHARE = 0.85
SPEED_RESERVE, EASED_FROM = 0.8, 0.9
"""Shares of the speed limit: for the fastest plateau, and from which its force is eased."""
TILT_RESERVE = 0.85


@dataclass(frozen=True, slots=True)
class PlanKnobs:
    """Levels, speeds and repeats of the legs."""

    levels: int = knob(3, 1, 20, "force levels per direction in surge, sway and heave [-]")
    turning_levels: int = knob(2, 1, 20, "force levels per direction in roll, pitch and yaw [-]")
    repeats: tuple[int, int, int, int, int, int] = knob(
        (1, 1, 1, 1, 1, 1), 1, 20, "how often the set of each motion is flown, surge to yaw [-]"
    )
    surge_mps: tuple[float, float] = knob((0.1, 0.45), 0.02, 3.0, "slowest and fastest surge plateau [m/s]")
    sway_mps: tuple[float, float] = knob((0.1, 0.4), 0.02, 3.0, "slowest and fastest sway plateau [m/s]")
    heave_mps: tuple[float, float] = knob((0.08, 0.3), 0.02, 3.0, "slowest and fastest heave plateau [m/s]")
    roll_radps: tuple[float, float] = knob((0.3, 0.8), 0.02, 3.0, "slowest and fastest roll plateau [rad/s]")
    pitch_radps: tuple[float, float] = knob((0.35, 0.9), 0.02, 3.0, "slowest and fastest pitch plateau [rad/s]")
    yaw_radps: tuple[float, float] = knob((0.4, 1.2), 0.02, 3.0, "slowest and fastest yaw plateau [rad/s]")
    hover_s: float = knob(8.0, 0.0, 120.0, "time at rest before heave, in which net buoyancy shows [s]")
    plateau_s: float = knob(10.0, 1.0, 120.0, "longest plateau of surge and sway [s]")
    coast_s: float = knob(2.0, 0.0, 30.0, "time without thrust at the end of a leg of surge, sway, heave and yaw [s]")
    swing_s: float = knob(5.0, 0.0, 30.0, "longest swing without thrust at the end of a leg back in roll and pitch [s]")
    turns: float = knob(0.5, 0.1, 10.0, "length of a yaw leg [turns]")
    roll_deg: float = knob(30.0, 2.0, 80.0, "largest roll angle [deg]")
    pitch_deg: float = knob(40.0, 2.0, 80.0, "largest pitch angle [deg]")
    altitude_m: float = knob(0.9, 0.1, 1000.0, "altitude of every motion but heave [m]")
    wall_m: float = knob(0.8, 0.1, 10.0, "distance between hull and wall at which a leg has come to rest [m]")
    surface_m: float = knob(0.15, 0.0, 10.0, "least water above the hull in heave [m]")
    floor_m: float = knob(0.35, 0.0, 10.0, "least water under the hull in heave [m]")
    reserve: float = knob(0.7, 0.1, 1.0, "fraction of the thrusters' reach that boost and brake may use [-]")


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Handling of a degree of freedom."""

    boost_s: float
    """Time to get up to speed."""
    window_s: float
    """Time over which its rate is judged."""
    negligible: float
    """Slope of the rate that counts as none, as the share of the plateau's force that it would take."""


CHARACTERS: Mapping[str, MotionLimits] = {
    "surge": MotionLimits(1.2, 2.0, 0.04),
    "sway": MotionLimits(1.2, 2.0, 0.04),
    "heave": MotionLimits(0.8, 0.6, 0.08),
    "roll": MotionLimits(0.25, 0.25, 0.2),
    "pitch": MotionLimits(0.3, 0.25, 0.2),
    "yaw": MotionLimits(0.8, 1.0, 0.05),
}


@dataclass(frozen=True, slots=True)
class Leg:
    """One run. Coordinates: along the pool (surge, sway), depth (heave) [m]; angle [rad], for yaw from the start."""

    axis: str
    name: str
    """Motion as the identification calls it: heave is heave_down or heave_up."""
    sign: float
    """Direction of force and rate along the body axis."""
    level: float
    """Force of the plateau beyond bias and restoring, signed [N, N m]."""
    rate: float
    """Expected plateau rate, signed [m/s, rad/s]."""
    start: float
    end: float
    back: float
    """End of the room behind the start, before which a leg that is carried backward is given up."""
    boost: float
    """Size of the force that accelerates and brakes [N, N m]."""
    pace: float
    """Acceleration that the boost makes against the prior's inertia [m/s^2, rad/s^2]."""
    inertia: float
    """Rigid body and added mass of the prior [kg, kg m^2]."""
    coast_s: float
    """Longest time without thrust between plateau and braking [s]."""
    seconds: float
    """Expected duration [s]."""
    most: float = math.inf
    """Rate from which the force of the plateau is eased, [m/s]: little below the limit that ends the flight."""
    natural_radps: float = 0.0
    """Natural frequency of the prior where the leg ends in a swing: what rights itself stops without thrust."""

    def coast(self, forward: float) -> tuple[float, float]:
        """Way of a coast from a plateau at this rate ahead, and the rate that is left."""
        return coasting(forward, abs(self.level) / self.inertia, self.coast_s)


@dataclass(frozen=True, slots=True)
class Plan:
    """Legs of one motion, the pose in which they begin, and how long they should take."""

    motion: str
    legs: tuple[Leg, ...]
    heading_rad: float
    """From the pool's length."""
    vertical: tuple[str, float]
    """Hold and setpoint before the first leg: altitude or depth [m]."""
    start_m: tuple[float, float]
    """Place in the pool."""
    hover_s: float
    """Time at rest before the first leg."""

    @property
    def end_m(self) -> tuple[float, float]:
        """End of the last leg in the pool."""
        return (self.legs[-1].end, self.start_m[1]) if self.motion in ALONG else self.start_m

    @property
    def seconds(self) -> float:
        """Expected duration of hovering and all legs [s]."""
        return self.hover_s + sum(leg.seconds for leg in self.legs)

    @property
    def rates(self) -> tuple[float, ...]:
        """Plateau rates in the order in which they are flown, each out and back [m/s, rad/s]."""
        return tuple(leg.rate for leg in self.legs[::2])

    def __str__(self) -> str:
        """One line: rates in their order, and how long they should take."""
        rates = ", ".join(f"{rate:.2f}" for rate in self.rates)
        unit = "rad/s" if self.motion in TURNING else "m/s"
        hover = f"hover {self.hover_s:.0f} s, then " if self.hover_s > 0.0 else ""
        return f"{self.motion}: {hover}{rates} {unit}, each out and back; {self.seconds:.0f} s"


class Planner:
    """Plans motions for one vehicle in one pool with the thrusters that work."""

    def __init__(
        self, vehicle: Vehicle, allocator: Allocator, knobs: PlanKnobs, disabled: frozenset[str] = frozenset()
    ) -> None:
        self.vehicle, self.knobs = vehicle, knobs
        self.freedoms = prior_dynamics(vehicle)
        self._allocator, self.disabled = allocator, disabled

    def plan(self, motion: str, pool: PoolBounds, levels: Sequence[float] = ()) -> Plan:
        """Plan one motion.

        Parameters
        ----------
        motion
            One of AXES.
        pool
            Room for it.
        levels : [-]
            Plateaus to fly, from 0, the slowest, to 1, the fastest; without them, those of the knobs.

        Returns
        -------
        Plan
            Legs with their forces, and how long they take.

        Raises
        ------
        UsageError
            Where pool, limits or thrusters leave no room for it.
        """
        if motion not in AXES:
            raise UsageError(Refusal(Reason.GOAL, f"motion {motion!r}: unknown, wanted one of {', '.join(AXES)}"))
        require_servable((motion,), self.vehicle, self.disabled)
        low, high = self._span(motion, pool)
        if high <= low:
            sentence = (
                f"{motion}: the pool leaves {high - low:.2f} m of room, wanted more; "
                "check `pool` in the vehicle file and the margins among the pilot's parameters"
            )
            raise UsageError(Refusal(Reason.POOL, sentence))
        legs = self._legs(motion, low, high, levels)
        along_m = legs[0].start if motion in ALONG else 0.5 * pool.length_m
        return Plan(
            motion,
            legs,
            # Sway is flown along the length too: with the bow to the west, starboard is north.
            heading_rad=-math.pi / 2.0 if motion == "sway" else 0.0,
            vertical=("depth", low) if motion == "heave" else ("altitude", self._altitude_m(pool)),
            start_m=(along_m, 0.5 * pool.width_m),
            hover_s=self.knobs.hover_s if motion == "heave" else 0.0,
        )

    def _altitude_m(self, pool: PoolBounds) -> float:
        """Altitude of every motion but heave; UsageError when the hull would not be in the water."""
        found_m, half_height_m = self.knobs.altitude_m, 0.5 * self.vehicle.envelope_m[2]
        if not half_height_m <= found_m <= pool.depth_m - half_height_m:
            wanted = f"{half_height_m:.2f} to {pool.depth_m - half_height_m:.2f} m, the hull within the pool"
            raise UsageError(Refusal(Reason.POOL, f"plan.altitude_m: found {found_m:g} m, wanted {wanted}"))
        return found_m

    def force_limit(self, axis: str, sign: float) -> float:
        """Largest force [N, N m] that a plan may ask for along an axis: thrusters with reserve, vehicle limit."""
        reach = self._allocator.reach(axis, sign, self.disabled)
        return min(self.knobs.reserve * reach, self.vehicle.limits.wrench[AXES.index(axis)])

    def _span(self, motion: str, pool: PoolBounds) -> tuple[float, float]:
        """Lowest and highest coordinate of the legs."""
        knobs = self.knobs
        half_height_m = 0.5 * self.vehicle.envelope_m[2]
        if motion in ALONG:
            half_m = pool.half_length_m if motion == "surge" else pool.half_width_m
            return half_m + knobs.wall_m, pool.length_m - half_m - knobs.wall_m
        if motion == "heave":
            return half_height_m + knobs.surface_m, pool.depth_m - half_height_m - knobs.floor_m
        if motion == "yaw":
            return 0.0, math.tau * knobs.turns
        wanted_deg = knobs.roll_deg if motion == "roll" else knobs.pitch_deg
        tilt_rad = math.radians(min(wanted_deg, TILT_RESERVE * self.vehicle.limits.tilt_deg))
        return -tilt_rad, tilt_rad

    def _legs(self, motion: str, low: float, high: float, levels: Sequence[float]) -> tuple[Leg, ...]:
        rates = self._rates(motion, levels or self._levels(motion))
        spans = [self._stretch(motion, rate, low, high) for rate in rates]
        # Each leg back ends where the next leg out begins; the last one where it began.
        backs = [*(begin for begin, _ in spans[1:]), spans[-1][0]]
        legs: list[Leg] = []
        for rate, (begin, far), back in zip(rates, spans, backs, strict=True):
            legs += [self._leg(motion, rate, (begin, far, low)), self._leg(motion, -rate, (far, back, high))]
        return tuple(legs)

    def _levels(self, motion: str) -> list[float]:
        """Levels by the knobs.

        The fastest and the slowest come first: they show most of the drag, so an early end already knows it.
        """
        count = self.knobs.turning_levels if motion in TURNING else self.knobs.levels
        rising = [index / (count - 1) for index in range(count - 1)]
        return [1.0, *rising] * self.knobs.repeats[AXES.index(motion)]

    def _rates(self, motion: str, levels: Sequence[float]) -> list[float]:
        """Plateau rates of these levels, no faster than limits and thrusters allow in either direction."""
        turning = motion in TURNING
        low, high = getattr(self.knobs, f"{motion}_{'radps' if turning else 'mps'}")
        freedom = self.freedoms[motion]
        fastest = min(abs(freedom.rate_at(sign * LEVEL_SHARE * self.force_limit(motion, sign))) for sign in (-1.0, 1.0))
        if not turning:
            fastest = min(fastest, SPEED_RESERVE * self.vehicle.limits.speed_mps)
        high = min(high, fastest)
        low = min(low, high)
        return [low + (high - low) * level for level in levels]

    def _stretch(self, motion: str, rate: float, low: float, high: float) -> tuple[float, float]:
        """Begin and end of a leg of this rate: about the middle, as long as its plateau needs."""
        if motion not in ALONG:
            return low, high
        freedom = self.freedoms[motion]
        coast_m, _ = coasting(rate, freedom.drag_force(rate) / freedom.inertia, self.knobs.coast_s)
        wanted_m = rate * (self.knobs.plateau_s + CHARACTERS[motion].boost_s) + coast_m + stopping(rate, PACE_LEAST)
        half_m, middle_m = 0.5 * min(wanted_m, high - low), 0.5 * (low + high)
        return middle_m - half_m, middle_m + half_m

    def _leg(self, motion: str, rate: float, stretch: tuple[float, float, float]) -> Leg:
        """One leg at a signed rate; `stretch`: start, end, and the end of the room behind."""
        freedom = self.freedoms[motion]
        start, end, back = stretch
        boost, pace = self._boost(motion, freedom, rate)
        leg = Leg(
            axis=motion,
            name=motion_name(motion, rate),
            sign=math.copysign(1.0, rate),
            level=freedom.drag_force(rate),
            rate=rate,
            start=start,
            end=end,
            back=back,
            boost=boost,
            pace=pace,
            inertia=freedom.inertia,
            coast_s=self.knobs.coast_s,
            # On the way up to speed half of the way is lost; braking ends before the leg does.
            seconds=abs((end - start) / rate) + 0.5 * abs(rate) / pace,
            most=math.inf if motion in TURNING else EASED_FROM * self.vehicle.limits.speed_mps,
        )
        if freedom.restoring < 0.0:
            # Top-heavy: without thrust it turns over.
            return replace(leg, coast_s=0.0)
        if freedom.restoring:
            natural_radps = math.sqrt(freedom.restoring / freedom.inertia)
            swing_s = min(self.knobs.swing_s, math.tau / natural_radps, self._risen_s)
            if swing_s and rate > 0.0:
                # From near level, where the swing before has ended.
                return replace(leg, coast_s=0.0, seconds=0.6 * leg.seconds)
            return replace(leg, coast_s=swing_s, natural_radps=swing_s and natural_radps, seconds=leg.seconds + swing_s)
        way, _ = leg.coast(abs(rate))
        return replace(leg, seconds=leg.seconds + leg.coast_s - way / abs(rate))

    @property
    def _risen_s(self) -> float:
        """Time in which net buoyancy alone moves the vehicle by `RISE_m`, from rest."""
        heave = self.freedoms["heave"]
        return math.sqrt(2.0 * RISE_m * heave.inertia / max(1e-9, abs(heave.bias)))

    def _boost(self, motion: str, freedom: PriorDynamics, rate: float) -> tuple[float, float]:
        """Force that accelerates to a rate in the character's time, within the limit, and the acceleration it makes."""
        drag = abs(freedom.drag_force(rate))
        wanted = freedom.inertia * abs(rate) / CHARACTERS[motion].boost_s + drag
        limit = min(self.force_limit(motion, 1.0), self.force_limit(motion, -1.0))
        boost = min(max(wanted, freedom.inertia * PACE_LEAST + drag), limit)
        return boost, max(boost - drag, 0.1 * boost) / freedom.inertia


def plans_of(vehicle: Vehicle, motions: Sequence[str]) -> tuple[Plan, ...]:
    """Plan of the pilot with default parameters, in its pool; UsageError as `Planner.plan`."""
    planner = Planner(vehicle, Allocator(vehicle), PlanKnobs())
    return tuple(planner.plan(motion, PoolBounds(vehicle, 0.0)) for motion in motions)


def motion_name(axis: str, rate: float) -> str:
    """Name of what is identified: drag down and drag up are two motions (COB-2023-1394, Table 3)."""
    return axis if axis != "heave" else "heave_down" if rate > 0.0 else "heave_up"


def stopping(rate: float, pace: float) -> float:
    """Way [m, rad] from full speed to rest: the lag of thrusters and senses, then an even deceleration."""
    return abs(rate) * LAG_S + 0.5 * rate * rate / pace


def coasting(rate: float, slowing: float, coast_s: float) -> tuple[float, float]:
    """Way of a coast from a steady rate ahead, and the rate that is left: v' = -k v |v| after a lag.

    Parameters
    ----------
    rate : [m/s, rad/s]
        At its beginning.
    slowing : [m/s^2, rad/s^2]
        The force of the plateau over the inertia; at that rate it is the drag, whatever the prior says.
    coast_s : [s]
        Its duration.

    Returns
    -------
    tuple[float, float]
        [m, rad] and [m/s, rad/s].
    """
    if rate <= 0.0:
        return 0.0, rate
    lag_s = min(LAG_S, coast_s)
    slowed = slowing * (coast_s - lag_s) / rate
    share = math.log1p(slowed) / slowed if slowed else 1.0
    return rate * (lag_s + (coast_s - lag_s) * share), rate / (1.0 + slowed)
