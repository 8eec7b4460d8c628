"""Times in which something holds the vehicle: the surface, a wall, a taut tether, a hand, or thrusters that are off.

In water there is no static friction: a vehicle at rest gives way to any force. One that stays at rest under a thrust
that moved it at other times is held by a force that no coefficient explains. A fit takes it for drag: 40 s with the
thrusters off, in 160, made the drag of a vehicle 1.9 times its own. Those times are left out, and told.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hindrax_analysis.records.recording import Recording
from hindrax_core.text.digits import stretches_told
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, Flags, array, stretches_of
from hindrax_ident.model.thrust_lag import LaggedThrust

HEAVE = 2
FEWEST_DEPTHS = 11
SURFACE_m, CONTACT_m, CONTACT_NOISES = 0.5, 0.02, 4.0
"""Largest depth of a vehicle that floats, by its sensor, which may count from elsewhere on the hull; and how far it
bobs [m], or by how many deviations of the depth's noise."""
CONTACT_S, CONTACT_PUSH = 1.0, 0.05
"""Least time of a contact, and least mean thrust against it over about as long, in the largest."""

FREE_AXES = (0, 1, 2, 5)
"""Axes that nothing brings back: roll and pitch rest under a thrust that their restoring moment carries."""
STEP_S, FEWEST_STEPS = 0.1, 50
"""Steps of the means, at least two velocities long, and the fewest of a record."""
LEAST_WINDOW_S, GATHERS = 0.5, 2.5
"""Window: its least length, and times in which the fastest change of speed would end the rest."""
AT_REST, NOISES, MOVES = 0.1, 4.0, 0.3
"""Speed below which it is at rest, in its largest or in deviations of its noise; speed from which it moves, in its
largest."""
SLOWS = 0.02
"""Loss of speed over a window, in the largest, up to which the thrust still carries it."""
LATEST_S = 1.0
"""Largest delay of a velocity behind its thrust: by the lag of the thrusters, and its stamps."""
FEWEST_WINDOWS, LEAST_CARRY = 2.0, 0.1
"""Times that it moves by, in windows; and the share of them with less thrust than what is taken for the least that
moves it: those of a wave, or a push."""
TURNS = 0.1
"""Acceleration omega x v, in the fastest change of speed, up to which an axis moves or rests by forces of its own. What
circles has a thrust to its side and no speed there, or the reverse."""
MARGIN = 0.05
"""What the thrust at rest is above one that moved it, in the largest."""
AROUND_S = 5.0
"""Rest before and after, which belongs to it: what holds it does so under any thrust."""
SLOWING_S = 10.0
"""Longest time in which it comes to rest, once held or without thrust."""


@dataclass(frozen=True, slots=True)
class _Steps:
    """Means over each step [s] from `t` on, of one axis, (n,) each; NaN without a velocity.

    `turning`: change of its velocity because the body turns, without any force, (omega x v)_axis [m/s^2]; 0 of yaw.
    """

    step_s: float
    t: Array
    velocity: Array
    thrust: Array
    turning: Array
    noise: float


def without_contact(recording: Recording) -> Recording:
    """The record without the axes that something held while it did; what was left out is told.

    Parameters
    ----------
    recording
        Of free motion, but for some of its time.

    Returns
    -------
    Recording
        The same one where nothing was held.
    """
    found = _without_surface(recording)
    for axis in FREE_AXES:
        found = _without_hold(found, axis)
    return found


def _without_surface(recording: Recording) -> Recording:
    """The record without heave while the vehicle is pressed against the surface, which carries what no row knows.

    There the depth stays at its least, near zero, though the thrust pushes up.
    """
    known = np.flatnonzero(np.isfinite(recording.attitude[:, 2]))
    t, depth = recording.attitude_t[known], recording.attitude[known, 2]
    commanded = np.isfinite(recording.wrench[:, HEAVE])
    if len(t) < FEWEST_DEPTHS or not commanded.any():
        return recording
    least = float(np.quantile(depth, 0.01))
    noise = float(np.std(np.diff(depth, n=2))) / math.sqrt(6.0)
    within = max(CONTACT_NOISES * noise, CONTACT_m)
    force = recording.wrench[commanded, HEAVE]
    up = LaggedThrust(recording.wrench_t[commanded], force, CONTACT_S).force(t) < -CONTACT_PUSH * np.abs(force).max()
    touching = (np.abs(depth - least) <= within) & up & (abs(least) < SURFACE_m)
    spans = [(float(t[one.start]), float(t[one.stop - 1])) for one in stretches_of(touching)]
    spans = [(begin_s, end_s) for begin_s, end_s in spans if end_s - begin_s >= CONTACT_S]
    return _left_out(recording, HEAVE, spans, "at the surface, while the thrust pushes up, are no free motion")


