"""The guards of a maneuver: from before arming to after disarming, each with a reason and a sentence.

A guard checks one quantity and returns the found and the wanted value, or nothing. Guards of things that flicker must
find the same for a while before they count.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from hindrax_control.maneuver.plan import LAG_S
from hindrax_control.pool_bounds import GuardedPlace, PoolPosition
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_control.sensors import velocity_is_estimated, without_velocity
from hindrax_core.knobs import choice, knob
from hindrax_core.signals import NAN, Navigation
from hindrax_core.text.digits import above, below, unlike
from hindrax_core.text.refusals import AIDING, BAROMETER, Reason, Refusal, found
from hindrax_core.vehicle import Vehicle

MOVES_mps = 0.2
"""Thrust that the prior expects to move the vehicle this fast must move it: no current in a pool is faster."""
BLOCKED_SHARE = 0.25
"""Share of the expected speed below which it does not move."""
BLOCKED_PHASE_S = 1.5
"""Time without motion after which the maneuver reports it; a leg is up to speed before."""
LEAST_UNCERTAINTY_m = 0.01
"""Margin for an uncertain position that is worth mentioning."""

AUTO, SLOW, FLY = "auto", "slow", "fly"


@dataclass(frozen=True, slots=True)
class ManeuverGuardKnobs:
    """Limits of each guard; those of the vehicle itself are in its file."""

    wall_m: float = knob(0.3, 0.0, 10.0, "least distance between hull and wall, after braking [m]")
    surface_m: float = knob(-0.3, -1.0, 10.0, "least depth of the hull's top; it floats before a dive [m]")
    doubt: float = knob(2.0, 0.0, 5.0, "standard deviations of the position added to the distance from walls [-]")
    floor_m: float = knob(0.15, 0.0, 10.0, "least distance between hull and floor [m]")
    unlocked_s: float = knob(5.0, 0.1, 60.0, "longest time without a bottom lock of the DVL [s]")
    inertial_age_s: float = knob(0.2, 0.01, 10.0, "oldest inertial sample [s]")
    depth_age_s: float = knob(1.0, 0.05, 10.0, "oldest depth [s]")
    braking_mps2: float = knob(0.35, 0.01, 10.0, "guaranteed deceleration [m/s^2]")
    blocked_s: float = knob(5.0, 0.5, 60.0, "longest time of thrust without motion [s]")
    battery_s: float = knob(2.0, 0.0, 60.0, "longest time below the least voltage: a boost pulls it down [s]")
    patience_s: float = knob(0.3, 0.0, 10.0, "time for which tilt, speed and age must be wrong [s]")
    unproven: str = choice(
        AUTO, (AUTO, SLOW, FLY), "a vehicle file that was never commissioned: slow, but for a mock; slow; fly"
    )


@dataclass(frozen=True, slots=True)
class Situation:
    """Input of the guards, besides their memory."""

    navigation: Navigation
    place: PoolPosition | None
    """None before the pool's axes are known."""
    walls_m: Mapping[str, float]
    """Distance from the hull to each wall of the pool."""
    time_s: float
    battery_V: float = NAN
    """NaN where there is no battery sensor."""
    water_in_hull: bool = False
    deadline_s: float = math.inf
    """Time at which the maneuver should long be over."""
    lost_axes: tuple[str, ...] = ()
    needed_axes: tuple[str, ...] = ()
    thrust_N: tuple[float, float] = (0.0, 0.0)
    """Surge and sway force of the last cycle."""
    unplaced: str = ""
    """Reason why its position in the pool is unknown; empty: it is at `place`."""


class Finding(NamedTuple):
    """What a guard found and wanted: empty where all is well; `remedy`: where it is not that of the reason."""

    guard: Reason
    text: str
    remedy: str = ""


