"""The stages a maneuver is made of: coming to rest at a pose, driving one degree of freedom, stopping.

A stage asks for hold setpoints when it begins and gives a wrench at every step; it knows no clock and no port.
"""

import math
from dataclasses import dataclass, replace

from hindrax_control.hold.holds import Setpoint, down_rate
from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.maneuver.excitation import Excite
from hindrax_control.maneuver.goal import ALONG
from hindrax_control.maneuver.leg import LegController
from hindrax_control.maneuver.plan import RESTING, motion_name
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.events import Stamp
from hindrax_core.readings import Vec6, vec6
from hindrax_core.signals import ZERO6, Navigation
from hindrax_core.text.refusals import HELD_UP, NOTHING, Reason, Refusal, found
from hindrax_core.vehicle import AXES

HOLD_OF = {"heave": ("depth", "altitude"), "roll": ("roll",), "pitch": ("pitch",), "yaw": ("heading",)}
"""Holds that own an axis and must release it while a maneuver drives it."""


THRUST_LAG_S = 0.15


@dataclass(frozen=True, slots=True)
class StageInput:
    """Input of a stage: the state, the place in the pool, the time, and the heading without jumps."""

    navigation: Navigation
    place: PoolPosition
    time_s: float
    dt: float
    turned_rad: float
    """Heading from the pool's length, counted on beyond half a turn."""
    held_back: bool = False
    """Whether the allocator falls short in surge or sway."""
    altitude_measured: bool = True
    """Whether the altitude is measured at present."""
    velocity_measured: bool = True
    """Whether anything on board measures surge and sway; a DVL that has lost the bottom still does."""
    by_wall: bool = False
    """Whether that is the range to a wall: then only the axis that looks there is measured."""


@dataclass(frozen=True, slots=True)
class StageOutput:
    """Output of a stage: wrench beside the holds [N, N m], phase, force and rate along the motion, and its end."""

    wrench: Vec6
    phase: str
    force: float = 0.0
    velocity: float = 0.0
    finished: bool = False
    trouble: Refusal = NOTHING
    """Reason why the maneuver cannot continue; empty while it can."""
    resting: bool = False
    """Whether all thrusters rest, whatever the holds want."""


