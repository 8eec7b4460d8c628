"""The stages a maneuver is made of: coming to rest at a pose, driving one degree of freedom, stopping.

A stage asks for hold setpoints when it begins and gives a wrench at every step; it knows no clock and no port.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

from hindrax_control.hold.holds import Setpoint, down_rate
from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.maneuver.excitation import Excite
from hindrax_control.maneuver.leg import LegController, LegOutput
from hindrax_control.maneuver.plan import ALONG, motion_name
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.readings import Vec6
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES

HOLD_OF = {"heave": ("depth", "altitude"), "roll": ("roll",), "pitch": ("pitch",), "yaw": ("heading",)}
"""Holds that own an axis and must let go of it while a maneuver drives it."""


THRUST_LAG_S = 0.15


@dataclass(frozen=True, slots=True)
class StageInput:
    """What a stage sees: the state, the place in the pool, the time, and the heading without jumps."""

    navigation: Navigation
    place: PoolPosition
    time_s: float
    dt: float
    turned_rad: float
    """Heading from the pool's length, counted on beyond half a turn."""
    held_back: bool = False
    """Whether the allocator falls short in surge or sway."""
    altitude_heard: bool = True
    """Whether the altitude is measured at present."""


@dataclass(frozen=True, slots=True)
class StageOutput:
    """What a stage does: wrench beside the holds [N, Nm], phase, force and rate along the motion, and its end."""

    wrench: Vec6
    phase: str
    force: float = 0.0
    velocity: float = 0.0
    finished: bool = False
    trouble: str = ""
    """Why the maneuver cannot go on; empty while it can."""


class Stage(Protocol):
    """One part of a maneuver."""

    motion: str
    seconds: float
    ends: tuple[PoolPosition, ...]
    """Where in the pool it comes to rest."""

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Return the hold setpoints that this stage wants."""

    def step(self, moment: StageInput) -> StageOutput:
        """Act on one moment."""


def along(axis: str, moment: StageInput) -> tuple[float, float]:
    """Coordinate and rate of a motion: along the pool for surge and sway, depth, or angle."""
    navigation, place = moment.navigation, moment.place
    if axis in ALONG:
        return place.x_m, navigation.velocity_mps[AXES.index(axis)]
    if axis == "heave":
        return navigation.depth_m, down_rate(navigation)
    index = AXES.index(axis) - 3
    angle = moment.turned_rad if axis == "yaw" else navigation.attitude_rad[index]
    return angle, navigation.rate_radps[index]


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a motion begins; heading of the navigator [rad] and hold with setpoint [m] in which it is flown."""

    place: PoolPosition
    heading_rad: float
    vertical: tuple[str, float]
    floor_m: float
    """Depth of the pool, by which a depth stands in for an altitude that is not measured."""

    def without_altitude(self) -> Pose:
        """Return the same pose held by depth."""
        hold, value = self.vertical
        return self if hold == "depth" else replace(self, vertical=("depth", self.floor_m - value))

    def off_m(self, navigation: Navigation) -> float:
        """How far altitude or depth is off; NaN while unknown."""
        hold, wanted_m = self.vertical
        return (navigation.depth_m if hold == "depth" else navigation.altitude_m) - wanted_m

    def turned_rad(self, navigation: Navigation) -> float:
        """How far the heading is off."""
        return math.remainder(navigation.attitude_rad[2] - self.heading_rad, math.tau)


@dataclass(frozen=True, slots=True)
class RestCriterion:
    """How still the vehicle must be, and for how long, before a stage of rest is over."""

    position_m: float = 0.15
    depth_m: float = 0.05
    heading_rad: float = math.radians(2.0)
    speed_mps: float = 0.04
    turn_radps: float = math.radians(3.0)
    lasting_s: float = 0.8
    patience_s: float = 75.0


REST = RestCriterion()
UNSETTLED = "look for a current, a cable that pulls, or a thruster that does not push (`./hindrax monitor`)"


