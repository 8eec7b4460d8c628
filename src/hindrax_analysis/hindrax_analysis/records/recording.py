"""Third-party records: velocities and forces with their times, and their events.

Such a record has no phases. Each axis is identified separately, with the whole record as its excitation; pauses divide
it into stretches. The session's verdict covers what the record cannot show.
"""

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hindrax_control.allocation.thrust_curve import AppliedWrench, pulses_of_channels
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import NAN, Attitude, IdentEvent, Phase, Supply, Thrust, Velocity, Way
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, Flags, array, rounding
from hindrax_ident.assess.objections import NO_OBJECTION, Code, Objection, objection
from hindrax_ident.model.motion_model import motions_of
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.online.record_session import SOURCE, finite_wrench
from hindrax_ident.records.turned_over import is_turned_over
from hindrax_ident.tuning import Tuning, for_foreign_records

FEWEST_VELOCITIES = 20
"""Fewest velocity samples of an axis."""
NO_TIMES, NO_WAYS, NO_FORCES = array(np.zeros(0)), array(np.zeros((0, 3))), array(np.zeros((0, 0)))
DERIVED = "odometry"
"""Source of velocities that were derived from places: those give the motion along their axes (`binning.NAVIGATORS`)."""

SLOWEST_S, FASTEST_S = 5.0, 1e-4
"""Median times between velocities, above and below which the times are probably not in seconds."""
LONGEST_PAUSE_S = 1000.0
"""A longer one tells no more, and may be a clock that was set while it ran."""
LOW_SHARE = 0.4
"""Largest 5th percentile, in the 95th, of a speed that comes to rest; one that never does may be that of a current."""
STEP_S, BEHIND_S = 0.4, 0.1
"""Time over which a change is taken, which averages its noise; and usual delay of a motion behind its command."""
PUSHED, LEAST_TIME = 0.2, 0.05
"""Least thrust in either direction, in the largest, and its least share of the time."""
GAINS = 0.6
"""Least sum of the gains under backward thrust, in that of the losses. Of 40 velocities of three vehicles it was 0 to
0.56, where noise is most of a change; of their sizes 0.63 to 2."""
FEWEST_STEPS, REGULAR, MOST_REGULAR = 50, 2.0, 0.9
"""Forces come regularly where so many steps, at least, are within this many of their median in this share of them."""
SHORTEST_HOLD_S = 0.5
"""For so long a force counts at least, however often they come."""
HALF_TURN = array(np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0]))
"""From forward, left, up to forward, starboard, down, and back."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One record: times [s] from its own origin, SNAME axes, SI; NaN where a row has no value of an axis.

    `velocity` is (n, 6) at `velocity_t` (n,), `wrench` (m, 6) at `wrench_t` (m,) and holds until its next row;
    `attitude` is (k, 3) at `attitude_t` (k,): roll, pitch, depth. `way` is (l, 3) at `way_t` (l,): distances covered
    forward, to starboard and down, which stand for the velocities of their axes. `forces` is (m, k): those of single
    thrusters along their directions in the vehicle file, where the wrench follows from them; else it has no rows.
    `supply`: how the voltage is known that they were computed with.
    `origin_s` is what the times count from.
    """

    source: str
    velocity_t: Array
    velocity: Array
    wrench_t: Array
    wrench: Array
    attitude_t: Array
    attitude: Array
    origin_s: float = 0.0
    assumptions: tuple[str, ...] = ()
    way_t: Array = field(default_factory=lambda: NO_TIMES)
    way: Array = field(default_factory=lambda: NO_WAYS)
    forces: Array = field(default_factory=lambda: NO_FORCES)
    supply: Supply = Supply.ASSUMED

    @property
    def measured_t(self) -> list[Array]:
        """Times (n,) [s] of what was measured, of each kind that has any."""
        return [t for t in (self.velocity_t, self.attitude_t, self.way_t) if len(t)]

    @property
    def duration_s(self) -> float:
        """From the first measurement to the last."""
        return max(0.0, self.end_s - self.begin_s)

    @property
    def begin_s(self) -> float:
        """Time of the first measurement."""
        return min((float(t[0]) for t in self.measured_t), default=0.0)

    @property
    def end_s(self) -> float:
        """Time of the last measurement."""
        return max((float(t[-1]) for t in self.measured_t), default=0.0)

    def between(self, start_s: float, end_s: float) -> "Recording":
        """Part of a record, with the force at its start; pauses in it last LONGEST_PAUSE_S at most."""
        v, a, p = ((t >= start_s) & (t <= end_s) for t in (self.velocity_t, self.attitude_t, self.way_t))
        first = max(0, int(np.searchsorted(self.wrench_t, start_s, side="right")) - 1)
        w = slice(first, int(np.searchsorted(self.wrench_t, end_s, side="right")))
        part = replace(
            self,
            velocity_t=self.velocity_t[v],
            velocity=self.velocity[v],
            wrench_t=np.maximum(self.wrench_t[w], start_s),
            wrench=self.wrench[w],
            attitude_t=self.attitude_t[a],
            attitude=self.attitude[a],
            way_t=self.way_t[p],
            way=self.way[p],
            forces=self.forces[w] if len(self.forces) else self.forces,
        )
        return _with_short_pauses(part)

    def half_turned(self) -> "Recording":
        """The same record rotated by half a turn about x: left and up for starboard and down."""
        velocity, wrench = array(self.velocity * HALF_TURN), array(self.wrench * HALF_TURN)
        attitude = array(self.attitude * np.array([1.0, -1.0, 1.0]))
        return replace(self, velocity=velocity, wrench=wrench, attitude=attitude, way=array(self.way * HALF_TURN[:3]))