class Stage:
    """One part of a maneuver, as long as planned; `ends`: where in the pool it comes to rest."""

    def __init__(
        self, motion: str, station: StationKeeping, seconds: float, ends: tuple[PoolPosition, ...] = ()
    ) -> None:
        self.motion, self.seconds, self.ends = motion, seconds, ends
        self._station, self._started_s = station, 0.0

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Return the hold setpoints of this stage: every hold is unchanged."""
        self._started_s = moment.time_s
        return ()

    def shorten(self, low_m: float, high_m: float) -> None:
        """Come to rest between these places along the pool [m], where the stage is still worth it."""

    def step(self, moment: StageInput) -> StageOutput:
        """Act on one moment.

        Parameters
        ----------
        moment
            State, time and what the guards know.

        Returns
        -------
        StageOutput
            Wrench beside the holds, phase, whether it is over, and why it cannot go on.

        Raises
        ------
        NotImplementedError
            In this base; every stage has its own.
        """
        raise NotImplementedError

    def _keep_station(self, moment: StageInput, *, length_free: bool = False) -> Vec6:
        X, Y = self._station.step(moment.place, moment.dt, length_free=length_free, held_back=moment.held_back)
        return (X, Y, 0.0, 0.0, 0.0, 0.0)


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
    """Start of a motion; heading of the navigator [rad] and hold with setpoint [m] in which it is flown."""

    place: PoolPosition
    heading_rad: float
    vertical: tuple[str, float]
    floor_m: float
    """Depth of the pool, by which a depth stands in for an altitude that is not measured."""

    def without_altitude(self) -> "Pose":
        """Return the same pose held by depth."""
        hold, value = self.vertical
        return self if hold == "depth" else replace(self, vertical=("depth", self.floor_m - value))

    def off_m(self, navigation: Navigation) -> float:
        """Error of altitude or depth; NaN while unknown."""
        hold, wanted_m = self.vertical
        return (navigation.depth_m if hold == "depth" else navigation.altitude_m) - wanted_m

    def turned_rad(self, navigation: Navigation) -> float:
        """Error of the heading."""
        return math.remainder(navigation.attitude_rad[2] - self.heading_rad, math.tau)


REST_m, REST_DEPTH_m, REST_HEADING_rad = 0.15, 0.05, math.radians(2.0)
REST_mps, REST_radps = 0.04, math.radians(3.0)
"""Residual motion allowed at the end of a stage of rest."""
LASTING_S, PATIENCE_S = 0.8, 75.0
"""For how long it must be so, and how long that may take."""


class SettleAtPose(Stage):
    """Comes to rest at a place in the pool, at a heading and an altitude or depth, upright."""

    def __init__(self, motion: str, station: StationKeeping, pose: Pose, *, seconds: float) -> None:
        super().__init__(motion, station, seconds, (pose.place,))
        self._pose = pose
        self._still_since_s = 0.0

    def shorten(self, low_m: float, high_m: float) -> None:
        """Settle where the first leg begins now."""
        (place,) = self.ends
        self.ends = (replace(place, x_m=min(max(place.x_m, low_m), high_m)),)

    @property
    def _goal_m(self) -> tuple[float, float]:
        (place,) = self.ends
        return place.x_m, place.y_m

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Engage every hold; the station keeps what it knows of the current."""
        if not moment.altitude_measured:
            self._pose = self._pose.without_altitude()
        self._started_s = self._still_since_s = moment.time_s
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
        wrench, off = self._keep_station(moment), self._off(moment)
        if off:
            self._still_since_s = moment.time_s
        waited_s = moment.time_s - self._started_s
        late = off and waited_s > PATIENCE_S
        trouble = found(Reason.SETTLE, f"{off} after {waited_s:.0f} s") if late else NOTHING
        finished = moment.time_s - self._still_since_s >= LASTING_S
        return StageOutput(wrench, "settle", finished=finished, trouble=trouble)

    def _off(self, moment: StageInput) -> str:
        """What is not at rest yet, as text."""
        navigation, place = moment.navigation, moment.place
        far_m = place.off_m(*self._goal_m)
        hold, high_m = self._pose.vertical[0], self._pose.off_m(navigation)
        turned_rad = self._pose.turned_rad(navigation)
        speed = math.sqrt(sum(v * v for v in navigation.velocity_mps if math.isfinite(v) or not moment.by_wall))
        turning, sinking_mps = max(map(abs, navigation.rate_radps)), down_rate(navigation)
        wrong = {
            # Without a DVL there is no place to come to, and rest is what gyroscope and depth say.
            f"{far_m:.2f} m from its place": moment.velocity_measured and not far_m <= REST_m,
            # A sonar that falls silent now leaves the altitude unknown; the hold keeps the depth, which is as good.
            f"{hold} off by {high_m:.2f} m": abs(high_m) > REST_DEPTH_m,
            f"heading off by {math.degrees(turned_rad):.1f} deg": not abs(turned_rad) <= REST_HEADING_rad,
            f"moving at {speed:.2f} m/s": moment.velocity_measured and not speed <= REST_mps,
            f"{sinking_mps:+.2f} m/s down": not abs(sinking_mps) <= REST_mps,
            f"turning at {math.degrees(turning):.0f} deg/s": not turning <= REST_radps,
        }
        return next((words for words, is_wrong in wrong.items() if is_wrong), "")


class Hover(Stage):
    """Stays where it has come to rest, on the holds' setpoints: the thrust that this takes is the net buoyancy.

    Thrusters that hardly push are hardly unsteady, so it is weighed better here than by any leg.
    """

    def step(self, moment: StageInput) -> StageOutput:
        """Keep station until the time is over."""
        finished = moment.time_s - self._started_s >= self.seconds
        return StageOutput(self._keep_station(moment), "hover", finished=finished)


STEADY_m, STEADY_rad = 0.08, math.radians(4.0)
"""A plateau along the pool counts only while altitude and heading are this near to their setpoints."""