class SettleAtPose:
    """Comes to rest at a place in the pool, at a heading and an altitude or depth, upright."""

    def __init__(self, motion: str, station: StationKeeping, pose: Pose, *, seconds: float) -> None:
        self.motion, self.seconds = motion, seconds
        self.ends: tuple[PoolPosition, ...] = (pose.place,)
        self._station, self._goal_m, self._pose = station, (pose.place.x_m, pose.place.y_m), pose
        self._begun_s = self._still_since_s = 0.0

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Engage every hold; the station keeps what it knows of the current."""
        if not moment.altitude_heard:
            self._pose = self._pose.without_altitude()
        self._begun_s = self._still_since_s = moment.time_s
        self._station.start(moment.place)
        return (
            Setpoint("heading", value=self._pose.heading_rad),
            Setpoint("roll", value=0.0),
            Setpoint("pitch", value=0.0),
            Setpoint(self._pose.vertical[0], value=self._pose.vertical[1]),
        )

    def step(self, moment: StageInput) -> StageOutput:
        """Keep station; over when nothing is far off any more for a while."""
        if self._station.goal_m is not None:
            self._station.goal_m = self._goal_m
        X, Y = self._station.step(moment.place, moment.dt, held_back=moment.held_back)
        off = self._off(moment)
        if off:
            self._still_since_s = moment.time_s
        waited_s = moment.time_s - self._begun_s
        trouble = f"settle: {off} after {waited_s:.0f} s; {UNSETTLED}" if off and waited_s > REST.patience_s else ""
        finished = moment.time_s - self._still_since_s >= REST.lasting_s
        return StageOutput((X, Y, 0.0, 0.0, 0.0, 0.0), "settle", finished=finished, trouble=trouble)

    def _off(self, moment: StageInput) -> str:
        """What is not at rest yet, in words."""
        navigation, place = moment.navigation, moment.place
        far_m = math.hypot(place.x_m - self._goal_m[0], place.y_m - self._goal_m[1])
        hold, high_m, turned_rad = (
            self._pose.vertical[0],
            self._pose.off_m(navigation),
            self._pose.turned_rad(navigation),
        )
        speed = math.sqrt(sum(v * v for v in navigation.velocity_mps))
        turning = max(map(abs, navigation.rate_radps))
        wrong = {
            f"{far_m:.2f} m from its place": not far_m <= REST.position_m,
            # A sonar that falls silent now leaves the altitude unknown; the hold keeps the depth, which is as good.
            f"{hold} off by {high_m:.2f} m": abs(high_m) > REST.depth_m,
            f"heading off by {math.degrees(turned_rad):.1f} deg": not abs(turned_rad) <= REST.heading_rad,
            f"moving at {speed:.2f} m/s": not speed <= REST.speed_mps,
            f"turning at {math.degrees(turning):.0f} deg/s": not turning <= REST.turn_radps,
        }
        return next((words for words, is_wrong in wrong.items() if is_wrong), "")


class Hover:
    """Stays where it has come to rest, on the holds' setpoints: the thrust that this takes is the net buoyancy.

    Thrusters that hardly push are hardly unsteady, so it is weighed better here than by any leg.
    """

    ends: tuple[PoolPosition, ...] = ()

    def __init__(self, motion: str, station: StationKeeping, seconds: float) -> None:
        self.motion, self.seconds = motion, seconds
        self._station = station
        self._begun_s = 0.0

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Leave every hold as it is."""
        self._begun_s = moment.time_s
        return ()

    def step(self, moment: StageInput) -> StageOutput:
        """Keep station until the time is over."""
        X, Y = self._station.step(moment.place, moment.dt, held_back=moment.held_back)
        finished = moment.time_s - self._begun_s >= self.seconds
        return StageOutput((X, Y, 0.0, 0.0, 0.0, 0.0), "hover", finished=finished)


SENSELESS = "see which sensor is silent (`./hindrax doctor`), then fly again"
STEADY_m, STEADY_rad = 0.08, math.radians(4.0)
"""A plateau along the pool counts only while altitude and heading are this near to their setpoints."""


