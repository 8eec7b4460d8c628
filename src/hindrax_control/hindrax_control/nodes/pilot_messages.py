"""What the pilot is told and tells, as messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hindrax_control.holds import HoldState
from hindrax_control.maneuvers import Goal, ManeuverOutput
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.state import Estimate
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import HoldStatus, ManeuverStatus
from hindrax_ros.convert import stamp_to_msg

FRESH_S = 2.0
"""Age from which on an estimate counts as one that learns no more, whatever it said."""


def goal_from_msg(message: Any) -> Goal:
    """Motions and how to fly them."""
    return Goal(tuple(message.motions), message.excitation, int(message.seed), message.on_cancel)


def holds_to_msg(holds: Sequence[HoldState], stamp: Stamp) -> HoldStatus:
    """Every hold."""
    message = HoldStatus(
        axes=[one.axis for one in holds],
        engaged=[one.engaged for one in holds],
        setpoints=[one.setpoint for one in holds],
        errors=[one.error for one in holds],
        notes=[one.note for one in holds],
    )
    message.header.stamp = stamp_to_msg(stamp)
    return message


def maneuver_to_msg(output: ManeuverOutput, stamp: Stamp) -> ManeuverStatus:
    """What is flown, for everybody."""
    message = ManeuverStatus(
        motion=output.phase.motion,
        phase=output.phase.phase,
        aborted=output.aborted,
        progress=output.progress,
        remaining=output.remaining_s,
        wall_distance=output.wall_distance_m,
        force=output.force,
        velocity=output.velocity,
    )
    message.header.stamp = stamp_to_msg(stamp)
    return message


def feedback_to_msg(output: ManeuverOutput, estimates: Mapping[str, Stamped[Estimate]], stamp: Stamp) -> Any:
    """What is flown, for who asked for it, with what is known of that motion; `estimates` are those of each motion."""
    feedback = FlyManeuver.Feedback(
        motion=output.phase.motion,
        phase=output.phase.phase,
        progress=output.progress,
        remaining_s=output.remaining_s,
        wall_distance_m=output.wall_distance_m,
        force=output.force,
        velocity=output.velocity,
    )
    known = estimates.get(output.phase.motion)
    if known is not None:
        estimate = known.reading
        feedback.coefficients, feedback.units = list(estimate.names), list(estimate.units)
        feedback.estimates, feedback.sigmas = list(estimate.values), list(estimate.sigmas)
        feedback.learning = estimate.learning and seconds_between(known.stamp, stamp) <= FRESH_S
    return feedback
