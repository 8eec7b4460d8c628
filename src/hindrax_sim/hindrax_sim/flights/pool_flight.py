"""A pool test in lock-step, in a world of one's choice: what was learned of it, what is true, and how it ended.

Fly once, identify often: the `events` of a flight can be pickled and given to `identified` with changed code.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from hindrax_control.maneuver.goal import PLATEAUS, Goal
from hindrax_control.maneuver.maneuver import Maneuver, ManeuverOutput
from hindrax_control.maneuver.plan import Plan
from hindrax_control.maneuver.pulses import PulseManeuver
from hindrax_control.pilot import Pilot, PilotKnobs
from hindrax_core.events import Stamp, Stamped, seconds_between, to_s
from hindrax_core.signals import NAN, Allocation, Estimate, IdentEvent, Navigation
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_ident.online.aim import Aim
from hindrax_ident.online.experiment import Experiment
from hindrax_ident.online.session import Outcome, Session
from hindrax_sim.conditions.world_table import IDEAL, sizes_of
from hindrax_sim.flights.lockstep import IDLE, Lockstep, LockstepCommand
from hindrax_sim.world import Conditions, World

LONGEST_FLIGHT_S = 7200.0
Watch: TypeAlias = Callable[[World, ManeuverOutput], None]
"""Called in every cycle of a maneuver with the truth and what the maneuver puts out."""
READY_S = 1.0
"""Time for which the guards must agree before arming."""
PATIENCE_S = 60.0
"""Longest wait for them: a state is known after some ten seconds."""


@dataclass(frozen=True, slots=True)
class PoolFlight:
    """One flight: the vehicle as modeled, the world, what identified it, how it ended."""

    vehicle: Vehicle
    world: World
    session: Session
    aborted: Refusal
    plans: tuple[Plan, ...] = ()
    experiment: Experiment | None = None

    @property
    def outcome(self) -> Outcome:
        """Result of the identification; computed at every call."""
        return self.session.finalize()

    @property
    def truth(self) -> dict[str, dict[str, float]]:
        """The hull's own coefficients, by motion."""
        return truth_of(self.world.truth.described())

    def drag_N(self, motion: str, speed: float) -> float:
        """The hull's own drag at a signed speed, positive with it [N, N m]."""
        return self.world.truth.resistance(MOTIONS[motion].axis, speed)


def fly(
    motions: Sequence[str],
    seed: int,
    world: str = IDEAL,
    *,
    vehicle: Vehicle,
    excitation: str = PLATEAUS,
    knobs: PilotKnobs | None = None,
    watch: Watch = lambda _world, _output: None,
    aim: Aim | None = None,
    listen: Callable[[Stamped[IdentEvent]], None] = lambda _event: None,
    by_bytes: bool = False,
) -> PoolFlight:
    """Fly a goal with the modeled vehicle, in lock-step.

    Parameters
    ----------
    motions
        In the order in which they are flown.
    seed
        Of noise and excitation; what is random in the world is drawn by it too.
    world
        As of `--world`.
    vehicle
        The truth, and what the stack knows.
    excitation
        Of the goal.
    knobs
        Of the pilot; None: defaults.
    watch
        Gets world and maneuver at each state while a goal is under way.
    aim
        With one, the identification chooses what is flown until it is reached.
    listen
        Gets every event that the identification gets.
    by_bytes
        Whether all goes through drivers and emulators, an emulated ArduSub too; it takes ten times as long.

    Returns
    -------
    PoolFlight
        World at the end, identification, why it was aborted, and plans.
    """
    vehicle = calibrated(vehicle)
    session = _ListenedSession(vehicle, listen)
    experiment = None if aim is None else Experiment(tuple(motions), aim)
    if experiment is None:
        pilot = GoalPilot(vehicle, Goal(tuple(motions), excitation, seed), knobs)
    else:

        def chosen(now: Stamp) -> Goal | None:
            choice = experiment.next(session, to_s(now))
            return None if choice is None else Goal((choice.motion,), levels=choice.levels)

        pilot = GoalPilot(vehicle, None, knobs, following=chosen, cancel_at_s=experiment.aim.limit_s)
    conditions = Conditions(sizes=sizes_of(world, seed))
    step = Lockstep(vehicle, pilot, seed, conditions=conditions, session=session, by_bytes=by_bytes)
    for event in step.run(LONGEST_FLIGHT_S):
        if isinstance(event.reading, Navigation) and pilot.output is not None:
            watch(step.world, pilot.output)
    never = pilot.refused or Refusal(Reason.UNNAMED, "start: the maneuver did not begin")
    aborted = pilot.output.aborted if pilot.output is not None else never
    if experiment is not None and aborted.reason is Reason.CANCELLED:
        aborted, _ = NOTHING, experiment.next(session, to_s(step.world.stamp))
    return PoolFlight(vehicle, step.world, session, aborted, pilot.plans, experiment)