def _with_short_pauses(recording: Recording) -> Recording:
    """The record with less time where nothing at all was recorded: what is computed per second stays small."""
    t = np.sort(np.concatenate([recording.velocity_t, recording.wrench_t, recording.attitude_t, recording.way_t]))
    pauses = np.flatnonzero(np.diff(t) > LONGEST_PAUSE_S)
    if not len(pauses):
        return recording
    left_out_s = np.append(0.0, np.cumsum(np.diff(t)[pauses] - LONGEST_PAUSE_S))

    def earlier(times: Array) -> Array:
        """Times (n,) [s] less what was left out before them."""
        return array(times - left_out_s[np.searchsorted(t[pauses + 1], times, side="right")])

    return replace(
        recording,
        velocity_t=earlier(recording.velocity_t),
        wrench_t=earlier(recording.wrench_t),
        attitude_t=earlier(recording.attitude_t),
        way_t=earlier(recording.way_t),
    )


def is_complete(recording: Recording) -> bool:
    """Whether a record holds both velocities (or depths, or ways) and forces, of whatever axes."""
    return bool(len(recording.wrench_t) and (len(recording.velocity_t) or _columns(recording)[14:].any()))


def are_parts(one: Recording, other: Recording) -> bool:
    """Whether two files are parts of one record: one is incomplete, no column is in both, and their times overlap."""
    if is_complete(one) and is_complete(other):
        return False
    (begin, end), (other_begin, other_end) = _times(one), _times(other)
    return not (_columns(one) & _columns(other)).any() and begin <= other_end and other_begin <= end


def _columns(recording: Recording) -> Flags:
    """Which columns have values, (18,): velocities, forces, angles and depth, ways."""
    tables = (recording.velocity, recording.wrench, recording.attitude, recording.way)
    found: Flags = np.concatenate([np.isfinite(table).any(axis=0) for table in tables])
    return found


def _times(recording: Recording) -> tuple[float, float]:
    """First and last time of any sample, from the origin of the stamps [s]."""
    times = [t for t in (recording.velocity_t, recording.wrench_t, recording.attitude_t, recording.way_t) if len(t)]
    return recording.origin_s + min(t[0] for t in times), recording.origin_s + max(t[-1] for t in times)


