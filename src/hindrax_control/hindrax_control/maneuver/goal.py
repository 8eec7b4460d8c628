"""Goals of maneuvers: what is asked for, which motions a vehicle can fly, and why a goal is refused.

A vehicle flies the motions that its thrusters serve independently and its sensors measure. A plan that does not fit the
pool is refused by the planner, and an order that comes late by the node.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix, effectiveness, served_axes
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.sensor_table import Capability
from hindrax_core.text.refusals import SENSELESS, STILL_ARMED, Reason, Refusal, without_state
from hindrax_core.vehicle import AXES, Vehicle

ENDINGS = ("hold", "neutral")
PLATEAUS = "plateaus"
EXCITATIONS = ("steps", "doublets", "chirp", "multisine")
MOST_MOTIONS, MOST_LEVELS = 12, 20
"""Limits per goal: planning blocks the control cycle."""
BUSY = Refusal(Reason.BUSY, "a maneuver is being flown; `./hindrax stop` ends it")
ALONG = ("surge", "sway")
"""Flown along the pool's length, by a velocity."""
LOOKS: Mapping[str, Capability] = {"surge": "range_ahead", "sway": "range_aside"}
"""Range to a wall that shows each of them without a DVL."""
HEADING_UNKNOWN = Refusal(Reason.HEADING, f"the heading is unknown; {SENSELESS}")
POSITION_UNKNOWN = Refusal(Reason.NAVIGATION, f"the position is unknown; {SENSELESS}")
SHARE = 0.05
"""A lost axis counts as bound to a served one that makes at least this share of its row."""