class ManeuverGuards:
    """All guards of one vehicle."""

    def __init__(self, vehicle: Vehicle, knobs: ManeuverGuardKnobs | None = None) -> None:
        self._vehicle, self._knobs = vehicle, knobs or ManeuverGuardKnobs()
        self._half_height_m = 0.5 * vehicle.envelope_m[2]
        self._inertial = vehicle.measuring("rates")
        self._depth = vehicle.measuring("depth")
        self._velocity = vehicle.measuring("velocity")
        self._velocity_remedy = AIDING if velocity_is_estimated(vehicle) else ""
        by_autopilot = [name for name in self._depth if vehicle.sensors[name].device == "ardusub"]
        self._depth_remedy = BAROMETER.format(name=by_autopilot[0]) if by_autopilot else ""
        self._freedoms = prior_dynamics(vehicle)
        self._patience_s = dict.fromkeys((Reason.ATTITUDE, Reason.SPEED, Reason.SENSOR_AGE), self._knobs.patience_s)
        """The other guards act at once."""
        self._patience_s |= {Reason.DVL_LOCK: self._knobs.unlocked_s, Reason.BLOCKED: self._knobs.blocked_s}
        self._patience_s |= {Reason.BATTERY: self._knobs.battery_s}
        self._wrong_since_s: dict[Reason, float] = {}

    def step(self, situation: Situation) -> tuple[Refusal, ...]:
        """Return "guard: what is wrong; what to do" for everything that is wrong now; nothing when all is well."""
        wrong = [one for one in self._guards(situation) if one.text]
        self._wrong_since_s = {one.guard: self._wrong_since_s.get(one.guard, situation.time_s) for one in wrong}
        return tuple(
            found(*one)
            for one in wrong
            if situation.time_s - self._wrong_since_s[one.guard] >= self._patience_s.get(one.guard, 0.0)
        )

    def _guards(self, situation: Situation) -> Iterator[Finding]:
        """Yield what each guard found."""
        navigation, limits = situation.navigation, self._vehicle.limits
        yield Finding(Reason.POOL_BOX, situation.unplaced or self._pool_box(situation.place, situation.walls_m))
        yield Finding(Reason.DEPTH_BAND, self._depth_band(navigation.depth_m))
        under_m, least_m = navigation.altitude_m - self._half_height_m, self._knobs.floor_m
        yield Finding(Reason.ALTITUDE_BAND, below("{} m of water under the hull, wanted {} m", under_m, least_m, 2))
        least_V = limits.battery_V
        yield Finding(Reason.BATTERY, below("{} V, wanted at least {} V", situation.battery_V, least_V, 1))
        yield Finding(Reason.LEAK, "found water in the hull, wanted it dry" if situation.water_in_hull else "")
        late_s = situation.time_s - situation.deadline_s
        yield Finding(Reason.TIME_OUT, f"{late_s:.0f} s later than it should long be over" if late_s > 0.0 else "")
        lost = [axis for axis in dict.fromkeys(situation.needed_axes) if axis in situation.lost_axes]
        yield Finding(Reason.THRUSTERS, f"{', '.join(lost)} cannot be served without the disabled ones" if lost else "")
        yield Finding(Reason.ATTITUDE, self._attitude(navigation))
        speed_mps = math.sqrt(sum(v * v for v in navigation.velocity_mps if math.isfinite(v)))
        yield Finding(Reason.SPEED, above("{} m/s, wanted at most {} m/s", speed_mps, limits.speed_mps, 2))
        yield self._sensor_age(navigation)
        yield Finding(Reason.BLOCKED, self._blocked(situation))
        yield Finding(Reason.DVL_LOCK, self._dvl_lock(situation), self._velocity_remedy)

    def is_blocked(self, time_s: float) -> bool:
        """Whether thrust has not moved it for a while, even if not yet long enough for the guard."""
        return time_s - self._wrong_since_s.get(Reason.BLOCKED, time_s) >= BLOCKED_PHASE_S

    def _pool_box(self, place: PoolPosition | None, walls_m: Mapping[str, float]) -> str:
        """Walls, with the way that braking takes: a fast vehicle is stopped earlier than a slow one."""
        if place is None or not all(map(math.isfinite, (place.x_m, place.y_m, place.heading_rad))):
            return ""
        wanted_m, words = self.margin(place)
        wall, left_m = nearest(walls_after_braking_m(place, walls_m, self._knobs))
        near, _ = unlike(left_m, wanted_m, 2)
        return f"{near} m to the {wall} wall after braking, wanted {words}" if left_m < wanted_m else ""

    def guarded(self, place: PoolPosition, walls_m: Mapping[str, float], unplaced: str) -> GuardedPlace:
        """A place as the guard sees it.

        Parameters
        ----------
        place
            In pool axes.
        walls_m
            Distance from the hull to each wall [m].
        unplaced
            Why the place is not known; empty where it is.

        Returns
        -------
        GuardedPlace
            With the distances after braking, and the least one allowed [m].
        """
        left_m = walls_after_braking_m(place, walls_m, self._knobs)
        return GuardedPlace(place, left_m, self.margin(place)[0], unplaced)

    def margin(self, place: PoolPosition) -> tuple[float, str]:
        """Least distance to a wall with the position uncertainty of this place [m], and the same as text."""
        margin_m = self._knobs.doubt * place.sigma_m if place.sigma_m > 0.0 else 0.0
        text = f" and {margin_m:.2f} m uncertainty" if margin_m >= LEAST_UNCERTAINTY_m else ""
        return self._knobs.wall_m + margin_m, f"{self._knobs.wall_m:.2f} m{text}"

    def _depth_band(self, depth_m: float) -> str:
        top_m, rating_m = depth_m - self._half_height_m, self._vehicle.depth_rating_m
        high = below("{} m of water above the hull, wanted {} m", top_m, self._knobs.surface_m, 2)
        return high or above("{} m deep, wanted at most {} m", depth_m, rating_m, 2)

    def _attitude(self, navigation: Navigation) -> str:
        tilt_deg = math.degrees(max(abs(navigation.attitude_rad[0]), abs(navigation.attitude_rad[1])))
        limit_deg = self._vehicle.limits.tilt_deg
        if tilted := above("tilted by {} deg, wanted at most {} deg", tilt_deg, limit_deg, 0):
            return tilted
        return "" if math.isfinite(sum(navigation.attitude_rad)) else "unknown, wanted roll, pitch and heading"

    def _sensor_age(self, navigation: Navigation) -> Finding:
        """Of an autopilot, silent rates have another cause than silent depths."""
        inertial_s = min((navigation.ages_s.get(name, math.inf) for name in self._inertial), default=0.0)
        limits = (
            ("rates", self._inertial, inertial_s, self._knobs.inertial_age_s, ""),
            ("depth", self._depth, navigation.depth_age_s, self._knobs.depth_age_s, self._depth_remedy),
        )
        for quantity, names, age_s, limit_s, remedy in limits:
            if names and age_s > limit_s:
                age = above("{} s ago, wanted at most {} s", age_s, limit_s, 2).replace("inf s ago", "never")
                return Finding(Reason.SENSOR_AGE, f"{quantity} from {' and '.join(names)} received {age}", remedy)
        unknown = "" if math.isfinite(navigation.depth_m) else "depth unknown"
        return Finding(Reason.SENSOR_AGE, unknown, self._depth_remedy)

    def _blocked(self, situation: Situation) -> str:
        """Thrust without motion, as against a wall that dead reckoning knows elsewhere."""
        u, v, _ = situation.navigation.velocity_mps
        for axis, force_N, speed in zip(("surge", "sway"), situation.thrust_N, (u, v), strict=True):
            expected = abs(self._freedoms[axis].rate_at(force_N))
            if expected > MOVES_mps and abs(speed) < BLOCKED_SHARE * expected:
                return f"{abs(force_N):.0f} N of {axis} move it at {abs(speed):.2f} m/s, wanted {expected:.2f} m/s"
        return ""

    def _dvl_lock(self, situation: Situation) -> str:
        if situation.navigation.dvl_locked or not self._velocity:
            return ""
        since_s = situation.time_s - self._wrong_since_s.get(Reason.DVL_LOCK, situation.time_s)
        since, most = unlike(since_s, self._knobs.unlocked_s, 1)
        return f"{without_velocity(self._vehicle)} for {since} s, wanted less than {most} s"


def nearest(walls_m: Mapping[str, float]) -> tuple[str, float]:
    """Name of the nearest wall, and how far it is [m]."""
    return min(walls_m.items(), key=lambda one: one[1])


def walls_after_braking_m(
    place: PoolPosition, walls_m: Mapping[str, float], knobs: ManeuverGuardKnobs
) -> Mapping[str, float]:
    """Distance from the hull to each wall, less the way that braking takes.

    Parameters
    ----------
    place
        In pool axes, with its velocity; an unknown speed counts as none.
    walls_m
        Distances now [m].
    knobs
        Deceleration of a braking.

    Returns
    -------
    Mapping[str, float]
        By wall [m].
    """
    towards = {"south": -place.vx_mps, "north": place.vx_mps, "west": -place.vy_mps, "east": place.vy_mps}
    speeds = {wall: max(0.0, speed) for wall, speed in towards.items()}  # of 0 and NaN this is 0
    return {
        wall: distance_m - speeds[wall] * LAG_S - 0.5 * speeds[wall] ** 2 / knobs.braking_mps2
        for wall, distance_m in walls_m.items()
    }
