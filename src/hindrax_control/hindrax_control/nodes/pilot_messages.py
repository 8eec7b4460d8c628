"""Messages that the pilot receives and publishes."""

import math
from collections.abc import Mapping, Sequence

from rclpy.action.server import ServerGoalHandle

from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.goal import ENDINGS, PLATEAUS, Goal, Pulse
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.maneuver.plan import Plan
from hindrax_control.pool_bounds import GuardedPlace
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.readings import vec6
from hindrax_core.signals import NAN, UNKNOWN6, Allocation, Estimate
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, refused
from hindrax_core.vehicle import AXES
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import AllocationStatus, HoldStatus, ManeuverStatus, ModelEstimate, MotionPlans, PoolPlace
from hindrax_msgs.srv import Recentre
from hindrax_ros.graph import end_goal
from hindrax_ros.messages.convert import header

LEARNED = frozenset((*AXES, "heave_down", "heave_up"))
"""Motions of which there may be an estimate."""
FRESH_S = 2.0
"""Age from which on an estimate counts as no longer learning."""


def goal_from_msg(message: FlyManeuver.Goal, thrusters: int) -> Goal:
    """Motions and how to fly them, or pulses of so many thrusters. UsageError where their numbers do not fit."""
    levels = tuple(map(float, message.levels))
    pulses = _pulses_from_msg(message, thrusters)
    excitation, on_cancel = message.excitation or PLATEAUS, message.on_cancel or ENDINGS[0]
    return Goal(tuple(message.motions), excitation, int(message.seed), on_cancel, levels, pulses)


def _pulses_from_msg(message: FlyManeuver.Goal, thrusters: int) -> tuple[Pulse, ...]:
    count, forces_N = len(message.pulse_seconds), tuple(map(float, message.pulse_forces))
    if len(forces_N) != count * thrusters or len(message.pulse_calm) != count:
        found = f"{len(forces_N)} forces and {len(message.pulse_calm)} times of rest for {count} pulses"
        raise UsageError(Refusal(Reason.GOAL, f"goal: {found}, wanted {count * thrusters} and {count}"))
    return tuple(
        Pulse(forces_N[at * thrusters : (at + 1) * thrusters], float(seconds), bool(calm))
        for at, (seconds, calm) in enumerate(zip(message.pulse_seconds, message.pulse_calm, strict=True))
    )


def place_from_msg(message: Recentre.Request) -> tuple[float, float, float]:
    """Place in the pool [m] and heading from its length [rad] of a request; NaN for what it leaves out.

    A request that leaves fields out has zeros there. No hull fits at the corner of the two walls, so that is no place;
    a heading of zero is one, so it counts only where it is set.
    """
    placed = (message.x, message.y) != (0.0, 0.0)
    x_m, y_m = (message.x, message.y) if placed else (NAN, NAN)
    return x_m, y_m, message.turned if message.set_heading else NAN


def result_of(aborted: Refusal, handle: ServerGoalHandle) -> FlyManeuver.Result:
    """Bring the handle of a goal into its last state and return the result."""
    end_goal(handle, aborted)
    return FlyManeuver.Result(completed=not aborted, aborted=str(aborted), error_code=aborted.reason)


def estimate_refusal(message: ModelEstimate) -> Refusal:
    """Return why a ModelEstimate cannot be one (`UNKNOWN_NAME`, `MALFORMED`); nothing when it can."""
    count = len(message.values)
    if message.motion not in LEARNED:
        return refused(Reason.UNKNOWN_NAME, what="motion", name=message.motion[:40], known=", ".join(sorted(LEARNED)))
    if not len(message.names) == len(message.units) == count or len(message.covariance) != count * count:
        found = f"{len(message.names)} names, {len(message.units)} units and {len(message.covariance)} covariances"
        wanted = f"{count}, {count} and {count * count}"
        return refused(Reason.MALFORMED, found=f"{found} for {count} values", wanted=wanted)
    if any(message.covariance[index * (count + 1)] < 0.0 for index in range(count)):
        return refused(Reason.MALFORMED, found="a negative variance", wanted="none")
    return NOTHING


def allocation_from_msg(message: AllocationStatus, thrusters: int) -> Allocation:
    """Fields of an AllocationStatus for the pilot: shortfall [N, N m], forces [N], lost axes. ValueError if refused."""
    forces_N, shortfall = tuple(message.forces), tuple(map(float, message.shortfall))
    if len(forces_N) != thrusters or not all(map(math.isfinite, (*forces_N, *shortfall))):
        raise ValueError(f"found {len(forces_N)} forces and a shortfall, wanted {thrusters} finite ones")
    lost_axes = tuple(message.lost_axes)
    return Allocation(UNKNOWN6, UNKNOWN6, vec6(shortfall), forces_N, (), (), lost_axes=lost_axes)


def holds_to_msg(holds: Sequence[HoldState], stamp: Stamp) -> HoldStatus:
    """HoldStatus of every hold."""
    return HoldStatus(
        header=header(stamp),
        axes=[one.axis for one in holds],
        engaged=[one.engaged for one in holds],
        setpoints=[one.setpoint for one in holds],
        errors=[one.error for one in holds],
        notes=[one.note for one in holds],
    )


def maneuver_to_msg(output: ManeuverOutput, stamp: Stamp) -> ManeuverStatus:
    """ManeuverStatus of one cycle."""
    return ManeuverStatus(
        header=header(stamp),
        motion=output.phase.motion,
        phase=output.phase.phase,
        aborted=str(output.aborted),
        error_code=output.aborted.reason,
        progress=output.progress,
        remaining=output.remaining_s,
        wall_distance=output.wall_distance_m,
        force=output.force,
        velocity=output.velocity,
    )


def place_to_msg(found: GuardedPlace, stamp: Stamp) -> PoolPlace:
    """PoolPlace of a place."""
    return PoolPlace(
        header=header(stamp),
        along=found.place.x_m,
        across=found.place.y_m,
        heading=found.place.heading_rad,
        sigma=found.place.sigma_m,
        walls=list(found.walls_m),
        distances=list(found.walls_m.values()),
        margin=found.margin_m,
        unplaced=found.unplaced,
    )


def plans_to_msg(plans: Mapping[str, Plan | str], stamp: Stamp) -> MotionPlans:
    """MotionPlans of every motion."""
    return MotionPlans(
        header=header(stamp),
        motions=list(plans),
        plans=[str(one) for one in plans.values()],
        seconds=[one.seconds if isinstance(one, Plan) else NAN for one in plans.values()],
    )


def feedback_to_msg(
    output: ManeuverOutput, estimates: Mapping[str, Stamped[Estimate]], stamp: Stamp
) -> FlyManeuver.Feedback:
    """Feedback of FlyManeuver with the estimate of its motion; `estimates`: by motion."""
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