MOST_PULSES, LONGEST_PULSE_S, MOST_PULSE_N = 100, 2.0, 3.0
"""Limits of pulses of single thrusters: nothing that they do may need a guard to be harmless."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """Forces of the thrusters in the order of the vehicle file for some seconds; `calm`: it begins at rest only."""

    forces_N: tuple[float, ...]
    seconds: float
    calm: bool = True


@dataclass(frozen=True, slots=True)
class Goal:
    """Motions to fly, in order, how they are excited, and how a cancelled or aborted maneuver ends.

    `levels`: plateaus of the one motion, from 0, the slowest, to 1, the fastest; empty: those of the plan.
    `pulses`: of single thrusters, to fly instead of motions.
    """

    motions: tuple[str, ...]
    excitation: str = PLATEAUS
    seed: int = 0
    on_cancel: str = "hold"
    levels: tuple[float, ...] = ()
    pulses: tuple[Pulse, ...] = ()


def no_state(silent_s: float | None, stood_still_s: float, longest_s: float) -> Refusal:
    """Why a flight ends without a state of the vehicle.

    Parameters
    ----------
    silent_s : [s]
        Time since the last state; None before the first.
    stood_still_s : [s]
        Time for which the process that asks had not looked.
    longest_s : [s]
        Silence that ends a flight.

    Returns
    -------
    Refusal
        It names a computer that was held up rather than a sensor, where that explains the silence.
    """
    if silent_s is not None and stood_still_s > longest_s:
        held_up = f"the pilot itself stood still for {stood_still_s:.0f} s, in which the thrusters went neutral"
        return Refusal(Reason.NAVIGATION, f"navigation: {held_up}; find what has held up this computer, then fly again")
    since = "yet" if silent_s is None else f"for {silent_s:.0f} s"
    return Refusal(
        Reason.NAVIGATION, f"navigation: no state of the vehicle {since}, so the thrusters are neutral; {SENSELESS}"
    )


def thrusters_disarmed(why: str) -> Refusal:
    """The thrusters were disarmed in flight; `why` by their state, empty where it has no reason."""
    because = without_state(why.removesuffix(STILL_ARMED), "disarmed") or "the thrusters give no reason"
    return Refusal(Reason.DISARMED, f"disarmed: {because}; arm and fly again")


def require_flyable(goal: Goal, vehicle: Vehicle, disabled: frozenset[str] = frozenset()) -> None:
    """Refuse a goal that this vehicle can never fly.

    Parameters
    ----------
    goal
        Motions, excitation, ending.
    vehicle
        With its thrusters and limits.
    disabled
        Names of thrusters that are out of use.

    Raises
    ------
    UsageError
        With the refusal: `GOAL`, `MOTION` or `LIFT`.
    """
    if goal.pulses:
        _check_pulses(goal, vehicle)
        return
    check_goal(goal)
    require_servable(goal.motions, vehicle, disabled)
    require_lift(vehicle)


def not_armed(why: str) -> Refusal:
    """Nothing can be done as long as the thrusters are not armed, and `why` they are not, if known."""
    sentence = f"the vehicle is not armed{f' ({why})' if why else ''}; `./hindrax arm` first"
    return Refusal(Reason.NOT_ARMED, sentence)


def unobeyed(why: str) -> Refusal:
    """The thrusters are armed and neutral, and `why` they follow no command."""
    sentence = f"the thrusters are armed, but {why}; disarm, find the cause (`./hindrax health`) and arm again"
    return Refusal(Reason.UNOBEYED, sentence)


def require_ready(
    *, flying: bool, armed: bool, unarmed: str, disobeying: str, guards: Sequence[Refusal], heading_known: bool
) -> None:
    """Refuse a maneuver that cannot begin now.

    Parameters
    ----------
    flying, armed, heading_known
        State of the vehicle.
    unarmed
        Why the thrusters are not armed.
    disobeying
        Why they are and follow no command; empty where they do.
    guards
        What they find, the first first.

    Raises
    ------
    HindraxError
        With the refusal: `BUSY`, `NOT_ARMED`, `UNOBEYED`, `HEADING`, or that of a guard.
    """
    if flying:
        raise HindraxError(BUSY)
    if not armed:
        raise HindraxError(not_armed(unarmed))
    if disobeying:
        raise HindraxError(unobeyed(disobeying))
    if guards:
        raise HindraxError(guards[0])
    if not heading_known:
        raise HindraxError(HEADING_UNKNOWN)


def _malformed(text: str) -> UsageError:
    return UsageError(Refusal(Reason.GOAL, f"goal: {text}"))


def check_goal(goal: Goal) -> None:
    """UsageError that names what is invalid in a goal."""
    if not goal.motions:
        raise _malformed(f"no motion, wanted some of {', '.join(AXES)}")
    if len(goal.motions) > MOST_MOTIONS:
        raise _malformed(f"{len(goal.motions)} motions, wanted at most {MOST_MOTIONS}; fly the rest after them")
    for motion in goal.motions:
        if motion not in AXES:
            raise _malformed(f"motion {motion!r} unknown, wanted one of {', '.join(AXES)}")
    if goal.excitation not in (PLATEAUS, *EXCITATIONS):
        raise _malformed(f"excitation {goal.excitation!r} unknown, wanted {PLATEAUS} or {', '.join(EXCITATIONS)}")
    if goal.on_cancel not in ENDINGS:
        raise _malformed(f"ending {goal.on_cancel!r} unknown, wanted {' or '.join(ENDINGS)}")
    _check_levels(goal)


def _check_pulses(goal: Goal, vehicle: Vehicle) -> None:
    if goal.motions:
        raise _malformed(f"pulses and {', '.join(goal.motions)}, wanted one or the other")
    if len(goal.pulses) > MOST_PULSES:
        raise _malformed(f"{len(goal.pulses)} pulses, wanted at most {MOST_PULSES}; fly the rest after them")
    for pulse in goal.pulses:
        if len(pulse.forces_N) != len(vehicle.thrusters):
            found, wanted = len(pulse.forces_N), len(vehicle.thrusters)
            raise _malformed(f"a pulse of {found} forces, wanted {wanted}, as {vehicle.name} has")
        if not all(abs(force_N) <= MOST_PULSE_N for force_N in pulse.forces_N):  # nor is NaN
            largest_N = max(pulse.forces_N, key=lambda one: math.inf if math.isnan(one) else abs(one))
            raise _malformed(f"a pulse of {largest_N:g} N, wanted at most {MOST_PULSE_N:g} N of each thruster")
        if not 0.0 < pulse.seconds <= LONGEST_PULSE_S:
            raise _malformed(f"a pulse of {pulse.seconds:g} s, wanted more than 0 and at most {LONGEST_PULSE_S:g} s")


def _check_levels(goal: Goal) -> None:
    if goal.levels and (len(goal.motions) > 1 or goal.excitation != PLATEAUS):
        found = f"{', '.join(goal.motions)} by {goal.excitation}"
        raise _malformed(f"levels of {found}, wanted the levels of one motion by {PLATEAUS}")
    if len(goal.levels) > MOST_LEVELS:
        raise _malformed(f"{len(goal.levels)} levels, wanted at most {MOST_LEVELS}; fly the rest after them")
    for level in goal.levels:
        if not 0.0 <= level <= 1.0:
            raise _malformed(f"level {level:g}, wanted 0 (the slowest plateau) to 1 (the fastest)")


@dataclass(frozen=True, slots=True)
class ServableMotions:
    """Motions that can be flown, in the order they were asked for, and those left out, each with its reason."""

    flown: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        """One line: what is flown, what not, and why."""
        flown = f"flies {', '.join(self.flown) or 'nothing'}"
        reasons = "; ".join(f"{motion}: {reason}" for motion, reason in self.left_out)
        return f"{flown}; does not fly {reasons}" if reasons else flown


def servable_motions(
    motions: Sequence[str], vehicle: Vehicle, disabled: frozenset[str] = frozenset()
) -> ServableMotions:
    """Split motions into those that the vehicle's enabled thrusters serve and those they do not.

    Parameters
    ----------
    motions
        Names of AXES.
    vehicle
        With its thrusters.
    disabled
        Names of thrusters that are out of use.

    Returns
    -------
    ServableMotions
        Both parts, the second with the reasons.
    """
    whole = effectiveness(vehicle)
    B = whole[:, [thruster.name not in disabled for thruster in vehicle.thrusters]]
    reasons = _reasons(B)
    # A motion that no thruster of the vehicle serves is not lost to the disabled ones.
    lost_for_good = _reasons(whole)
    out = f"without {', '.join(sorted(disabled))} "
    left_out = {
        motion: ("" if lost_for_good[motion] else out) + reasons[motion]
        for motion in dict.fromkeys(motions)
        if reasons[motion]
    }
    return ServableMotions(tuple(one for one in dict.fromkeys(motions) if one not in left_out), tuple(left_out.items()))


UNMEASURED = "nothing measures its velocity"


def _measured(motions: Sequence[str], vehicle: Vehicle) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Motions whose way is measured by the sensors of the vehicle file, and those of which none is.

    Rotations have the gyroscope and heave has the depth. Surge and sway have a DVL, or a sonar that looks at the wall
    ahead or aside. A file without any sensor says nothing: its state is given.
    """
    blind = bool(vehicle.sensors) and not vehicle.measuring("velocity")
    lost = tuple(motion for motion in motions if blind and motion in LOOKS and not vehicle.measuring(LOOKS[motion]))
    return tuple(motion for motion in motions if motion not in lost), lost


