"""A goal flown in lock-step: arms when the guards permit, flies it with the vehicle's own pilot, disarms."""

from collections.abc import Callable, Sequence

from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import Maneuver, ManeuverOutput
from hindrax_control.maneuver.plan import Plan
from hindrax_control.pilot import Pilot, PilotKnobs
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import NAN, Allocation, Navigation
from hindrax_core.vehicle import Vehicle
from hindrax_sim.flights.lockstep import IDLE, LockstepCommand

READY_S = 1.0
"""Time for which the guards must agree before arming."""
PATIENCE_S = 60.0
"""Longest wait for them: a state is known after some ten seconds."""


class GoalPilot:
    """Flies a goal, if there is one, then those that `following` returns.

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
        self.maneuver: Maneuver | None = None
        self.output: ManeuverOutput | None = None
        self._cancel_at_s = cancel_at_s
        self.refused = ""
        self._first: Stamp | None = None
        self._ready_since: Stamp | None = None
        self._started_at: Stamp | None = None
        self.suspected: tuple[str, ...] = ()
        self._disabled: frozenset[str] = frozenset()

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Decide on the next order."""
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
            self.refused = f"start: {flight.guards[0]}"
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