class ExciteMotion(Stage):
    """Drives one degree of freedom by a leg or an excitation; station and holds keep all others."""

    def __init__(
        self, axis: str, driver: LegController | Excite, freedom: PriorDynamics, station: StationKeeping, pose: Pose
    ) -> None:
        motion = driver.leg.name if isinstance(driver, LegController) else motion_name(axis, 0.0)
        super().__init__(motion, station, driver.seconds)
        self._axis, self._driver, self._freedom, self._pose = axis, driver, freedom, pose
        if axis in ALONG:
            self.ends = self._ends()
        self._state_began: Stamp | None = None

    def shorten(self, low_m: float, high_m: float) -> None:
        """Shorten a leg along the pool; an excitation keeps its room."""
        if self.ends and isinstance(self._driver, LegController):
            self._driver.shorten(low_m, high_m)
            self.ends = self._ends()

    def _ends(self) -> tuple[PoolPosition, ...]:
        return tuple(replace(self._pose.place, x_m=x_m) for x_m in self._driver.ends)

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Release the holds of the axis that is driven."""
        self._state_began = moment.navigation.consistency.began
        return tuple(Setpoint(name, engaged=False) for name in HOLD_OF.get(self._axis, ()))

    def step(self, moment: StageInput) -> StageOutput:
        """Drive the axis, with what holds it against buoyancy and righting moment; keep station in the others."""
        coordinate, rate = along(self._axis, moment)
        if not all(map(math.isfinite, (coordinate, rate))):
            return StageOutput(ZERO6, "transient", trouble=self._unknown(moment.navigation))
        trusted = self._axis not in ALONG or self._straight(moment)
        drive = self._driver.step(coordinate, rate, moment.time_s, trusted=trusted)
        if not isinstance(self._driver, LegController):
            self.motion = motion_name(self._axis, rate)
        wrench = [*self._keep_station(moment, length_free=self._axis in ALONG)]
        # The thrust that is asked for now comes a lag later, when the vehicle has turned on.
        righting = self._freedom.restoring * math.sin(coordinate + rate * THRUST_LAG_S)
        wrench[AXES.index(self._axis)] = drive.force + self._freedom.bias + righting
        resting = drive.phase == "coast" and self._axis in RESTING
        return StageOutput(vec6(wrench), drive.phase, drive.force, rate, drive.finished, resting=resting)

    def _unknown(self, navigation: Navigation) -> Refusal:
        """Say that its axis is unknown; a state that began anew knows no velocity yet, whose sensor is not silent."""
        if self._state_began in (None, navigation.consistency.began):
            return found(Reason.NAVIGATION, f"{self._axis} unknown")
        anew = f"{self._axis} unknown, since the state began anew in flight, as after a gap of the inertial sensor"
        return found(Reason.NAVIGATION, anew, HELD_UP)

    def _straight(self, moment: StageInput) -> bool:
        """Whether surge or sway is measured, and flown as it should be; an unknown altitude does not count."""
        navigation = moment.navigation
        high_m, turned_rad = self._pose.off_m(navigation), self._pose.turned_rad(navigation)
        return (navigation.dvl_locked or moment.by_wall) and not abs(high_m) > STEADY_m and abs(turned_rad) < STEADY_rad


STOPPING_S, LEAST_S, PATIENT_S = 2.0, 1.0, 8.0
"""Usual, shortest and longest time of a stop."""


class BrakeAndHold(Stage):
    """Brakes and holds where it is; ends in the hold, or neutral, as asked."""

    def __init__(self, motion: str, station: StationKeeping, *, neutral: bool) -> None:
        super().__init__(motion, station, STOPPING_S)
        self._neutral = neutral

    def begin(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Hold heading and depth as they are, upright, and this place in the pool."""
        self._started_s = moment.time_s
        self._station.start(moment.place)
        return (Setpoint("heading"), Setpoint("roll", value=0.0), Setpoint("pitch", value=0.0), Setpoint("depth"))

    def step(self, moment: StageInput) -> StageOutput:
        """Keep station until the vehicle is slow, or for a few seconds."""
        wrench = self._keep_station(moment)
        speed = math.sqrt(sum(v * v for v in moment.navigation.velocity_mps if math.isfinite(v)))
        waited_s = moment.time_s - self._started_s
        finished = waited_s > PATIENT_S or (waited_s > LEAST_S and speed < REST_mps)
        return StageOutput(ZERO6 if finished and self._neutral else wrench, "settle", finished=finished)


RELEASED = tuple(Setpoint(name, engaged=False) for name in ("heading", "roll", "pitch", "depth", "altitude"))
"""Stages that end neutral."""
