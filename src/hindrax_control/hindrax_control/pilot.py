"""The pilot: holds, maneuvers and the operator's hand together make one wrench, every cycle.

Pure. Setpoints, goals, cancels and wrenches by hand are events; `step` is called for every new Navigation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from hindrax_control.allocation import AllocationKnobs, Allocator
from hindrax_control.box import Box, BoxKnobs
from hindrax_control.guard import CommandGuard, CommandGuardKnobs
from hindrax_control.holds import HoldKnobs, Holds, HoldState, Setpoint
from hindrax_control.maneuvers import Goal, Maneuver, ManeuverKnobs, ManeuverOutput
from hindrax_control.plan import PlanKnobs
from hindrax_control.safety import Safety, SafetyKnobs, Situation
from hindrax_control.stages import SENSELESS
from hindrax_control.station import StationKnobs
from hindrax_control.watch import Suspicion, ThrusterWatch, WatchKnobs
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, seconds_between, to_s
from hindrax_core.readings import Vec6
from hindrax_core.state import NAN, ZERO6, Allocation, Navigation
from hindrax_core.vehicle import Vehicle

BUSY = "a maneuver is being flown; `./hindrax stop` ends it"
REFUSAL_S = 5.0
"""Time for which a refused setpoint or wrench is shown."""
HAND = "hand"
"""Whose refusals are not those of a hold."""


@dataclass(frozen=True, slots=True)
class PilotKnobs:
    """The knobs of everything the pilot is made of."""

    holds: HoldKnobs = field(default_factory=HoldKnobs)
    station: StationKnobs = field(default_factory=StationKnobs)
    box: BoxKnobs = field(default_factory=BoxKnobs)
    plan: PlanKnobs = field(default_factory=PlanKnobs)
    maneuver: ManeuverKnobs = field(default_factory=ManeuverKnobs)
    safety: SafetyKnobs = field(default_factory=SafetyKnobs)
    hand: CommandGuardKnobs = field(default_factory=CommandGuardKnobs)
    allocation: AllocationKnobs = field(default_factory=AllocationKnobs)
    watch: WatchKnobs = field(default_factory=WatchKnobs)


@dataclass(frozen=True, slots=True)
class Flight:
    """One cycle: the wrench for the allocator [N, Nm], every hold, the maneuver (None: none), what the guards say.

    `refused` says what was lately refused of the wrenches by hand, and why.
    `suspicion` names a thruster in use that does not seem to push: whoever decides may take it out.
    """

    wrench: Vec6
    holds: tuple[HoldState, ...]
    maneuver: ManeuverOutput | None
    guards: tuple[str, ...]
    suspicion: Suspicion | None = None
    refused: str = ""


class Pilot:
    """Flies one vehicle. A disarmed vehicle is asked for nothing, and forgets what it was told to hold."""

    def __init__(self, vehicle: Vehicle, knobs: PilotKnobs | None = None) -> None:
        self._vehicle, self._knobs = vehicle, knobs or PilotKnobs()
        # For plans only: what the thrusters can reach. Allocating is done elsewhere.
        self._allocator = Allocator(vehicle, self._knobs.allocation)
        self._holds = Holds(vehicle, self._knobs.holds)
        self._guard = CommandGuard(vehicle, self._knobs.hand)
        self._box: Box | None = None
        self._safety = Safety(vehicle, self._knobs.safety)
        self._watch = ThrusterWatch(vehicle, self._knobs.watch)
        self._maneuver: Maneuver | None = None
        self._keeping = False
        self._by_hand: tuple[Stamp, Vec6] | None = None
        self._armed = self._was_armed = False
        self._guards: tuple[str, ...] = ()
        self._disabled: frozenset[str] = frozenset()
        self._refused: dict[str, tuple[Stamp, str]] = {}
        self._stamp = Stamp(0)

    # ---- events

    def set(self, setpoint: Setpoint) -> str:
        """Engage, move or release a hold; returns why it is refused, or nothing. The state of the hold says it too."""
        reason = self._unwelcome(setpoint) or self._holds.set(setpoint)
        self._refused.pop(setpoint.axis, None)
        if reason:
            self.refuse(setpoint.axis, reason)
        return reason

    def refuse(self, axis: str, reason: str) -> None:
        """Let the state of a hold say why a setpoint for it was refused, whoever refused it."""
        self._refused[axis] = (self._stamp, reason)

    def _unwelcome(self, setpoint: Setpoint) -> str:
        if not self._armed and setpoint.engaged:
            return f"hold {setpoint.axis}: the vehicle is not armed; `./hindrax arm` first"
        if self.flying:
            return f"hold {setpoint.axis}: {BUSY}"
        return ""

    def by_hand(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> tuple[str, ...]:
        """Add a wrench by hand to the holds until it is stale; returns what of it is refused, and why."""
        judged = self._guard.step(wrench, frame, stamp, now)
        refused = judged.refused
        if judged.wrench is not None and self.flying:
            refused = (f"wrench: {BUSY}",)
        elif judged.wrench is not None:
            self._keeping = False
            self._by_hand = (stamp, judged.wrench)
        if refused:
            self.refuse(HAND, "; ".join(refused))
        return refused

    def disable(self, disabled: frozenset[str]) -> None:
        """Tell which thrusters must not be used."""
        self._disabled = disabled

    def fly(self, goal: Goal) -> Maneuver:
        """Begin a maneuver with the next step; HindraxError says why it cannot be flown now or at all."""
        if self.flying:
            raise HindraxError(BUSY)
        if not self._armed:
            raise HindraxError("the vehicle is not armed; `./hindrax arm` first")
        if self._guards:
            raise HindraxError(self._guards[0])
        if self._box is None:
            raise HindraxError(f"the heading is unknown; {SENSELESS}")
        knobs = self._knobs
        self._maneuver = Maneuver(
            self._vehicle,
            self._allocator,
            goal,
            self._box,
            knobs=knobs.maneuver,
            plan_knobs=knobs.plan,
            station_knobs=knobs.station,
            safety_knobs=knobs.safety,
            disabled=self._disabled,
        )
        self._keeping = True
        return self._maneuver

    def cancel(self, ending: str = "") -> None:
        """Stop the maneuver, if there is one: accepted at any moment. `ending`: hold, neutral, or as the goal says."""
        if self._maneuver is not None:
            self._maneuver.cancel(ending=ending)

    def abandon(self) -> None:
        """Forget what is flown, held and pushed: there is no state of the vehicle on which it could be ended."""
        self._maneuver, self._keeping, self._by_hand = None, False, None
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
        battery_V: float = NAN,
    ) -> Flight:
        """Return the wrench for this state; `allocation` is what became of the last wrench.

        Where it says the forces of the thrusters, a dead one is noticed. `unarmed` is why they are not armed.
        """
        self._stamp = stamp
        self._note(navigation, stamp, battery_V, armed=armed, unarmed=unarmed)
        shortfall = allocation.shortfall if allocation else ZERO6
        lost = allocation.lost_axes if allocation else ()
        flown, wrench = self._fly_on(navigation, stamp, shortfall, lost, battery_V)
        held = self._holds.step(navigation, stamp, shortfall, armed=armed)
        states = tuple(map(self._with_refusal, held.states)) if self._refused else held.states
        if not armed:
            return Flight(ZERO6, states, flown, self._guards, refused=self._refusal(HAND))
        total = _sum(_sum(held.wrench, wrench), self._hand(stamp))
        suspicion = self._suspicion(navigation, stamp, allocation)
        return Flight(total, states, flown, self._guards, suspicion, self._refusal(HAND))

    def _refusal(self, axis: str) -> str:
        """Why something was refused, for a while."""
        made, reason = self._refused.get(axis, (self._stamp, ""))
        return reason if seconds_between(made, self._stamp) <= REFUSAL_S else ""

    def _with_refusal(self, state: HoldState) -> HoldState:
        """Let the state of a hold say for a while that a setpoint was refused."""
        reason = self._refusal(state.axis)
        if not reason:
            return state
        return replace(state, note=f"{state.note}; refused: {reason}" if state.note else f"refused: {reason}")

    def _note(self, navigation: Navigation, stamp: Stamp, battery_V: float, *, armed: bool, unarmed: str) -> None:
        if not self._was_armed and math.isfinite(navigation.attitude_rad[2]):
            # Until it is armed for the first time, the vehicle lies in the pool as the knobs say.
            self._box = Box(self._vehicle, navigation.attitude_rad[2], self._knobs.box)
        place = self._box.place(navigation) if self._box else None
        walls_m = self._box.walls_m(place) if self._box and place else {}
        self._guards = self._safety.step(Situation(navigation, place, walls_m, to_s(stamp), battery_V))
        if self._armed and not armed:
            self._keeping = False
            self._by_hand = None
            if self._maneuver is not None:
                why = f" ({unarmed})" if unarmed else ""
                self._maneuver.cancel(f"disarmed: the thrusters were disarmed{why}; arm and fly again", "neutral")
        self._armed = armed
        self._was_armed = self._was_armed or armed

    def _fly_on(
        self, navigation: Navigation, stamp: Stamp, shortfall: Vec6, lost: tuple[str, ...], battery_V: float
    ) -> tuple[ManeuverOutput | None, Vec6]:
        maneuver = self._maneuver
        if maneuver is None:
            return None, ZERO6
        if not maneuver.done:
            output = maneuver.step(navigation, stamp, shortfall=shortfall, lost_axes=lost, battery_V=battery_V)
            for setpoint in output.setpoints:
                self._holds.set(setpoint)
            self._keeping = not output.neutral
            return output, output.wrench
        return maneuver.last, maneuver.keep(navigation, stamp) if self._keeping else ZERO6

    def _suspicion(self, navigation: Navigation, stamp: Stamp, allocation: Allocation | None) -> Suspicion | None:
        if allocation is None or not allocation.forces_N:
            return None
        found = self._watch.step(navigation, stamp, allocation.forces_N)
        return found if found is not None and found.name not in self._disabled else None

    def _hand(self, stamp: Stamp) -> Vec6:
        if self._by_hand is None:
            return ZERO6
        made, wrench = self._by_hand
        if seconds_between(made, stamp) > self._knobs.hand.max_age_s:
            self._by_hand = None
            return ZERO6
        return wrench


def _sum(one: Vec6, other: Vec6) -> Vec6:
    X, Y, Z, K, M, N = (a + b for a, b in zip(one, other, strict=True))
    return (X, Y, Z, K, M, N)