def joined(one: Recording, other: Recording) -> Recording:
    """One record of two parts with different columns; their stamps have the same origin."""
    origin = min(one.origin_s, other.origin_s)
    tables = []
    for name in ("velocity", "wrench", "attitude", "way"):
        t = np.concatenate([getattr(part, f"{name}_t") + (part.origin_s - origin) for part in (one, other)])
        order = np.argsort(t, kind="stable")
        tables.append((array(t[order]), array(np.concatenate([getattr(one, name), getattr(other, name)])[order])))
    note = f"{one.source} and {other.source} count time from one origin"
    assumptions = tuple(dict.fromkeys((*one.assumptions, *other.assumptions, note)))
    # Of wrenches in both parts, each on other axes, none has all forces.
    forces = NO_FORCES if len(one.wrench) and len(other.wrench) else one.forces if len(one.wrench) else other.forces
    supply = min((part.supply for part in (one, other) if len(part.wrench)), default=Supply.ASSUMED)
    return Recording(one.source, *tables[0], *tables[1], *tables[2], origin, assumptions, *tables[3], forces, supply)


def forces_of_pulses(
    source: str, channels: Sequence[Sequence[float]], supplies_V: Sequence[float], vehicle: Vehicle
) -> Array:
    """Forces that pulses give by the thrust curves, without the lag of the thrusters.

    Parameters
    ----------
    source
        Name of the record, for the error.
    channels : (n, c) [us]
        Pulses of all output channels.
    supplies_V : (n,) [V]
        Supply voltage of each row.
    vehicle
        Thrusters and curves.

    Returns
    -------
    Array
        (n, k) [N] along the directions of the thrusters.

    Raises
    ------
    UsageError
        For pulses that cannot be those of the vehicle.
    """
    applied = functools.cache(lambda supply_V: AppliedWrench(vehicle, supply_V))
    try:
        pulses = [pulses_of_channels(vehicle, row) for row in channels]
    except ValueError as error:
        raise UsageError(f"{source}: {error}") from error
    pairs = zip(pulses, map(applied, supplies_V), strict=True)
    return np.array([at_supply.forces_N(row) for row, at_supply in pairs])


def wrenches_of_forces(forces: Array, vehicle: Vehicle) -> Array:
    """Wrenches (n, 6) [N, N m] about the center of mass, SNAME axes, of forces (n, k) [N] of the thrusters."""
    wrench = AppliedWrench(vehicle).wrench
    return np.array([wrench(row) for row in forces.tolist()])


# ---- usable axes


def reason_to_skip(recording: Recording, axis: int) -> Objection:
    """Return why an axis cannot be identified; nothing where it may be."""
    return next(_reasons_to_skip(recording, axis), NO_OBJECTION)


def _reasons_to_skip(recording: Recording, axis: int) -> Iterator[Objection]:
    """All reasons; each assumes that the previous ones do not apply."""
    speeds, forces = _speeds(recording, axis), _finite(recording.wrench[:, axis])
    step_s = _period(recording.velocity_t)
    if step_s > SLOWEST_S:
        yield objection(Code.SLOW_VELOCITIES, step_s=step_s)
    if 0.0 < step_s < FASTEST_S:
        yield objection(Code.FAST_VELOCITIES, step_s=step_s)
    if len(speeds) < FEWEST_VELOCITIES:
        yield objection(Code.FEW_VELOCITIES, found=len(speeds), axis=AXES[axis], wanted=FEWEST_VELOCITIES)
    if not len(forces):
        yield objection(Code.NO_THRUST, kind="moment" if axis >= 3 else "force", axis=AXES[axis])
        return
    late_s = float(recording.wrench_t[0]) - recording.end_s
    if late_s > 0.0:
        yield objection(Code.LATE_THRUST, late_s=late_s)
    if float(np.ptp(forces)) <= rounding(recording.wrench, axis):
        yield objection(Code.CONSTANT_THRUST, axis=AXES[axis], where=_axes_that_change(recording.wrench))
    if float(np.ptp(speeds)) <= rounding(recording.velocity, axis):
        yield objection(Code.CONSTANT_VELOCITY, axis=AXES[axis], where=_axes_that_change(recording.velocity))
    if _is_unsigned(recording, axis):
        yield objection(Code.UNSIGNED_VELOCITY, axis=AXES[axis])


