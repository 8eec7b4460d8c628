"""Damage in third-party records: what a sensor without lock, a frozen one or a buffered link leaves, removed and noted.

A least-squares fit trusts every sample. Exact zeros of a DVL without bottom lock under thrust, values that repeat
for seconds, flat tops of a saturated sensor and outliers are no measurements. They are left out before the fit, and
each kind is an assumption of the record, with its number and place.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hindrax_analysis.records.contact import without_contact
from hindrax_analysis.records.interpolated import measured_rows
from hindrax_analysis.records.recording import Recording, longest_hold_s
from hindrax_core.text.digits import stretches_told
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, Flags, Index, array, stretches_of
from hindrax_ident.records.axis_record import longest_ages_s
from hindrax_ident.tuning import Tuning

SHORTEST_STUCK_S, FEWEST_EQUAL = 0.5, 5
"""Least time and number of equal values of a stretch."""
FEWEST_REPEATS = 3
"""Least number of places or depths that repeat the one before."""
CHANCE_OF_EQUAL = 1e-6
"""Probability below which equal values in a row are no coincidence of a coarse resolution."""
JUMP = 0.2
"""Least step at an end of a stretch of zeros, and least thrust during one, relative to the largest of the record."""
FEWEST_DIGITS = 2.5
"""Least step at an end of a stretch of zeros, in the resolution of the record: at rest its last digit changes."""
HALF_WINDOW = 3
OUTLIER_SIGMAS, OUTLIER_SPAN = 6.0, 0.25
"""Least distance of an outlier from the running median: deviations of the noise, and share of the span of 90 %."""
STEEP, ABRUPT, STEPS_BESIDE = 3.0, 0.5, 6
"""Least step to and from outliers: in the usual step of the samples on either side, so many of them, and in the least
distance of an outlier. A vehicle that swings reaches its peak by steps like those before and after it."""
MOST_OUTLIERS, MOST_ALONE, MOST_BESIDE = 0.05, 0.2, 0.4
"""Share of outliers above which they are the signal; of those that stand alone, as no motion does; and the share with
another next to it up to which they do."""
SHORT_STEP, MOST_SHORT = 0.2, 0.4
"""A step below this share of the mean is one within a burst; share of such steps that makes a record one of bursts."""
PAUSE_S = 5.0
"""A longer step is no time between two bursts."""
APART, FEWEST_OTHERS = 3.0, 10
"""Distance of a number that stands for "no value" from all others, in spans of these, and their least number."""
MIXED = 4.0
"""Step from one velocity to the next, in steps to the one after the next, above which their lines are mixed."""
GAP_STEPS, GAP_S = 5.0, 1.0
"""Steps (of the median) and time without any velocity that are a gap."""


def without_damage(recording: Recording) -> Recording:
    """The record without what is no measurement; what was found is added to its assumptions."""
    mixed = _mixed(recording)
    spread, told = (recording, []) if mixed else _with_even_times(recording)
    notes = [*mixed, *told]
    velocity = spread.velocity.copy()
    # Forces that hold at the times of the velocities; NaN before the first.
    at = np.searchsorted(spread.wrench_t, spread.velocity_t, side="right")
    thrust = np.vstack([np.full((1, 6), np.nan), spread.wrench])[at]
    for axis, name in enumerate(AXES):
        for value, absent in _absent(velocity[:, axis]):
            velocity[absent, axis] = np.nan
            notes.append(f"{name}: {absent.sum()} velocities of exactly {value:g}, far from all others, stand for none")
        known = np.flatnonzero(np.isfinite(velocity[:, axis]))
        t, v = spread.velocity_t[known], velocity[known, axis]
        # One that was never measured is reported where it is asked for.
        if len(known) <= 2 * FEWEST_EQUAL or np.ptp(v) == 0.0:
            continue
        measured = measured_rows(t, v)
        if measured is not None:
            velocity[known[~measured], axis] = np.nan
            notes.append(f"{name}: velocities lie on lines between {measured.sum()} of {len(v)}: these alone are used")
            known, t, v = known[measured], t[measured], v[measured]
        for what, damaged in _damage(t, v, thrust[known, axis]):
            gone = known[damaged]
            velocity[gone, axis] = np.nan
            if axis < 3:  # without lock a DVL has no velocity at all
                rows = velocity[gone, :3]
                velocity[gone, :3] = np.where((rows == 0.0) & (v[damaged] == 0.0)[:, None], np.nan, velocity[gone, :3])
            notes.append(f"{name}: {damaged.sum()} {'velocity' if damaged.sum() == 1 else 'velocities'} {what}")
    whole = replace(
        spread, velocity=array(velocity), assumptions=(*recording.assumptions, *notes, *_gaps(spread), *_pauses(spread))
    )
    kept = _without_repeated(whole)
    return kept if mixed else without_contact(kept)


def _without_repeated(recording: Recording) -> Recording:
    """The record without places and depths that repeat to the last digit, or lie on lines, between measurements."""
    t, way = recording.way_t, recording.way
    notes = []
    if unseen := _repeated(way):
        gone = _samples(unseen, len(t))
        who = "a tracker that does not see the vehicle, or looks less often"
        notes.append(f"{gone.sum()} places repeat the one before, as of {who}: {_left(unseen, t)}")
        recording = replace(recording, way_t=array(t[~gone]), way=array(way[~gone]))
    attitude = recording.attitude.copy()
    known = np.flatnonzero(np.isfinite(attitude[:, 2]))
    measured = measured_rows(recording.attitude_t[known], array(attitude[known, 2]))
    if measured is not None:
        attitude[known[~measured], 2] = np.nan
        notes.append(f"depths lie on lines between {measured.sum()} of {len(known)}: these alone are used")
        known = known[measured]
    if hung := _repeated(array(attitude[known, 2:])):
        lost = known[_samples(hung, len(known))]
        attitude[lost, 2] = np.nan
        who = "a sensor that hangs, or measures less often"
        notes.append(
            f"{len(lost)} depths repeat the one before, as of {who}: {_left(hung, recording.attitude_t[known])}"
        )
    if notes:
        recording = replace(recording, attitude=array(attitude))
    return replace(recording, assumptions=(*recording.assumptions, *notes)) if notes else recording


def _repeated(values: Array) -> list[slice]:
    """Rows of (n, k) that repeat those before, where these break off or go on with a leap."""
    steps = np.linalg.norm(np.nan_to_num(np.diff(values, axis=0)), axis=1)
    if len(steps) < 2 * FEWEST_EQUAL or not steps.any():
        return []
    repeats = stretches_of(steps == 0.0)
    least = max(FEWEST_REPEATS, _repeats_by_chance(steps, repeats))
    long = (one for one in repeats if one.stop - one.start >= least)
    return [slice(one.start + 1, one.stop + 1) for one in long if _leaps(steps, one) or _breaks_off(steps, one)]


def _repeats_by_chance(steps: Array, repeats: Sequence[slice]) -> float:
    """Number of steps of zero in a row that the resolution of the record explains, by its short stretches of them."""
    sizes = [one.stop - one.start for one in repeats]
    short = sum(size for size in sizes if size < FEWEST_EQUAL)
    share = short / max(1, int(np.count_nonzero(steps)) + short)
    return _in_a_row(min(share, 0.9))


def _in_a_row(share: float) -> float:
    """Number of equal values in a row that are no coincidence, where this share is equal to the one before."""
    return math.log(CHANCE_OF_EQUAL) / math.log(max(share, 1e-3))


def _leaps(steps: Array, stretch: slice) -> bool:
    """Whether steps (n,) of zero end with one over all that was not seen, larger than those before and after."""
    sides = steps[max(0, stretch.start - STEPS_BESIDE) : stretch.start], steps[stretch.stop + 1 :][:STEPS_BESIDE]
    usual = max((float(np.median(one)) for one in sides if len(one)), default=0.0)
    return usual > 0.0 and stretch.stop < len(steps) and bool(steps[stretch.stop] > STEEP * usual)


def _breaks_off(steps: Array, stretch: slice) -> bool:
    """Whether steps (n,) end at once and begin at once: a vehicle comes to rest by ever smaller ones.

    The record may end meanwhile; one that begins so may be of a vehicle at rest.
    """
    least = STEEP * float(steps[steps > 0.0].min())
    before = stretch.start > 0 and steps[stretch.start - 1] > least
    return bool(before and (stretch.stop == len(steps) or steps[stretch.stop] > least))


def _absent(v: Array) -> Iterator[tuple[float, Flags]]:
    """Each number that stands for "no value", such as -32.768 of a Doppler log without lock, and its samples (n,).

    A vehicle reaches a velocity through those between. What recurs to the last digit and is far from all others was
    never reached.
    """
    left = np.isfinite(v)
    while left.any():
        values, counts = np.unique(v[left], return_counts=True)
        if len(values) <= FEWEST_OTHERS:
            return
        low, high = values[1] - values[0], values[-1] - values[-2]
        end, others = (0, values[1:]) if low > high else (-1, values[:-1])
        if counts[end] < 2 or max(low, high) <= APART * float(np.ptp(others)):
            return
        found = v == values[end]
        yield float(values[end]), found
        left &= ~found


def _damage(t: Array, v: Array, force: Array) -> list[tuple[str, Flags]]:
    """Each kind of damage, and its samples (n,) of velocities (n,) under forces (n,)."""
    stretches = list(_equal_values(t, v))
    size, most = float(np.quantile(np.abs(v), 0.95)), float(np.nanmax(np.abs(force), initial=0.0))
    found: list[tuple[str, Flags]] = []
    holding_N = float(np.nanmedian(force)) if np.isfinite(force).any() else 0.0
    jump = max(JUMP * size, FEWEST_DIGITS * _resolution(v))
    zeros = [one for one in stretches if v[one.start] == 0.0 and _is_lost(one, v, force - holding_N, jump, most)]
    if zeros:
        where = _left(zeros, t)
        found.append((f"of exactly 0 in motion are of a sensor without lock: {where}", _samples(zeros, len(v))))
    coincidence = _longest_by_chance(v)
    held = [one for one in stretches if v[one.start] != 0.0 and one.stop - one.start > coincidence]
    for extreme in (float(v.min()), float(v.max())):
        tops = [one for one in held if v[one.start] == extreme]
        if len(tops) > 1:
            found.append((f"of exactly {extreme:g}, where it is saturated: {_left(tops, t)}", v == extreme))
            held = [one for one in held if v[one.start] != extreme]
    if held:
        where = _left(held, t)
        found.append((f"that repeat the one before are of a frozen sensor: {where}", _samples(held, len(v))))
    kept = np.flatnonzero(~np.any([np.zeros(len(v), dtype=bool), *(gone for _, gone in found)], axis=0))
    wild = kept[_outliers(v[kept])]
    if len(wild):
        found.append(("far from all neighbors: left out", np.isin(np.arange(len(v)), wild)))
    return found


def _left(stretches: list[slice], t: Array) -> str:
    """Treatment of the stretches, and their times, in order."""
    return f"left out ({stretches_told([float(t[one.start]) for one in stretches])})"


def _samples(stretches: list[slice], count: int) -> Flags:
    found = np.zeros(count, dtype=bool)
    for one in stretches:
        found[one] = True
    return found


def _equal_values(t: Array, v: Array) -> Iterator[slice]:
    """Stretches of equal values, long enough to be looked at, in the order of time."""
    edges = [0, *(np.flatnonzero(np.diff(v) != 0.0) + 1).tolist(), len(v)]
    for first, end in itertools.pairwise(edges):
        if end - first >= FEWEST_EQUAL and t[end - 1] - t[first] >= SHORTEST_STUCK_S:
            yield slice(first, end)


def _resolution(v: Array) -> float:
    """Least difference between two values of (n,): the last digit of a coarse record."""
    steps = np.diff(np.unique(v))
    return float(np.quantile(steps, 0.1)) if len(steps) else 0.0


def _is_lost(stretch: slice, v: Array, force: Array, jump: float, most: float) -> bool:
    """Whether zeros begin or end with a jump, or last under more thrust than usual: a vehicle in water does neither."""
    beside = [v[i] for i in (stretch.start - 1, stretch.stop) if 0 <= i < len(v)]
    pushed = np.nanmedian(np.abs(np.append(force[stretch], 0.0))) if most > 0.0 else 0.0
    return any(abs(value) > jump for value in beside) or float(pushed) > JUMP * most


def _longest_by_chance(v: Array) -> float:
    """Number of equal values in a row that the resolution of the record explains."""
    inside = (v[1:] != 0.0) & (v[1:] != v.min()) & (v[1:] != v.max())
    if not inside.any():
        return math.inf
    equal = float(np.mean(v[1:][inside] == v[:-1][inside]))
    if equal >= 0.9:
        return math.inf
    return FEWEST_EQUAL + _in_a_row(equal)


def _outliers(v: Array) -> Flags:
    """Samples (n,) far from the median of their neighbors (Hampel), by a leap and back; none where they are many."""
    if len(v) <= 2 * HALF_WINDOW + 1:
        return np.zeros(len(v), dtype=bool)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(v, HALF_WINDOW, mode="reflect"), 2 * HALF_WINDOW + 1)
    off = np.abs(v - np.median(windows, axis=1))
    low, high = np.quantile(v, (0.05, 0.95))
    limit = max(OUTLIER_SIGMAS * 1.4826 * float(np.median(off)), OUTLIER_SPAN * float(high - low))
    found = _abrupt(v, off > limit, ABRUPT * limit)
    most = MOST_ALONE if _stand_alone(found) else MOST_OUTLIERS
    return found if limit > 0.0 and found.mean() <= most else np.zeros(len(v), dtype=bool)


def _beside(found: Flags) -> Flags:
    """Those of the samples (n,) that have another next to them."""
    beside: Flags = found & (np.append(found[1:], False) | np.append(False, found[:-1]))
    return beside


def _stand_alone(found: Flags) -> bool:
    """Whether most of the samples (n,) have no other next to them."""
    return bool(_beside(found).sum() <= MOST_BESIDE * found.sum())


def _abrupt(v: Array, far: Flags, least: float) -> Flags:
    """Those of the samples (n,) far from the median that are reached and left by a leap: of no motion.

    An axis that mostly rests has a median near zero, and all of a short swing is far from it.
    """
    # Those that stand alone say nothing of the motion beside others; where most do, nor does the rest.
    apart = far if _stand_alone(far) else far & ~_beside(far)
    kept = np.flatnonzero(~apart)
    steps = np.abs(np.diff(np.interp(np.arange(len(v)), kept, v[kept])))
    found = np.zeros(len(v), dtype=bool)
    for first, end in ((one.start, one.stop) for one in stretches_of(far)):
        leaps = [abs(v[i] - v[j]) for i, j in ((first, first - 1), (end - 1, end)) if 0 <= j < len(v)]
        beside = [steps[max(0, first - 1 - STEPS_BESIDE) : max(0, first - 1)], steps[end : end + STEPS_BESIDE]]
        usual = max((float(np.median(one)) for one in beside if len(one)), default=0.0)
        found[first:end] = min(leaps) > max(least, STEEP * usual)
    return found


def _mixed(recording: Recording) -> list[str]:
    """Note where velocities alternate between several courses, each of which is smooth: lines of several records.

    A pair of lines at almost one time would seem a burst, and a result would be that of neither record.
    """
    for axis, name in enumerate(AXES):
        v = recording.velocity[np.isfinite(recording.velocity[:, axis]), axis]
        if len(v) <= 2 * FEWEST_EQUAL:
            continue
        step = float(np.median(np.abs(np.diff(v))))
        for courses in (2, 3):
            if 0.0 < MIXED * float(np.median(np.abs(v[courses:] - v[:-courses]))) < step:
                found = f"{name}: velocities alternate between {courses} courses"
                return [f"{found}, as lines of several trials or sensors, sorted by time: give each by itself"]
    return []


def _with_even_times(recording: Recording) -> tuple[Recording, list[str]]:
    """Velocities that arrived in bursts, spread evenly from the end of one burst to that of the next."""
    t, known = recording.velocity_t, np.isfinite(recording.velocity)
    steps = np.diff(t)
    # Rows of different axes are of different sensors: their times are unrelated.
    if len(steps) < 2 * FEWEST_EQUAL or float(np.mean(steps)) <= 0.0 or (known != known[0]).any():
        return recording, []
    # Neither a pause nor a clock that was set tells how often bursts come.
    usual = steps[steps < PAUSE_S]
    short = steps < SHORT_STEP * float(np.mean(usual)) if len(usual) else np.zeros(len(steps), dtype=bool)
    if float(np.mean(short)) < MOST_SHORT:
        return recording, []
    ends = np.concatenate((np.flatnonzero(~short), [len(t) - 1]))
    pauses = np.flatnonzero(steps >= PAUSE_S) + 1
    even = np.concatenate([
        _evenly(t[first:end], ends[(ends >= first) & (ends < end)] - first)
        for first, end in itertools.pairwise((0, *pauses.tolist(), len(t)))
    ])  # fmt: skip
    size = len(t) / len(ends)
    note = f"velocities came in bursts of about {size:.0f}, as by their times of receipt: they are spread evenly"
    return replace(recording, velocity_t=array(even)), [f"{note}; stamps of the measurement itself are better"]


def _evenly(t: Array, ends: Index) -> Array:
    """Times (n,) [s] spread from the last sample of one burst to that of the next; `ends`: indices of those."""
    even = np.interp(np.arange(len(t)), ends, t[ends])
    even[: ends[0]] = t[0]  # when the first burst began is unknown
    return array(even)


def _pauses(recording: Recording) -> list[str]:
    """Note on pauses of forces that come regularly otherwise."""
    known = np.isfinite(recording.wrench).any(axis=1)
    t, neutral = recording.wrench_t[known], (np.nan_to_num(recording.wrench[known]) == 0.0).all(axis=1)
    steps = np.diff(t)
    found = np.flatnonzero(steps > longest_ages_s(neutral[:-1], longest_hold_s(t, Tuning().thrust_age_s)))
    if not len(found):
        return []
    longest = found[int(np.argmax(steps[found]))]
    many = f"{len(found)} pauses" if len(found) > 1 else "one pause"
    where = f"the longest of {steps[longest]:.3g} s after {t[longest]:.4g} s"
    return [f"no force for {float(steps[found].sum()):.3g} s in {many}, {where}: what moved meanwhile is left out"]


def _gaps(recording: Recording) -> list[str]:
    """Note on gaps between the velocities of any axis."""
    t = recording.velocity_t[np.isfinite(recording.velocity).any(axis=1)]
    steps = np.diff(t)
    found = np.flatnonzero(steps > max(GAP_S, GAP_STEPS * float(np.median(steps)))) if len(steps) else steps
    if not len(found):
        return []
    longest = found[int(np.argmax(steps[found]))]
    several = "s" if len(found) > 1 else ""
    total_s, longest_s = float(steps[found].sum()), float(steps[longest])
    where = f"the longest of {longest_s:.3g} s after {t[longest]:.4g} s"
    return [f"no velocity for {total_s:.3g} s in {len(found)} gap{several}, {where}: parts of a record"]
