"""Why a goal is refused: it is none, this vehicle cannot fly it, or it cannot begin now.

A plan that does not fit the pool is refused by the planner, and an order that comes late by the node.
"""

from __future__ import annotations

from collections.abc import Sequence

from hindrax_control.maneuver.excitation import EXCITATIONS
from hindrax_control.maneuver.goal import ENDINGS, PLATEAUS, Goal
from hindrax_control.maneuver.plan import MOTIONS
from hindrax_control.maneuver.servable import require_lift, require_servable
from hindrax_control.maneuver.stages import SENSELESS
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import Vehicle

MOST_MOTIONS, MOST_LEVELS = 12, 20
"""Limits per goal: planning blocks the control cycle."""
BUSY = "a maneuver is being flown; `./hindrax stop` ends it"
LATE = "late"
"""Guard of goals that arrive late; the client may send them again."""


def require_flyable(goal: Goal, vehicle: Vehicle, disabled: frozenset[str] = frozenset()) -> None:
    """UsageError that says why a goal can never be flown by this vehicle without the disabled thrusters."""
    check_goal(goal)
    require_servable(goal.motions, vehicle, disabled)
    require_lift(vehicle)


def require_ready(*, flying: bool, armed: bool, guards: Sequence[str], heading_known: bool) -> None:
    """HindraxError that says why no maneuver can begin now; `guards`: what is wrong, the first thing first."""
    if flying:
        raise HindraxError(BUSY)
    if not armed:
        raise HindraxError("the vehicle is not armed; `./hindrax arm` first")
    if guards:
        raise HindraxError(guards[0])
    if not heading_known:
        raise HindraxError(f"the heading is unknown; {SENSELESS}")


def check_goal(goal: Goal) -> None:
    """UsageError that names what is invalid in a goal."""
    if not goal.motions:
        raise UsageError(f"goal: no motion, wanted some of {', '.join(MOTIONS)}")
    if len(goal.motions) > MOST_MOTIONS:
        raise UsageError(f"goal: {len(goal.motions)} motions, wanted at most {MOST_MOTIONS}; fly the rest after them")
    for motion in goal.motions:
        if motion not in MOTIONS:
            raise UsageError(f"goal: motion {motion!r} unknown, wanted one of {', '.join(MOTIONS)}")
    if goal.excitation not in (PLATEAUS, *EXCITATIONS):
        raise UsageError(f"goal: excitation {goal.excitation!r} unknown, wanted {PLATEAUS} or {', '.join(EXCITATIONS)}")
    if goal.on_cancel not in ENDINGS:
        raise UsageError(f"goal: ending {goal.on_cancel!r} unknown, wanted {' or '.join(ENDINGS)}")
    _check_levels(goal)


def _check_levels(goal: Goal) -> None:
    if goal.levels and (len(goal.motions) > 1 or goal.excitation != PLATEAUS):
        found = f"{', '.join(goal.motions)} by {goal.excitation}"
        raise UsageError(f"goal: levels of {found}, wanted those of one motion by {PLATEAUS}")
    if len(goal.levels) > MOST_LEVELS:
        raise UsageError(f"goal: {len(goal.levels)} levels, wanted at most {MOST_LEVELS}; fly the rest after them")
    for level in goal.levels:
        if not 0.0 <= level <= 1.0:
            raise UsageError(f"goal: level {level:g}, wanted 0 (the slowest plateau) to 1 (the fastest)")