def _is_unsigned(recording: Recording, axis: int) -> bool:
    """Whether a velocity is the size of one: it bounces at zero, and gains while the thrust pushes backward.

    Under thrust one way alone a size is a velocity.
    """
    moved, commanded = np.isfinite(recording.velocity[:, axis]), np.isfinite(recording.wrench[:, axis])
    t, v = recording.velocity_t[moved], recording.velocity[moved, axis]
    low, high = np.quantile(v, (0.05, 0.95)) if len(v) else (0.0, 0.0)
    if v.min(initial=0.0) < 0.0 or low > LOW_SHARE * high or not high:
        return False
    force = recording.wrench[commanded, axis]
    lagged = LaggedThrust(recording.wrench_t[commanded], force, BEHIND_S).force(t)
    most = float(np.abs(force).max())
    count = max(1, round(STEP_S / max(1e-9, float(np.median(np.diff(t))))))
    whole = len(v) - len(v) % count
    speed, push = (one[:whole].reshape(-1, count).mean(axis=1) for one in (v, lagged))
    change, pushed = np.diff(speed), 0.5 * (push[1:] + push[:-1])
    back, ahead = pushed < -PUSHED * most, pushed > PUSHED * most
    if not len(change) or min(back.mean(), ahead.mean()) < LEAST_TIME:
        return False
    gains, losses = (float(np.maximum(0.0, sign * change[back]).sum()) for sign in (1.0, -1.0))
    return gains > GAINS * losses


def _axes_that_change(table: Array) -> str:
    """Note that names the axes with changes; empty without any."""
    columns = {name: (_finite(table[:, axis]), rounding(table, axis)) for axis, name in enumerate(AXES)}
    changing = [name for name, (known, least) in columns.items() if len(known) and np.ptp(known) > least]
    return f" (on {' and '.join(changing)} it does)" if changing else ""


def has_signal(recording: Recording, axis: int) -> bool:
    """Whether an axis has both velocities and forces that are more than rounding."""
    speeds, forces = _speeds(recording, axis), _finite(recording.wrench[:, axis])
    return bool(
        np.any(np.abs(speeds) > rounding(recording.velocity, axis))
        and np.any(np.abs(forces) > rounding(recording.wrench, axis))
    )


def has_samples(recording: Recording, axis: int) -> bool:
    """Whether an axis has both velocities and forces, even if all are zero."""
    return bool(len(_speeds(recording, axis)) and len(_finite(recording.wrench[:, axis])))


def _speeds(recording: Recording, axis: int) -> Array:
    """Finite velocities of an axis, (n,) [m/s, rad/s]; without any, ways along it or in heave depths [m]."""
    speeds = _finite(recording.velocity[:, axis])
    if not len(speeds) and axis < 3:
        speeds = _finite(recording.way[:, axis])
    return speeds if len(speeds) or axis != 2 else _finite(recording.attitude[:, 2])


def _finite(values: Array) -> Array:
    """Finite values: (n,), in their unit."""
    return array(values[np.isfinite(values)])


def tuned(recordings: Sequence[Recording], tuning: Tuning | None = None) -> Tuning:
    """Knobs for the rates and stamps of third-party records: a slow topic is not a pause."""
    base = for_foreign_records(tuning or Tuning())
    slowest_v = max((max(_period(one.velocity_t), _period(one.way_t)) for one in recordings), default=0.0)
    gap_s = min(60.0, max(base.gap_s, 5.0 * slowest_v))
    holds_s = [longest_hold_s(one.wrench_t, base.thrust_age_s) for one in recordings]
    return replace(base, gap_s=gap_s, thrust_age_s=max(holds_s, default=base.thrust_age_s))