class ExciteMotion:
    """Drives one degree of freedom by a leg or an excitation; station and holds keep all others."""

    def __init__(
        self, axis: str, driver: LegController | Excite, freedom: PriorDynamics, station: StationKeeping, pose: Pose
    ) -> None:
        self.motion = driver.leg.name if isinstance(driver, LegController) else motion_name(axis, 0.0)
        self.seconds = driver.seconds
        self.ends = tuple(replace(pose.place, x_m=x_m) for x_m in driver.ends) if axis in ALONG else ()
        self._axis, self._driver, self._freedom, self._station = axis, driver, freedom, station
        self._pose = pose

    def begin(self, _moment: StageInput) -> tuple[Setpoint, ...]:
        """Release the holds of the axis that is driven."""
        return tuple(Setpoint(name, engaged=False) for name in HOLD_OF.get(self._axis, ()))

    def step(self, moment: StageInput) -> StageOutput:
        """Drive the axis, with what holds it against buoyancy and righting moment; keep station in the others."""
        coordinate, rate = along(self._axis, moment)
        if not all(map(math.isfinite, (coordinate, rate))):
            return StageOutput((0.0,) * 6, "transient", trouble=f"navigation: {self._axis} unknown; {SENSELESS}")
        drive = self._drive(coordinate, rate, moment)
        if not isinstance(self._driver, LegController):
            self.motion = motion_name(self._axis, rate)
        free = "x" if self._axis in ALONG else ""
        X, Y = self._station.step(moment.place, moment.dt, left_free=free, held_back=moment.held_back)
        wrench = [X, Y, 0.0, 0.0, 0.0, 0.0]
        # The thrust that is asked for now comes a lag later, when the vehicle has turned on.
        righting = self._freedom.restoring * math.sin(coordinate + rate * THRUST_LAG_S)
        wrench[AXES.index(self._axis)] = drive.force + self._freedom.bias + righting
        a, b, c, d, e, f = wrench
        return StageOutput((a, b, c, d, e, f), drive.phase, drive.force, rate, drive.finished)

    def _drive(self, coordinate: float, rate: float, moment: StageInput) -> LegOutput:
        if isinstance(self._driver, LegController):
            trusted = self._axis not in ALONG or self._straight(moment.navigation)
            return self._driver.step(coordinate, rate, moment.time_s, trusted=trusted)
        return self._driver.step(coordinate, rate, moment.time_s)

    def _straight(self, navigation: Navigation) -> bool:
        """Whether surge or sway is measured, and flown as it should be; an unknown altitude does not count."""
        high_m, turned_rad = self._pose.off_m(navigation), self._pose.turned_rad(navigation)
        return navigation.dvl_locked and not abs(high_m) > STEADY_m and abs(turned_rad) < STEADY_rad


STOPPING_s, LEAST_s, PATIENT_s = 2.0, 1.0, 8.0
"""How long a stop usually takes, at least takes and may take."""


class BrakeAndHold:
    """Brakes and holds where it is; ends in the hold, or neutral, as asked."""

    ends: tuple[PoolPosition, ...] = ()

    def __init__(self, motion: str, station: StationKeeping, *, neutral: bool) -> None:
        self.motion, self.seconds = motion, STOPPING_s
        self._station, self._neutral = station, neutral
        self._begun_s = 0.0

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Hold heading and depth as they are, upright, and this place in the pool."""
        self._begun_s = moment.time_s
        self._station.start(moment.place)
        return (Setpoint("heading"), Setpoint("roll", value=0.0), Setpoint("pitch", value=0.0), Setpoint("depth"))

    def step(self, moment: StageInput) -> StageOutput:
        """Keep station until the vehicle is slow, or for a few seconds."""
        X, Y = self._station.step(moment.place, moment.dt, held_back=moment.held_back)
        speed = math.sqrt(sum(v * v for v in moment.navigation.velocity_mps if math.isfinite(v)))
        waited_s = moment.time_s - self._begun_s
        finished = waited_s > PATIENT_s or (waited_s > LEAST_s and speed < REST.speed_mps)
        wrench = (0.0,) * 6 if finished and self._neutral else (X, Y, 0.0, 0.0, 0.0, 0.0)
        return StageOutput(wrench, "settle", finished=finished)


RELEASED = tuple(Setpoint(name, engaged=False) for name in ("heading", "roll", "pitch", "depth", "altitude"))
"""What ends neutral."""