def flyable_motions(
    motions: Sequence[str], vehicle: Vehicle, disabled: frozenset[str] = frozenset()
) -> ServableMotions:
    """Split motions into those that thrusters serve and sensors measure, and the others.

    Parameters
    ----------
    motions
        Names of AXES.
    vehicle
        With its thrusters and sensors.
    disabled
        Names of thrusters that are out of use.

    Returns
    -------
    ServableMotions
        Both parts, the second with the reasons.
    """
    served = servable_motions(motions, vehicle, disabled)
    flown, lost = _measured(served.flown, vehicle)
    return ServableMotions(flown, (*served.left_out, *((motion, UNMEASURED) for motion in lost)))


def require_measured(motions: Sequence[str], vehicle: Vehicle, *, velocity_known: bool = False) -> None:
    """Refuse motions that no sensor measures.

    Parameters
    ----------
    motions
        Names of AXES.
    vehicle
        With its sensors.
    velocity_known
        Whether another node gives the velocity.

    Raises
    ------
    UsageError
        Names the first one.
    """
    if velocity_known:
        return
    _, lost = _measured(motions, vehicle)
    if lost:
        flown = flyable_motions(AXES, vehicle).flown
        others = f", or fly some of {', '.join(flown)}" if flown else ""
        looks = "ahead" if lost[0] == "surge" else "aside"
        wanted = f"a DVL, or a sonar that looks {looks}"
        sentence = (
            f"{lost[0]}: {UNMEASURED}, wanted {wanted}; add it to `sensors` in the vehicle file{others}. An odometry "
            "of yours that has velocities flies it too (docs/how-to/use-one-node.md); poses alone do not, they are "
            "identified after a flight by hand: `./hindrax identify BAG --odometry TOPIC`"
        )
        raise UsageError(Refusal(Reason.MOTION, sentence))


