"""Guarded maneuvers: a goal becomes stages, stages become wrenches; guards and cancel end them at any moment.

Pure: `step(navigation, stamp)` in, what to do out. Setpoints engage the holds; the pilot applies them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_control.hold.holds import Setpoint
from hindrax_control.hold.station_keeping import StationKeeping, StationKeepingKnobs
from hindrax_control.maneuver.excitation import Bounds, Excite, signal
from hindrax_control.maneuver.goal import LOOKS, PLATEAUS, Goal, require_flyable
from hindrax_control.maneuver.leg import Easing, LegController
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs, ManeuverGuards, Situation, nearest
from hindrax_control.maneuver.plan import CHARACTERS, Plan, Planner
from hindrax_control.maneuver.stages import (
    RELEASED,
    BrakeAndHold,
    ExciteMotion,
    Hover,
    Pose,
    SettleAtPose,
    Stage,
    StageInput,
    StageOutput,
)
from hindrax_control.pool_bounds import PoolBounds, PoolPosition
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec6
from hindrax_core.signals import BLOCKED, NAN, ZERO6, Navigation, Phase
from hindrax_core.text.refusals import CANCELLED, NOTHING, Reason, Refusal, found

SETTLING_S = 2.5
"""Time to come to rest at a place, beside the way to it."""
SILENT_S = 1.0
"""Age of the last echo beyond which a maneuver uses the depth instead."""
MARGIN_GROWS_m = 0.3
"""A shortened leg keeps off the walls by this much more than their guard wants: uncertainty grows on its way, and it
rests a little beyond its end."""


@dataclass(frozen=True, slots=True)
class ManeuverKnobs:
    """Limits of maneuvers beyond their plans."""

    excitation_s: float = knob(60.0, 5.0, 600.0, "duration of an excitation of one motion [s]")
    overtime: float = knob(1.6, 1.0, 10.0, "fraction of the planned time after which a maneuver is aborted [-]")
    overtime_s: float = knob(90.0, 0.0, 3600.0, "time on top of that fraction [s]")
    shortfall_N: float = knob(3.0, 0.0, 100.0, "shortfall of surge or sway that stops the station's integral [N]")


@dataclass(frozen=True, slots=True)
class ManeuverOutput:
    """Output of one maneuver step.

    `wrench` [N, N m] adds to that of the holds; `setpoints` are events for the holds; `force` and `velocity` are
    along the motion; `wall_distance_m` is ahead of the hull; `aborted` is "guard: sentence", once `done`, and `neutral`
    says whether it has ended without holding anything. `resting`: all thrusters rest, whatever the holds want.
    `forces_N`: of the thrusters, where it commands them one by one; `wrench` is then what they should give by the file.
    """

    wrench: Vec6
    setpoints: tuple[Setpoint, ...]
    phase: Phase
    progress: float
    remaining_s: float
    wall_distance_m: float
    force: float
    velocity: float
    done: bool
    aborted: Refusal
    neutral: bool
    resting: bool = False
    forces_N: tuple[float, ...] = ()


def abandoned(reason: Refusal) -> ManeuverOutput:
    """Output of a maneuver that ends without a vehicle state."""
    phase = Phase("", "aborted")
    return ManeuverOutput(ZERO6, RELEASED, phase, 0.0, 0.0, NAN, 0.0, 0.0, done=True, aborted=reason, neutral=True)


class Maneuver:
    """One goal, from its first step to its end. UsageError when the goal cannot be flown at all."""

    def __init__(
        self,
        planner: Planner,
        goal: Goal,
        pool: PoolBounds,
        *,
        knobs: ManeuverKnobs | None = None,
        station_knobs: StationKeepingKnobs | None = None,
        safety_knobs: ManeuverGuardKnobs | None = None,
    ) -> None:
        vehicle = planner.vehicle
        require_flyable(goal, vehicle, planner.disabled)
        self.goal, self._pool, self._planner = goal, pool, planner
        self._velocity = not vehicle.sensors or bool(vehicle.measuring("velocity"))
        self._looks = not vehicle.measuring("velocity") and any(map(vehicle.measuring, LOOKS.values()))
        self._knobs = knobs or ManeuverKnobs()
        self.station = StationKeeping(vehicle, station_knobs)
        self._safety = ManeuverGuards(vehicle, safety_knobs)
        self.plans = tuple(self._planner.plan(motion, pool, goal.levels) for motion in goal.motions)
        self._stages: list[Stage] = self._all_stages()
        self._stages.append(BrakeAndHold(goal.motions[-1], self.station, neutral=False))
        self._seconds = [stage.seconds for stage in self._stages]
        self.seconds = sum(self._seconds)
        """Planned duration [s]."""
        self._at = -1
        self._entered_s = 0.0
        self._started_at: Stamp | None = None
        self._last: Stamp | None = None
        self._turned_rad = 0.0
        self._passed = 0.0
        self._aborted = NOTHING
        self._stopping = self._neutral = False
        self.last: ManeuverOutput | None = None
        """Its last output; None before its first step."""
        self._thrust_N = (0.0, 0.0)

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.last is not None and self.last.done

    def keep(self, navigation: Navigation, stamp: Stamp) -> Vec6:
        """Station-keeping wrench after the end [N, N m], in surge and sway."""
        moment = self._moment(navigation, stamp, ZERO6)
        X, Y = self.station.step(moment.place, moment.dt)
        return (X, Y, 0.0, 0.0, 0.0, 0.0)

    def cancel(self, reason: Refusal = CANCELLED, ending: str = "") -> None:
        """Stop now; ends in a hold or neutral by `ending` (default: that of the goal)."""
        if self._stopping or self.done:
            return
        self._neutral = (ending or self.goal.on_cancel) == "neutral"
        motion = self._stages[self._at].motion if self._at >= 0 else ""
        self._aborted, self._stopping = reason, True
        self._stages, self._at = [BrakeAndHold(motion, self.station, neutral=self._neutral)], -1

    def step(
        self,
        navigation: Navigation,
        stamp: Stamp,
        *,
        shortfall: Vec6 = ZERO6,
        lost_axes: Sequence[str] = (),
        battery_V: float = NAN,
    ) -> ManeuverOutput:
        """Fly one cycle.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        shortfall : [N, N m]
            What the allocator could not give of the last wrench.
        lost_axes
            Which the enabled thrusters do not serve.
        battery_V : [V]
            NaN where it is not measured.

        Returns
        -------
        ManeuverOutput
            Wrench beside the holds, setpoints, phase, and the refusal with which it ended.
        """
        last = self.last
        if last is not None and last.done:
            return last
        moment = self._moment(navigation, stamp, shortfall)
        if last is not None:
            X, Y, *_ = (wanted - missing for wanted, missing in zip(last.wrench, shortfall, strict=True))
            self._thrust_N = (X, Y)
        if not self._stopping:
            wrong = self._safety.step(self._situation(moment, tuple(lost_axes), battery_V))
            if wrong:
                self.cancel(wrong[0])
        setpoints: tuple[Setpoint, ...] = ()
        if self._at < 0:
            setpoints = self._next(moment)
        act = self._stages[self._at].step(moment)
        if act.trouble and not self._stopping:
            self.cancel(act.trouble)
            setpoints += self._next(moment)
            act = self._stages[self._at].step(moment)
        return self._output(act, setpoints, moment)

    def _output(self, act: StageOutput, setpoints: tuple[Setpoint, ...], moment: StageInput) -> ManeuverOutput:
        done = act.finished and self._at == len(self._stages) - 1
        if act.finished and not done:
            setpoints += self._next(moment)
        neutral = done and self._neutral
        if neutral:
            setpoints += RELEASED
        motion = self._stages[self._at].motion
        flown = act.phase if self._stopping or not self._safety.is_blocked(moment.time_s) else BLOCKED
        phase = ("aborted" if self._aborted else "done") if done else flown
        progress, remaining_s = self._progress(moment.time_s)
        self.last = ManeuverOutput(
            wrench=act.wrench,
            setpoints=setpoints,
            phase=Phase("" if done else motion, phase),
            progress=1.0 if done and not self._aborted else progress,
            remaining_s=0.0 if done else remaining_s,
            wall_distance_m=self._pool.ahead_m(moment.place),
            force=act.force,
            velocity=act.velocity,
            done=done,
            aborted=self._aborted if done else NOTHING,
            neutral=neutral,
            resting=act.resting,
        )
        return self.last

    def _next(self, moment: StageInput) -> tuple[Setpoint, ...]:
        """Begin the stage that follows, shortened, or stop where its end may still be too near to a wall."""
        stage = self._stages[self._at + 1]
        self._shorten(stage, moment.place)
        too_near = self._too_near(stage, moment.place)
        if too_near:
            self.cancel(too_near)
        self._at += 1
        self._entered_s = moment.time_s
        return self._stages[self._at].begin(moment)

    def _shorten(self, stage: Stage, place: PoolPosition) -> None:
        """End a leg where the guard of the walls will leave it alone, further off the longer the flight lasts."""
        for end in stage.ends[:1]:
            half_m, _ = self._pool.reach_m(end.heading_rad)
            off_m = half_m + self._safety.margin(place)[0] + MARGIN_GROWS_m
            if off_m < 0.5 * self._pool.length_m:
                stage.shorten(off_m, self._pool.length_m - off_m)

    def _too_near(self, stage: Stage, place: PoolPosition) -> Refusal:
        """What the guard of the walls would find at an end of a stage that begins here."""
        wanted_m, words = self._safety.margin(place)
        for end in stage.ends:
            wall, left_m = nearest(self._pool.walls_m(end))
            if left_m < wanted_m:
                end_text = f"{stage.motion} would end {left_m:.2f} m from the {wall} wall"
                return found(Reason.POOL_BOX, f"{end_text}, wanted {words}")
        return NOTHING

    def _moment(self, navigation: Navigation, stamp: Stamp, shortfall: Vec6) -> StageInput:
        self._started_at = stamp if self._started_at is None else self._started_at
        dt = 0.0 if self._last is None else seconds_between(self._last, stamp)
        self._last = stamp
        place = self._pool.place(navigation)
        if math.isfinite(place.heading_rad):
            self._turned_rad += math.remainder(place.heading_rad - self._turned_rad, math.tau)
        held_back = max(abs(shortfall[0]), abs(shortfall[1])) > self._knobs.shortfall_N
        fresh = math.isfinite(navigation.altitude_m) and navigation.altitude_age_s <= SILENT_S
        passed_s = seconds_between(self._started_at, stamp)
        along = tuple(map(math.isfinite, navigation.velocity_mps[:2]))
        velocity, by_wall = self._velocity or any(along), self._looks and any(along)
        return StageInput(navigation, place, passed_s, dt, self._turned_rad, held_back, fresh, velocity, by_wall)

    def _situation(self, moment: StageInput, lost_axes: tuple[str, ...], battery_V: float) -> Situation:
        return Situation(
            navigation=moment.navigation,
            place=moment.place,
            walls_m=self._pool.walls_m(moment.place),
            time_s=moment.time_s,
            battery_V=battery_V,
            deadline_s=self.seconds * self._knobs.overtime + self._knobs.overtime_s,
            lost_axes=lost_axes,
            needed_axes=(self._stages[max(self._at, 0)].motion, "heave"),
            thrust_N=self._thrust_N,
        )

    def _progress(self, time_s: float) -> tuple[float, float]:
        if self._stopping:
            return self._passed, max(0.0, self._stages[0].seconds - time_s + self._entered_s)
        inside_s = min(time_s - self._entered_s, self._seconds[self._at])
        passed_s = sum(self._seconds[: self._at]) + inside_s
        self._passed = passed_s / self.seconds
        return self._passed, self.seconds - passed_s

    # ---- from plans to stages

    def _all_stages(self) -> list[Stage]:
        stages: list[Stage] = []
        place_m = self._pool.start_m
        for plan in self.plans:
            stages += self._stages_of(plan, place_m)
            place_m = plan.end_m
        return stages

    def _stages_of(self, plan: Plan, before_m: tuple[float, float]) -> list[Stage]:
        """Stages of a plan that begins where the one before it ended."""
        place = PoolPosition(*plan.start_m, plan.heading_rad, 0.0, 0.0)
        pose = Pose(place, self._pool.axis_rad + plan.heading_rad, plan.vertical, self._pool.depth_m)
        seconds = SETTLING_S + math.dist(before_m, plan.start_m) / self.station.speed_mps
        begin: list[Stage] = [SettleAtPose(plan.motion, self.station, pose, seconds=seconds)]
        if plan.hover_s > 0.0:
            begin.append(Hover(plan.legs[0].name, self.station, plan.hover_s))
        if self.goal.excitation != PLATEAUS:
            return [*begin, self._excite(plan, pose)]
        freedom = self._planner.freedoms[plan.motion]
        easing = Easing()
        drives: list[Stage] = [
            ExciteMotion(leg.axis, LegController(leg, easing), freedom, self.station, pose) for leg in plan.legs
        ]
        return [*begin, *drives]

    def _excite(self, plan: Plan, pose: Pose) -> Stage:
        """Excite about the middle of the legs' room, no faster and no stronger than the fastest leg."""
        freedom = self._planner.freedoms[plan.motion]
        ends = [end for leg in plan.legs for end in (leg.start, leg.end)]
        fastest = max(plan.legs, key=lambda leg: abs(leg.rate))
        bounds = Bounds(
            force=abs(fastest.level) + freedom.inertia * abs(fastest.rate) / (4.0 * CHARACTERS[plan.motion].boost_s),
            rate=abs(fastest.rate),
            middle=0.5 * (min(ends) + max(ends)),
            room=0.5 * (max(ends) - min(ends)),
            inertia=freedom.inertia,
        )
        wanted = signal(self.goal.excitation, self.goal.seed, self._knobs.excitation_s, bounds.slowest_Hz)
        driver = Excite(wanted, bounds, self._knobs.excitation_s)
        return ExciteMotion(plan.motion, driver, freedom, self.station, pose)