def _without_hold(recording: Recording, axis: int) -> Recording:
    """The record without an axis while it rests under a thrust that moved it at other times."""
    steps = _steps(recording, axis)
    spans = _held(steps) if steps is not None else []
    return _left_out(
        recording, axis, spans, "at rest under a thrust that moved it at other times: held, or thrusters off"
    )


def _left_out(recording: Recording, axis: int, spans: list[tuple[float, float]], what: str) -> Recording:
    """The record without what one axis did from the first to the last time of each span, told by `what`."""
    if not spans:
        return recording
    velocity, attitude, way = recording.velocity.copy(), recording.attitude.copy(), recording.way.copy()
    for begin_s, end_s in spans:
        velocity[_inside(recording.velocity_t, begin_s, end_s), axis] = np.nan
        if axis < 3:
            way[_inside(recording.way_t, begin_s, end_s), axis] = np.nan
        if axis == HEAVE:
            attitude[_inside(recording.attitude_t, begin_s, end_s), 2] = np.nan
    lasts_s = sum(end_s - begin_s for begin_s, end_s in spans)
    note = f"{AXES[axis]}: {lasts_s:.3g} s {what}: left out ({stretches_told([begin_s for begin_s, _ in spans])})"
    assumptions = (*recording.assumptions, note)
    return replace(recording, velocity=velocity, attitude=attitude, way=way, assumptions=assumptions)


def _inside(t: Array, begin_s: float, end_s: float) -> Flags:
    found: Flags = (t >= begin_s) & (t <= end_s)
    return found


def _steps(recording: Recording, axis: int) -> _Steps | None:
    """Velocity, else the slope of the depth or the way, and thrust on a grid; None where there is too little."""
    commanded = np.isfinite(recording.wrench[:, axis])
    t, v = _moved(recording, axis)
    if not commanded.any() or len(t) < FEWEST_STEPS:
        return None
    step_s = max(STEP_S, 2.0 * float(np.median(np.diff(t))))
    at = np.floor((t - t[0]) / step_s).astype(np.int64)
    # One step without a velocity ends what comes before a pause, however long that is.
    places = np.unique(np.concatenate([at, at + 1]))
    if len(places) < FEWEST_STEPS:
        return None
    into = np.searchsorted(places, at)
    many = np.bincount(into, minlength=len(places))
    mean = np.full(len(places), np.nan)
    np.divide(np.bincount(into, v, len(places)), many, out=mean, where=many > 0)
    begins = array(t[0] + step_s * places)
    thrust = LaggedThrust(recording.wrench_t[commanded], recording.wrench[commanded, axis], 0.0)
    impulse = thrust.impulse(begins + step_s) - thrust.impulse(begins)
    noise = float(np.nanmedian(np.abs(np.diff(mean, n=2)))) / 0.6745 / math.sqrt(6.0)
    return _Steps(step_s, begins, mean, array(impulse / step_s), _turning(recording, axis, begins), noise)


def _turning(recording: Recording, axis: int, t: Array) -> Array:
    """(omega x v)_axis at times (n,) [m/s^2], of the velocities that the record has; zeros of an axis of rotation."""
    if axis > HEAVE:
        return array(np.zeros(len(t)))
    nu = np.zeros((len(t), 6))
    for one, column in enumerate(recording.velocity.T):
        known = np.isfinite(column)
        if known.any():
            nu[:, one] = np.interp(t, recording.velocity_t[known], column[known])
    return array(np.cross(nu[:, 3:], nu[:, :3])[:, axis])


