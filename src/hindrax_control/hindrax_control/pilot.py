"""The pilot: holds, maneuvers and the operator's wrench together make one wrench per cycle.

Pure. Setpoints, goals, cancels and operator wrenches are events; `step` is called for every new Navigation.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

from hindrax_control.allocation.allocation_cycle import PLAUSIBLE
from hindrax_control.allocation.allocator import AllocationKnobs, Allocator
from hindrax_control.allocation.thruster_fault_detector import (
    EVERY,
    FaultDetectorKnobs,
    SuspectedFault,
    ThrusterFaultDetector,
)
from hindrax_control.allocation.wrench_guard import WrenchGuard, WrenchGuardKnobs
from hindrax_control.hold.holds import STATION, HoldKnobs, Holds, HoldState, Setpoint
from hindrax_control.hold.station_keeping import StationKeeping, StationKeepingKnobs
from hindrax_control.maneuver.goal import (
    BUSY,
    HEADING_UNKNOWN,
    POSITION_UNKNOWN,
    Goal,
    not_armed,
    require_flyable,
    require_measured,
    require_ready,
    thrusters_disarmed,
    unobeyed,
)
from hindrax_control.maneuver.maneuver import Maneuver, ManeuverKnobs, ManeuverOutput
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs, ManeuverGuards, Situation
from hindrax_control.maneuver.plan import Plan, PlanKnobs, Planner
from hindrax_control.maneuver.pulses import PulseManeuver, believed
from hindrax_control.pool_bounds import GuardedPlace, PoolBounds, PoolBoundsKnobs
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, seconds_between, to_s
from hindrax_core.readings import Vec6, vec6
from hindrax_core.signals import NAN, ZERO6, Allocation, Navigation
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.vehicle import AXES, Vehicle

REFUSAL_S = 5.0
"""Time for which a refused setpoint or wrench is shown."""
JUMPED = "the odometry restarted after the vehicle was armed"
OPERATOR = "operator"
"""Key of refused operator wrenches, beside the axes of the holds."""


SAFETY_GROUPS = ("guards.", "operator_wrench.")
"""Groups of knobs that guard the vehicle."""


@dataclass(frozen=True, slots=True)
class PilotKnobs:
    """Knobs of all parts of the pilot."""

    holds: HoldKnobs = field(default_factory=HoldKnobs)
    station: StationKeepingKnobs = field(default_factory=StationKeepingKnobs)
    pool_bounds: PoolBoundsKnobs = field(default_factory=PoolBoundsKnobs)
    plan: PlanKnobs = field(default_factory=PlanKnobs)
    maneuver: ManeuverKnobs = field(default_factory=ManeuverKnobs)
    guards: ManeuverGuardKnobs = field(default_factory=ManeuverGuardKnobs)
    operator_wrench: WrenchGuardKnobs = field(default_factory=WrenchGuardKnobs)
    allocation: AllocationKnobs = field(default_factory=AllocationKnobs)
    fault_detector: FaultDetectorKnobs = field(default_factory=FaultDetectorKnobs)


@dataclass(frozen=True, slots=True)
class PilotOutput:
    """One cycle: the wrench for the allocator [N, N m], all holds, the maneuver (None: none), findings of the guards.

    `refused`: why a recent operator wrench was refused.
    `suspected_fault`: a thruster in use that does not seem to push; the caller decides whether to disable it.
    `forces_N`: what the thrusters are to give one by one, instead of the wrench; empty: the wrench is allocated.
    """

    wrench: Vec6
    holds: tuple[HoldState, ...]
    maneuver: ManeuverOutput | None
    guards: tuple[Refusal, ...]
    suspected_fault: SuspectedFault | None = None
    refused: str = ""
    forces_N: tuple[float, ...] = ()


class Pilot:
    """Controls one vehicle. Disarmed, its wrench is zero and its holds are released."""

    def __init__(self, vehicle: Vehicle, knobs: PilotKnobs | None = None) -> None:
        self._vehicle, self._knobs = vehicle, (knobs := knobs or PilotKnobs())
        # Only for plans: the forces that the thrusters can reach. The allocator node allocates.
        self._allocator = Allocator(vehicle, knobs.allocation)
        self._holds = Holds(vehicle, knobs.holds)
        self._guard = WrenchGuard(vehicle, knobs.operator_wrench)
        self.pool: PoolBounds | None = None
        self._navigation: Navigation | None = None
        self._recentred, self._unplaced = False, ""
        self._origin_m: tuple[float, float] | None = None
        self._maneuver_guards = ManeuverGuards(vehicle, knobs.guards)
        self._fault_detector = ThrusterFaultDetector(vehicle, knobs.fault_detector)
        self._maneuver: Maneuver | PulseManeuver | None = None
        self._keeping_station = False
        self._station: StationKeeping | None = None
        self._station_s = 0.0
        self._unserved = ZERO6
        """Wrench of holds and station while thrusters rested: to them it is a shortfall."""
        self._operator_wrench: tuple[Stamp, Vec6] | None = None
        self._armed = self._was_armed = False
        self._unarmed = self._disobeying = self._powerless = ""
        self._guards: tuple[Refusal, ...] = ()
        self._disabled: frozenset[str] = frozenset()
        self._refused: dict[str, tuple[Stamp, Refusal]] = {}
        self._stamp = Stamp(0)
        self.water_in_hull = False
        """State of a leak sensor: no maneuver begins or continues. Holds do, and nothing disarms: it has to come up."""

    # ---- events

    def tune(self, knobs: PilotKnobs) -> None:
        """Use other knobs from now on, except those of `SAFETY_GROUPS`.

        Parameters
        ----------
        knobs
            A maneuver in flight keeps those that it began with.
        """
        before, self._knobs = self._knobs, knobs
        self._holds.tune(knobs.holds)
        if knobs.allocation != before.allocation:
            self._allocator = Allocator(self._vehicle, knobs.allocation)
        if knobs.fault_detector != before.fault_detector:
            self._fault_detector = ThrusterFaultDetector(self._vehicle, knobs.fault_detector)

    def set(self, setpoint: Setpoint) -> Refusal:
        """Engage, move or release a hold; returns the reason of a refusal, which the hold's state reports too."""
        reason = self._reason_to_refuse(setpoint)
        if not reason and setpoint.axis == STATION:
            self._station = StationKeeping(self._vehicle, self._knobs.station) if setpoint.engaged else None
            self._keeping_station = False  # that of a maneuver that has ended
        elif not reason:
            reason = self._holds.set(setpoint)
        self._refused.pop(setpoint.axis, None)
        if reason:
            self.refuse(setpoint.axis, reason)
        return reason

    def refuse(self, axis: str, reason: Refusal) -> None:
        """Report in the state of a hold why a setpoint was refused."""
        self._refused[axis] = (self._stamp, reason)

    def _reason_to_refuse(self, setpoint: Setpoint) -> Refusal:
        if not self._armed and setpoint.engaged:
            return not_armed(self._unarmed).within(f"hold {setpoint.axis}: ")
        if self._disobeying and setpoint.engaged:
            return unobeyed(self._disobeying).within(f"hold {setpoint.axis}: ")
        if self.flying:
            return BUSY.within(f"hold {setpoint.axis}: ")
        return NOTHING

    def set_operator_wrench(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> tuple[Refusal, ...]:
        """Add an operator's wrench to the holds until it is stale.

        Parameters
        ----------
        wrench : [N, N m]
            About the center of mass, in the axes of `frame`.
        frame
            base_link or base_link_fsd.
        stamp, now
            When it was made, and the time of the vehicle.

        Returns
        -------
        tuple[Refusal, ...]
            Why it, or a part of it, is refused.
        """
        judged = self._guard.step(wrench, frame, stamp, now)
        refused = judged.refused
        if judged.wrench is not None and self.flying:
            refused = (BUSY.within("wrench: "),)
        elif judged.wrench is not None:
            self._keeping_station = False
            self._operator_wrench = (stamp, judged.wrench)
        if refused:
            self.refuse(OPERATOR, Refusal(refused[0].reason, "; ".join(refused)))
        return refused

    def check(self, goal: Goal) -> None:
        """UsageError with the reason if this vehicle cannot fly a goal with the enabled thrusters."""
        require_flyable(goal, self._vehicle, self._disabled)
        self._require_measured(goal.motions)

    def _require_measured(self, motions: Sequence[str]) -> None:
        """A vehicle without a DVL flies surge and sway while somebody else's odometry has their velocity."""
        known = self._navigation is not None and math.isfinite(sum(self._navigation.velocity_mps[:2]))
        require_measured(motions, self._vehicle, velocity_known=known)

    def plans(self) -> dict[str, Plan | str]:
        """Plan of each motion, or the reason why it cannot be flown; first word: its name."""
        planner = self._planner()
        pool = PoolBounds(self._vehicle, 0.0, self._knobs.pool_bounds)
        found: dict[str, Plan | str] = {}
        for motion in AXES:
            try:
                self._require_measured((motion,))
                found[motion] = planner.plan(motion, pool)
            except UsageError as error:
                found[motion] = str(error)
        return found

    def _planner(self) -> Planner:
        return Planner(self._vehicle, self._allocator, self._knobs.plan, self._disabled)

    def disable(self, disabled: frozenset[str]) -> None:
        """Set the thrusters that must not be used."""
        self._disabled = disabled

    def fly(self, goal: Goal) -> Maneuver | PulseManeuver:
        """Begin a maneuver with the next step; HindraxError with the refusal if it cannot be flown now or at all."""
        if goal.pulses:
            return self._fly_pulses(goal)
        pool, knobs = self.pool, self._knobs
        require_ready(
            flying=self.flying,
            armed=self._armed,
            unarmed=self._unarmed,
            disobeying=self._disobeying,
            guards=self._guards,
            heading_known=pool is not None,
        )
        assert pool is not None
        self._require_measured(goal.motions)
        self._maneuver = Maneuver(
            self._planner(), goal, pool, knobs=knobs.maneuver, station_knobs=knobs.station, safety_knobs=knobs.guards
        )
        self._station = None
        return self._maneuver

    def _fly_pulses(self, goal: Goal) -> PulseManeuver:
        self.check(goal)
        guards, knobs = believed(self._guards), self._knobs
        require_ready(
            flying=self.flying,
            armed=self._armed,
            unarmed=self._unarmed,
            disobeying=self._disobeying,
            guards=guards,
            heading_known=True,
        )
        made = PulseManeuver(self._vehicle, goal, knobs=knobs.maneuver, safety_knobs=knobs.guards)
        self._maneuver, self._station, self._operator_wrench = made, None, None
        return made

    def guarded_place(self) -> GuardedPlace | None:
        """Position in the pool, as the guard of the walls uses it; None while the heading is unknown."""
        if self.pool is None or self._navigation is None:
            return None
        place = self.pool.place(self._navigation)
        return self._maneuver_guards.guarded(place, self.pool.walls_m(place), self._unplaced)

    def lose_place(self, why: str) -> None:
        """Mark the position in the pool as unknown: no maneuver begins until `recentre`."""
        self._unplaced = f"{why}, wanted a known position in the pool"

    def begin_anew(self) -> None:
        """Take it that positions have another origin from the next step on: that of the start, until it was armed."""
        self._origin_m = None
        if self._was_armed or self._recentred:
            self.lose_place(JUMPED)

    def recentre(self, x_m: float = NAN, y_m: float = NAN, turned_rad: float = NAN) -> Refusal:
        """Take it that the vehicle is at this place of the pool now. A hold of the station stays where the vehicle is.

        Parameters
        ----------
        x_m, y_m : [m]
            Along the length, and to the right of it; NaN: at the start of the knobs.
        turned_rad : [rad]
            Heading from the length; NaN: as reckoned.

        Returns
        -------
        Refusal
            `BUSY`, `HEADING`, `NAVIGATION` or `POOL`; nothing when it is taken.
        """
        if self.flying:
            return BUSY
        if self.pool is None or self._navigation is None:
            return HEADING_UNKNOWN
        if not all(map(math.isfinite, (*self._navigation.position_m, self._navigation.attitude_rad[2]))):
            return POSITION_UNKNOWN
        try:
            start = PoolBounds(self._vehicle, 0.0, self._knobs.pool_bounds).start_m
            x_m, y_m = start if math.isnan(x_m) and math.isnan(y_m) else (x_m, y_m)
            pool = copy(self.pool)  # a maneuver that has ended keeps its own
            pool.recentre(self._navigation, x_m, y_m, turned_rad)
        except UsageError as error:
            return Refusal(Reason.POOL, str(error))
        self.pool, self._recentred, self._unplaced = pool, True, ""
        if self._station is not None:
            self._station.start(self.pool.place(self._navigation))
        return NOTHING

    def cancel(self, ending: str = "") -> None:
        """Stop the maneuver, if there is one: accepted at any moment. `ending`: hold, neutral, or that of the goal."""
        if self._maneuver is not None:
            self._maneuver.cancel(ending=ending)

    def abandon(self) -> None:
        """Drop maneuver, holds and operator wrench: without a vehicle state they cannot be ended in order."""
        self._maneuver, self._keeping_station, self._operator_wrench, self._station = None, False, None, None
        self._holds.release()

    @property
    def flying(self) -> bool:
        """Whether a maneuver is not over yet."""
        return self._maneuver is not None and not self._maneuver.done

    # ---- time

    def step(
        self,
        navigation: Navigation,
        stamp: Stamp,
        allocation: Allocation | None = None,
        *,
        armed: bool,
        unarmed: str = "",
        disobeying: str = "",
        battery_V: float = NAN,
    ) -> PilotOutput:
        """Return the wrench for this state.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        allocation
            Of the last wrench. With the thrusters' forces in it, dead thrusters are detected.
        armed
            Whether thrusters may turn.
        unarmed
            Why they may not.
        disobeying
            Why they are armed and follow no command; the pilot finds itself when none of them pushes, or when their
            supply is dead.
        battery_V : [V]
            NaN where it is not measured.

        Returns
        -------
        PilotOutput
            Wrench about the center of mass in SNAME axes, state of holds, maneuver and guards.
        """
        self._powerless = self._powerless if armed else ""
        if armed and battery_V < PLAUSIBLE[0] * self._vehicle.supply_V:
            self._powerless = f"the supply of the thrusters measures {battery_V:.1f} V: it is dead"
        self._stamp, self._disobeying = stamp, (disobeying := disobeying or self._powerless)
        self._update(navigation, stamp, battery_V, armed=armed, unarmed=unarmed)
        shortfall = _sum(allocation.shortfall, self._unserved) if allocation else self._unserved
        lost = allocation.lost_axes if allocation else ()
        flown, wrench = self._step_maneuver(navigation, stamp, shortfall, lost, battery_V)
        held = self._holds.step(navigation, stamp, shortfall, armed=armed)
        station, keeping = self._keep_station(navigation, stamp, shortfall)
        states = (*held.states, station)
        states = tuple(map(self._without_effort, states)) if disobeying else states
        states = tuple(map(self._with_refusal, states)) if self._refused else states
        self._unserved = ZERO6
        if not armed:
            return PilotOutput(ZERO6, states, flown, self._guards, refused=self._refusal(OPERATOR))
        if flown is not None and flown.forces_N and not flown.done:
            # No dead thruster is looked for meanwhile, and nothing held: all of that believes the vehicle file.
            return PilotOutput(wrench, states, flown, self._guards, forces_N=flown.forces_N)
        total = _sum(_sum(_sum(held.wrench, wrench), keeping), self._current_operator_wrench(stamp))
        if flown is not None and flown.resting:
            total, self._unserved = ZERO6, total
        suspected_fault = self._suspected_fault(navigation, stamp, allocation)
        return PilotOutput(total, states, flown, self._guards, suspected_fault, self._refusal(OPERATOR))

    def _refusal(self, axis: str) -> Refusal:
        """Return a recent refusal, else nothing."""
        made, reason = self._refused.get(axis, (self._stamp, NOTHING))
        return reason if seconds_between(made, self._stamp) <= REFUSAL_S else NOTHING

    def _with_refusal(self, state: HoldState) -> HoldState:
        """Add a recent refusal to the note of a hold."""
        reason = self._refusal(state.axis)
        if not reason:
            return state
        return replace(state, note=f"{state.note}; refused: {reason}" if state.note else f"refused: {reason}")

    def _without_effort(self, state: HoldState) -> HoldState:
        """Say in the note of an engaged hold that nothing is held."""
        return replace(state, note=unobeyed(self._disobeying)) if state.engaged else state

    def _update(self, navigation: Navigation, stamp: Stamp, battery_V: float, *, armed: bool, unarmed: str) -> None:
        self._navigation = navigation
        if not (self._was_armed or self._recentred) and math.isfinite(navigation.attitude_rad[2]):
            # Until the first arming, the vehicle is assumed where the knobs place it.
            if self._origin_m is None and math.isfinite(sum(navigation.position_m)):
                self._origin_m = navigation.position_m
            heading_rad, origin_m = navigation.attitude_rad[2], self._origin_m or (0.0, 0.0)
            self.pool = PoolBounds(self._vehicle, heading_rad, self._knobs.pool_bounds, origin_m=origin_m)
        place, walls_m = None, {}
        if self.pool is not None:
            place = self.pool.place(navigation)
            walls_m = self.pool.walls_m(place)
        where, when = (navigation, place, walls_m), to_s(stamp)
        situation = Situation(*where, when, battery_V, self.water_in_hull, unplaced=self._unplaced)
        self._guards = self._maneuver_guards.step(situation)
        if self._powerless:
            self._guards = (unobeyed(self._powerless), *self._guards)
        if self._armed and not armed:
            self._keeping_station, self._station = False, None
            self._operator_wrench = None
            if self._maneuver is not None:
                self._maneuver.cancel(thrusters_disarmed(unarmed), "neutral")
        self._armed, self._unarmed = armed, unarmed
        self._was_armed = self._was_armed or armed

    def _step_maneuver(
        self, navigation: Navigation, stamp: Stamp, shortfall: Vec6, lost: tuple[str, ...], battery_V: float
    ) -> tuple[ManeuverOutput | None, Vec6]:
        maneuver = self._maneuver
        if maneuver is None:
            return None, ZERO6
        if not maneuver.done:
            if self._powerless:
                maneuver.cancel(unobeyed(self._powerless), "neutral")  # braking takes thrust
            elif self.water_in_hull:
                maneuver.cancel(next(one for one in self._guards if one.reason is Reason.LEAK))
            output = maneuver.step(navigation, stamp, shortfall=shortfall, lost_axes=lost, battery_V=battery_V)
            for setpoint in output.setpoints:
                self._holds.set(setpoint)
            self._keeping_station = not output.neutral
            return output, output.wrench
        return maneuver.last, maneuver.keep(navigation, stamp) if self._keeping_station else ZERO6

    def _keep_station(self, navigation: Navigation, stamp: Stamp, shortfall: Vec6) -> tuple[HoldState, Vec6]:
        """State and wrench of the hold that keeps the vehicle where it was when it was engaged."""
        dt, self._station_s = to_s(stamp) - self._station_s, to_s(stamp)
        if self._station is None or self.pool is None:
            return HoldState(STATION, engaged=False), ZERO6
        place = self.pool.place(navigation)
        held_back = max(map(abs, shortfall[:2])) > self._knobs.maneuver.shortfall_N
        X, Y = self._station.step(place, dt, held_back=held_back)
        if self._station.goal_m is None:
            return HoldState(STATION, True, note="position not measured: no effort"), ZERO6
        x, y = self._station.goal_m
        return HoldState(STATION, True, 0.0, math.hypot(x - place.x_m, y - place.y_m)), (X, Y, 0.0, 0.0, 0.0, 0.0)

    def _suspected_fault(
        self, navigation: Navigation, stamp: Stamp, allocation: Allocation | None
    ) -> SuspectedFault | None:
        if allocation is None or not allocation.forces_N:
            return None
        found = self._fault_detector.step(navigation, stamp, allocation.forces_N)
        if found is not None and found.name == EVERY:
            # Kept until it is disarmed: a supply that comes back would meet holds that have wound up meanwhile.
            self._powerless = found.sentence
            return None
        return found if found is not None and found.name not in self._disabled else None

    def _current_operator_wrench(self, stamp: Stamp) -> Vec6:
        if self._operator_wrench is None:
            return ZERO6
        made, wrench = self._operator_wrench
        return ZERO6 if seconds_between(made, stamp) > self._knobs.operator_wrench.max_age_s else wrench


def _sum(one: Vec6, other: Vec6) -> Vec6:
    return vec6(a + b for a, b in zip(one, other, strict=True))