def longest_hold_s(t: Array, usual_s: float) -> float:
    """Age up to which a force counts.

    What comes regularly and pauses was lost, or its publisher ended: nobody knows what the thrusters did. What comes at
    changes alone holds until the next.

    Parameters
    ----------
    t : (n,) [s]
        Times of the forces.
    usual_s : [s]
        Of a stream that says nothing of itself.

    Returns
    -------
    float
        Longest age [s].
    """
    steps, period_s = np.diff(t), _period(t)
    if len(steps) < FEWEST_STEPS or np.mean(steps <= REGULAR * period_s) < MOST_REGULAR:
        return max(usual_s, 3.0 * period_s)
    return max(min(usual_s, SHORTEST_HOLD_S), 5.0 * period_s)


def _period(t: Array) -> float:
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else 0.0


# ---- as events


def events(recording: Recording, axis: int, begin_s: float = 0.0) -> Iterator[Stamped[IdentEvent]]:
    """Events of one axis in the order of time, as the session gets them on the vehicle; the last one ends the motion.

    Parameters
    ----------
    recording
        Velocities, wrenches and attitudes of one record.
    axis
        Index, 0 to 5: rows whose wrench along it is not known are left out, and its motion while its model does not
        hold (`turned_over`).
    begin_s : [s]
        Time of the record's origin among the events.

    Yields
    ------
    Stamped[IdentEvent]
        At equal times the thrust, the phase, the attitude, and then the velocity, which only now can be judged.
    """
    motion = motions_of(axis)[0].name
    parts: list[tuple[float, int, IdentEvent]] = [(recording.begin_s, 1, Phase(motion, "excite"))]
    forces = recording.forces if len(recording.forces) else np.zeros((len(recording.wrench), 0))
    thrusts = zip(recording.wrench_t.tolist(), recording.wrench.tolist(), forces.tolist(), strict=True)
    parts += [
        (t, 0, Thrust(finite_wrench(one), tuple(each), recording.supply))
        for t, one, each in thrusts
        if math.isfinite(one[axis])
    ]
    known = np.isfinite(recording.velocity).any(axis=1)
    holds, tilt_holds, way_holds = (
        ~is_turned_over(axis, recording.attitude_t, recording.attitude, t)
        for t in (recording.velocity_t, recording.attitude_t, recording.way_t)
    )
    velocity = recording.velocity.copy()
    velocity[~holds, axis] = np.nan
    rows = zip(recording.velocity_t[known].tolist(), velocity[known].tolist(), strict=True)
    ways = recording.way[:, axis] if axis < 3 else NO_TIMES
    placed = bool(np.isfinite(ways).any())
    # Of all axes: motion along the others causes forces on this one.
    source = DERIVED if placed else SOURCE
    parts += [(t, 3, Velocity((u, v, w, p, q, r), source)) for t, (u, v, w, p, q, r) in rows]
    if placed:
        there = zip(recording.way_t[way_holds].tolist(), recording.way[way_holds].tolist(), strict=True)
        parts += [(t, 2, Way((x, y, z), SOURCE)) for t, (x, y, z) in there]
    measured = placed or bool(np.isfinite(recording.velocity[:, axis]).any())
    attitude = recording.attitude.copy()
    if axis == 3:  # the integral of a rate goes on beyond half a turn
        turned = np.isfinite(attitude[:, 0])
        attitude[turned, 0] = np.unwrap(attitude[turned, 0])
    tilts = zip(recording.attitude_t[tilt_holds].tolist(), attitude[tilt_holds].tolist(), strict=True)
    for t, (roll, pitch, depth) in tilts:
        if axis == 2 and not measured and math.isfinite(depth):
            parts.append((t, 2, Attitude((NAN, NAN, NAN), depth)))
        elif axis not in (2, 5) and (math.isfinite(roll) or math.isfinite(pitch)):
            parts.append((t, 2, Attitude((roll, pitch, NAN))))
    parts.sort(key=lambda part: part[:2])
    yield from (Stamped(stamp_from_s(begin_s + t), event) for t, _, event in parts)
    yield Stamped(stamp_from_s(begin_s + parts[-1][0] + 1e-3), Phase("", ""))