def _moved(recording: Recording, axis: int) -> tuple[Array, Array]:
    """Times and velocities of an axis, (n,) each [s], [m/s, rad/s]."""
    measured = np.isfinite(recording.velocity[:, axis])
    if measured.sum() >= FEWEST_STEPS or axis > HEAVE:
        return recording.velocity_t[measured], recording.velocity[measured, axis]
    t, x = recording.way_t, recording.way[:, axis]
    if axis == HEAVE and not np.isfinite(x).any():
        t, x = recording.attitude_t, recording.attitude[:, 2]
    known = np.isfinite(x)
    t, x = t[known], x[known]
    every = max(1, round(STEP_S / max(1e-9, float(np.median(np.diff(t)))))) if len(t) > 1 else 1
    t, x = t[::every], x[::every]
    forward = np.diff(t) > 0.0
    return t[1:][forward], array(np.diff(x)[forward] / np.diff(t)[forward])


def _held(steps: _Steps) -> list[tuple[float, float]]:
    """First and last times of the spans at rest under a thrust that moved the axis at other times.

    Over a window the impulse of the thrust, less that of a constant force and of the drag, is a change of speed. One in
    which the axis moves and does not slow down shows a thrust larger than the constant force and the drag. The same
    thrust, or a larger one, cannot leave it at rest for as long.
    """
    v, size = steps.velocity, float(np.nanquantile(np.abs(steps.velocity), 0.95))
    rest = max(AT_REST * size, NOISES * steps.noise)
    if not 0.0 < rest < MOVES * size:
        return []
    per_s = max(1, round(1.0 / steps.step_s))
    gathers = float(np.nanquantile(np.abs(v[per_s:] - v[:-per_s]), 0.95))
    long = max(2, math.ceil((LEAST_WINDOW_S + GATHERS * rest / max(gathers, 1e-9)) / steps.step_s))
    if len(v) < 4 * long:
        return []
    windows = np.lib.stride_tricks.sliding_window_view(v, long)
    over_window = np.full(long, 1.0 / long)
    thrust = np.convolve(steps.thrust, over_window, "valid")
    # Whatever the delay of the velocity behind the thrust is, up to the usual ones.
    late = 1 + math.ceil(LATEST_S / steps.step_s)
    earlier = np.lib.stride_tricks.sliding_window_view(np.pad(thrust, (late, 0), mode="edge"), late + 1)
    by_itself = np.convolve(np.abs(steps.turning), over_window, "valid") <= TURNS * gathers
    still = (np.abs(windows) <= rest).all(axis=1) & by_itself
    margin = MARGIN * float(np.abs(steps.thrust).max())
    held = np.zeros(len(v), dtype=bool)
    for sign in (1.0, -1.0):
        moves = (sign * windows >= MOVES * size).all(axis=1) & by_itself
        keeps = sign * (windows[:, -1] - windows[:, 0]) >= -SLOWS * size
        carries = (sign * earlier[moves & keeps]).max(axis=1, initial=-np.inf)
        if len(carries) <= FEWEST_WINDOWS * long:
            continue
        least = float(np.quantile(carries, LEAST_CARRY)) + margin
        contradicts = still & ((sign * earlier).min(axis=1) >= least)
        for one in stretches_of(contradicts):
            held[one.start : one.stop + long - 1] = True
    return _spans(steps, _with_rest(held, np.abs(v) <= rest, round(AROUND_S / steps.step_s)), long)


def _with_rest(held: Flags, at_rest: Flags, most: int) -> Flags:
    """Steps that are held, (n,), with those at rest around them, up to so many on either side."""
    out = held.copy()
    for one in stretches_of(at_rest):
        for part in stretches_of(held[one]):
            out[one][max(0, part.start - most) : part.stop + most] = True
    return out


def _spans(steps: _Steps, held: Flags, long: int) -> list[tuple[float, float]]:
    """Times of what is held, from where the axis began to slow down: what stopped it, or its coast without thrust."""
    means = np.convolve(np.nan_to_num(np.abs(steps.velocity)), np.full(long, 1.0 / long), "valid")
    out = []
    for one in stretches_of(held):
        first, earliest = one.start, max(long, one.start - round(SLOWING_S / steps.step_s))
        while first > earliest and means[first - long] > means[first]:
            first -= 1
        out.append((float(steps.t[first]), float(steps.t[one.stop - 1] + steps.step_s)))
    return out