def require_servable(motions: Sequence[str], vehicle: Vehicle, disabled: frozenset[str] = frozenset()) -> None:
    """Refuse motions that thrusters do not serve.

    Parameters
    ----------
    motions
        Names of AXES.
    vehicle
        With its thrusters.
    disabled
        Names of thrusters that are out of use.

    Raises
    ------
    UsageError
        Names the first one, why, and what can be flown instead.
    """
    left_out = servable_motions(motions, vehicle, disabled).left_out
    if not left_out:
        return
    motion, reason = left_out[0]
    flown = servable_motions(AXES, vehicle, disabled).flown
    wanted = f"some of {', '.join(flown)}" if flown else "thrusters that do"
    with_all = servable_motions((motion,), vehicle).flown
    mend = "`./hindrax thruster enable` those that work" if with_all else "correct `thrusters` in the vehicle file"
    sentence = f"{motion}: {reason}, wanted {wanted}; {mend}{', or fly those' if flown else ''}"
    raise UsageError(Refusal(Reason.MOTION, sentence))


def largest_wrench(vehicle: Vehicle) -> dict[str, float]:
    """Largest force [N] or moment [N m] of each axis alone, the weaker direction; 0 where the axis is not served."""
    if not vehicle.thrusters:
        return dict.fromkeys(AXES, 0.0)
    B = effectiveness(vehicle)
    served = servable_motions(AXES, vehicle).flown
    ranges = [min(-curve.range_N[0], curve.range_N[1]) for curve in thrust_curves(vehicle)]
    alone = np.linalg.pinv(B)
    found = {}
    for axis, name in enumerate(AXES):
        shares = np.abs(alone[:, axis]) / np.array(ranges)
        found[name] = 1.0 / float(np.max(shares)) if name in served else 0.0
    return found


def require_lift(vehicle: Vehicle) -> None:
    """UsageError for a vehicle that its thrusters cannot hold at a depth."""
    net_N, reach_N = vehicle.net_buoyancy_N, largest_wrench(vehicle)["heave"]
    if abs(net_N) >= reach_N > 0.0:
        pull = "net buoyancy" if net_N > 0.0 else "net weight"
        sentence = (
            f"{vehicle.name}: found {abs(net_N):.0f} N of {pull}, wanted less than the {reach_N:.0f} N that its "
            "thrusters give in heave; trim it, or correct mass_kg and volume_m3 in the vehicle file"
        )
        raise UsageError(Refusal(Reason.LIFT, sentence))


def motions_to_fly(dof: Sequence[str], vehicle: Vehicle) -> ServableMotions:
    """Motions that `--dof` asks for: `all` flies what can be flown; UsageError when a named one cannot be."""
    wanted = AXES if "all" in dof else tuple(dof)
    found = flyable_motions(wanted, vehicle)
    if "all" not in dof or not found.flown:
        require_servable(wanted, vehicle)
        require_measured(wanted, vehicle)
    require_lift(vehicle)
    return found


def _reasons(B: Matrix) -> dict[str, str]:
    """For each axis, why thrusters with the effectiveness B (6, n) cannot fly it; empty when they can."""
    served = served_axes(B)
    return {name: _reason(B, axis, served) for axis, name in enumerate(AXES)}


def _reason(B: Matrix, axis: int, served: Sequence[int]) -> str:
    heave = AXES.index("heave")
    if axis in served:
        return "" if heave in served else "no thruster serves heave, which holds the depth meanwhile"
    row = B[axis]
    length = float(np.linalg.norm(row))
    if length == 0.0:
        return "no thruster serves it"
    shares, *_ = np.linalg.lstsq(B[list(served)].T, row, rcond=None)
    bound = [
        AXES[other]
        for share, other in zip(shares, served, strict=True)
        if abs(share) * float(np.linalg.norm(B[other])) >= SHARE * length
    ]
    return f"no thruster serves it independently of {' and '.join(bound)}"