def calibrated(vehicle: Vehicle) -> Vehicle:
    """Say of every sensor that its accelerometer was calibrated: the lock-step's have the offset that is left then."""
    done = {"accel_offset_mps2": (0.0, 0.0, 0.0)}
    sensors = {
        name: replace(mount, calibration={**done, **mount.calibration}) for name, mount in vehicle.sensors.items()
    }
    return replace(vehicle, sensors=sensors)


class _ListenedSession(Session):
    """A session without estimates that passes its events on."""

    def __init__(self, vehicle: Vehicle, listen: Callable[[Stamped[IdentEvent]], None]) -> None:
        super().__init__(vehicle, every_s=math.inf)
        self._listen = listen

    def step(self, event: Stamped[IdentEvent]) -> Sequence[Stamped[Estimate]]:
        self._listen(event)
        return super().step(event)


class GoalPilot:
    """Flies a goal, if there is one, then those that `following` returns, with the vehicle's own pilot.

    It arms when the guards permit and disarms in the end.

    `maneuver`, `output`, `plans` and `suspected` (thrusters) hold the outcome; `refused`: why it never began.

    `cancel_at_s` (after the start of the maneuver) cancels it as an operator would.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        goal: Goal | None,
        knobs: PilotKnobs | None = None,
        *,
        following: Callable[[Stamp], Goal | None] = lambda _now: None,
        cancel_at_s: float = NAN,
    ) -> None:
        self.pilot = Pilot(vehicle, knobs)
        self._goal, self._following = goal, following
        self.plans: tuple[Plan, ...] = ()
        self.maneuver: Maneuver | PulseManeuver | None = None
        self.output: ManeuverOutput | None = None
        self._cancel_at_s = cancel_at_s
        self.refused = NOTHING
        self._first: Stamp | None = None
        self._ready_since: Stamp | None = None
        self._started_at: Stamp | None = None
        self.suspected: tuple[str, ...] = ()
        self._disabled: frozenset[str] = frozenset()

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Decide on the next order: disable what is suspected, and begin the next goal when one is done.

        Parameters
        ----------
        navigation, became, armed
            As of `LockstepPilot.step`.

        Returns
        -------
        LockstepCommand
            Finished when no goal follows, or the guards refuse for `PATIENCE_S`.
        """
        stamp = navigation.stamp
        if self._started_at is not None and seconds_between(self._started_at, stamp) >= self._cancel_at_s:
            self.pilot.cancel()
        flight = self.pilot.step(navigation.reading, stamp, became, armed=armed)
        self.output = flight.maneuver
        if flight.suspected_fault is not None:
            # A thruster without thrust is disabled, as by the pilot node.
            self.suspected += (flight.suspected_fault.sentence,)
            self._disabled |= {flight.suspected_fault.name}
            self.pilot.disable(self._disabled)
        if (self.output is not None and self.output.done) or (armed and self.maneuver is None):
            goal = self._next(stamp)
            if goal is None:
                return LockstepCommand(phase=IDLE if self.output is None else self.output.phase, finished=True)
            self.maneuver = self.pilot.fly(goal)
            self.plans += self.maneuver.plans
            self._started_at = stamp if self._started_at is None else self._started_at
        phase = self.output.phase if self.output is not None else IDLE
        self._first = stamp if self._first is None else self._first
        if self.maneuver is None and flight.guards and seconds_between(self._first, stamp) > PATIENCE_S:
            self.refused = flight.guards[0].within("start: ")
            return LockstepCommand(phase=phase, finished=True)
        return LockstepCommand(flight.wrench, phase, self._ready(stamp, flight.guards), disabled=self._disabled)

    def _next(self, stamp: Stamp) -> Goal | None:
        """Goal to fly now; None after one that was aborted, and when nothing follows."""
        goal, self._goal = self._goal, None
        if goal is not None or (self.output is not None and self.output.aborted):
            return goal
        return self._following(stamp)

    def _ready(self, stamp: Stamp, guards: Sequence[str]) -> bool:
        """Whether to arm, or to stay armed; once the maneuver has begun, its own guards decide."""
        if self.maneuver is not None:
            return True
        if guards:
            self._ready_since = None
        elif self._ready_since is None:
            self._ready_since = stamp
        return self._ready_since is not None and seconds_between(self._ready_since, stamp) >= READY_S
