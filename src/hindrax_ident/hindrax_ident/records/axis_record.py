"""Record of one axis of a run: velocities, positions, thrust, and the stretches of time in which the model holds.

The stretches follow from the phases of the maneuver.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from hindrax_core.signals import BLOCKED, Supply
from hindrax_ident.arrays import Array, Flags, array, largest
from hindrax_ident.model.thrust_lag import ONE_LAG, LaggedThrust, SumOfThrusts
from hindrax_ident.tuning import USUAL_LAG_S, USUAL_LATENCY_S, Tuning

NEUTRAL_S = 2.0
"""For so long, at least, thrusters are at rest after a command of zero."""
LAG_FORGOTTEN_S = 0.5
"""After a time without commands the thrust of the first is unknown for so long: it depends on the one before."""
LOST_S, LOST_PERIODS, REPEATED = 0.25, 5.0, 0.2
"""Pause of a thrust in which messages were lost, at least and in periods of the sender; and share of its messages that
repeat the one before, from which a sender has a rate: 0.4 to 0.9 of our allocator's, none of commands that are sent
when they change."""
EMPTY: Array = np.zeros(0)
SPAN_S = 0.5
"""Time over which a velocity is a mean, where its noise must not count."""
SHARE = 0.25
"""Share of the highest speed that the other direction must reach."""
SMOOTH_S = 0.4
"""Mean of a speed across: a sample of it is noise and holds until the next."""
BEFORE_BLOCKED_S = 2.0
"""The time before a blocked phase is no free motion either; the pilot reports it after 1.5 s."""

SampleT = TypeVar("SampleT")
LATER = "goes_later_s", "turns_later_s"
"""Names of both of `Record.later_s` where a result has them."""


class Samples(list[SampleT]):
    """Samples in time order, none of which changes: a deep copy shares them, so that one of hours takes no time."""

    def __deepcopy__(self, _memo: object) -> Samples[SampleT]:
        return Samples(self)


@dataclass(frozen=True, slots=True)
class Series:
    """Samples of one quantity: times (n,) [s] increasing, values (n,)."""

    t: Array
    y: Array

    def between(self, start_s: float, end_s: float) -> Series:
        """Samples of a closed span of time."""
        inside = slice(*np.searchsorted(self.t, [start_s, end_s + 1e-9]))
        return Series(self.t[inside], self.y[inside])

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True)
class ThrusterForces:
    """Forces of all thrusters: times (n,) [s], wrench on the axis per newton of each (k,) [-, m], forces (n, k) [N]."""

    t: Array
    per_newton: Array
    y: Array

    def __len__(self) -> int:
        return len(self.t)

    def inflow(self, at_s: Array, lag_s: float) -> Array:
        """Thrust lost on the axis per inflow, over T_nu: sum of d^2 |T|^0.5, d the wrench per newton of a thruster.

        The lag comes before the root: what turns round passes zero, where nothing is lost. With the root before the
        lag, the inflow of a turn could not be told from its drag, and another influence took its place (ADR 31).

        Parameters
        ----------
        at_s : (m,) [s]
            By the stamps of the thrust.
        lag_s
            Of the thrusters.

        Returns
        -------
        Array
            (m,) [N^0.5, N^0.5 m^2].
        """
        lagged = (LaggedThrust(self.t, force, lag_s).force(at_s) for force in self.y.T)
        lost = (d**2 * np.sqrt(np.abs(force)) for d, force in zip(self.per_newton, lagged, strict=True))
        return array(sum(lost, start=np.zeros(len(at_s))))


NO_FORCES = ThrusterForces(EMPTY, EMPTY, array(np.zeros((0, 0))))


def series(points: list[tuple[float, float]]) -> Series:
    """Points sorted by time; of several at one time, the last."""
    if not points:
        return Series(EMPTY, EMPTY)
    table = np.array(sorted(points, key=lambda point: point[0]))
    last = np.concatenate([np.diff(table[:, 0]) > 0.0, [True]])
    return Series(table[last, 0], table[last, 1])


def about_samples(samples: Series) -> LaggedThrust:
    """A sampled force, each value from halfway since the one before: held from its own time on, all would be late."""
    halfway = np.concatenate([samples.t[:1], 0.5 * (samples.t[1:] + samples.t[:-1])])
    return LaggedThrust(array(halfway), samples.y, 0.0)


def between_samples(t: Array, sparse: Array, longest_s: float) -> Array:
    """Fill a quantity that was measured at some of the times only, by straight lines from sample to sample.

    Parameters
    ----------
    t : (n,) [s]
        Not decreasing.
    sparse : (n,)
        Samples, NaN where it was not measured.
    longest_s : [s]
        A pause longer than this is no line: there the last sample holds for as long, then it is 0, as before the first.

    Returns
    -------
    Array
        (n,), finite.
    """
    measured = np.flatnonzero(np.isfinite(sparse))
    if not len(measured):
        return np.zeros(len(t))
    line = np.interp(t, t[measured], sparse[measured])
    last = np.searchsorted(measured, np.arange(len(t)), side="right") - 1
    before, after = measured[np.maximum(last, 0)], measured[np.minimum(last + 1, len(measured) - 1)]
    paused = (t[after] - t[before] > longest_s) | (last == len(measured) - 1)
    held = np.where(t - t[before] <= longest_s, sparse[before], 0.0)
    return array(np.where(last < 0, 0.0, np.where(paused, held, line)))


LEAST_COUPLING = 0.02
"""Coupling of a record (`Record.coupling`) from which its axes moved together: each tells the others' masses [-]."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A span of time with one motion, in which every sample may be used."""

    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Record:
    """One axis of one run, times in seconds from the run's first event.

    `thrust` is the commanded thrust, `known` the hydrostatic force, `coriolis` that due to motion along other axes,
    `coriolis_errors` its errors (see `model.coriolis.coriolis_errors`). Thrust holds until its next sample; the other
    three are samples of what changes, and hold about their times (`about_samples`). `others` are the velocities of all
    six axes, that of its own zero, or none; `across` is the speed that they make at the hull in the unit of the axis
    (`model.motion_model.speed_across`). `position` is the depth [m] in heave, the angle [rad] in roll and pitch, and
    the way [m] along an axis whose velocity no instrument measures; empty elsewhere. `effort` is the sum of the squared
    contributions of all thrusters on the axis [N^2, N^2 m^2], `forces` are those of single thrusters; they hold like
    thrust, empty where unknown.
    """

    velocity: Series
    thrust: Series
    stretches: tuple[Stretch, ...]
    known: Series = Series(EMPTY, EMPTY)
    others: tuple[Series, ...] = ()
    across: Series = Series(EMPTY, EMPTY)
    coriolis: Series = Series(EMPTY, EMPTY)
    coriolis_errors: tuple[Series, ...] = ()
    position: Series = Series(EMPTY, EMPTY)
    effort: Series = Series(EMPTY, EMPTY)
    forces: ThrusterForces = NO_FORCES
    lag_s: float = 0.0
    plateaus: tuple[Stretch, ...] = ()
    latency_s: float = 0.0
    """Known latency of the stamps of velocity and position; the series have the stamps as received."""
    prior_delays_s: tuple[float, float] = (USUAL_LAG_S, USUAL_LATENCY_S)
    """Lag and latency to expect where a fit is to find both: what is given, also where it is 0, else the usual ones."""
    smoothing_s: float = 0.0
    """Time constant of a filter that had smoothed the velocities, and was undone; 0: none."""
    filter_doubt_s: float = 0.0
    """That of a filter that seems to have smoothed them, and cannot be undone; 0: none."""
    filter_hint_s: float = 0.0
    """That of one that is no more than possible: it counts where another axis has one like it; 0: none."""
    means: tuple[tuple[float, float], ...] = ()
    """Each velocity is a sum of means of the motion about its time: share of each, and over how long [s]; empty: it is
    that of the moment."""
    later_s: tuple[float, float] = ONE_LAG
    """By how much the lags of thrust that goes, and of thrust that turns round, are longer than that of what comes."""
    ramps_s: float = 0.0
    """Time from zero to the largest thrust, where it ramps, which `thrust` has; 0: none."""
    ranged: bool = False
    """Whether the position is a range to a wall: then its scale is that of the sonar and of the wall's angle."""
    supply: Supply = Supply.ASSUMED
    """How the supply voltage behind the thrust was known all the time."""

    @property
    def coupling(self) -> float:
        """Error of the forces by motion along other axes, of the thrust, within the stretches (root mean squares) [-].

        By the deviations of the masses of the other axes. Above `LEAST_COUPLING` the record tells these masses.
        """
        driven = [self.thrust.between(one.start_s, one.end_s) for one in self.stretches]
        thrust = np.concatenate([one.y for one in driven]) if driven else EMPTY
        if not np.any(thrust):
            return 0.0
        at_s = np.concatenate([one.t for one in driven])
        squares = [about_samples(one).force(at_s) ** 2 for one in self.coriolis_errors]
        return math.sqrt(sum(float(np.mean(one)) for one in squares) / float(np.mean(thrust**2)))

    def within(self, span: Stretch) -> tuple[Series, Series]:
        """Velocities and positions measured within a span."""
        return self.velocity.between(span.start_s, span.end_s), self.position.between(span.start_s, span.end_s)

    def lagged(self) -> LaggedThrust | SumOfThrusts:
        """Thrust after its lag, by the time of its own stamps.

        Returns
        -------
        LaggedThrust | SumOfThrusts
            Lags that differ are those of each thruster, where the forces of all are known: on the axis, what one of
            them takes back another may add.
        """
        if not any(self.later_s) or not len(self.forces):
            return LaggedThrust(self.thrust.t, self.thrust.y, self.lag_s, self.later_s)
        t, y, d = self.forces.t, self.forces.y, self.forces.per_newton
        usual = LaggedThrust(self.thrust.t, self.thrust.y, self.lag_s)
        of_one_lag = LaggedThrust(t, array(y @ d), self.lag_s)
        own = [
            (share, LaggedThrust(t, force, self.lag_s, self.later_s))
            for share, force in zip(d.tolist(), y.T, strict=True)
        ]
        return SumOfThrusts([(1.0, usual), (-1.0, of_one_lag), *own])

    def impulse(self, at_s: Array) -> Array:
        """Impulse of thrust after its lag and of known forces, up to each time: (n,) [N s, N m s]."""
        return self.lagged().impulse(at_s - self.latency_s) + self.known_impulse(at_s)

    def known_impulse(self, at_s: Array) -> Array:
        """Impulse of known forces up to each time, whatever the delays: (n,) [N s, N m s]."""
        return sum((part.impulse(at_s) for part in self._measured()), start=np.zeros(len(at_s)))

    def force(self, at_s: Array) -> Array:
        """Thrust after its lag and known forces: (n,) [N, N m]."""
        thrust = self.lagged().force(at_s - self.latency_s)
        return array(thrust + sum(part.force(at_s) for part in self._measured()))

    def _measured(self) -> list[LaggedThrust]:
        """Forces computed from velocities and attitudes, with the same latency as the fitted measurements."""
        return [about_samples(part) for part in (self.known, self.coriolis) if len(part)]

    def efforts(self, at_s: Array) -> Array:
        """Integral of the effort (without one: of the squared thrust) after the lag: (n,) [N^2 s, N^2 m^2 s]."""
        known = self.effort if len(self.effort) else Series(self.thrust.t, self.thrust.y**2)
        return LaggedThrust(known.t, known.y, self.lag_s).impulse(at_s - self.latency_s)

    def mean_velocities(self) -> Array:
        """Mean velocities over spans of SPAN_S within the stretches, of what measures the motion: (n,) [m/s, rad/s]."""
        way = self._way()
        parts = [_slopes(way.between(one.start_s, one.end_s)).y for one in self.stretches]
        return np.concatenate(parts) if parts else EMPTY

    def motion(self) -> Series:
        """Integral of the squared velocity within the stretches, by spans of SPAN_S: how much the axis has moved."""
        way, total, times, sums = self._way(), 0.0, [EMPTY], [EMPTY]
        for one in self.stretches:
            moved = _slopes(way.between(one.start_s, one.end_s))
            sums.append(total + np.concatenate([[0.0], np.cumsum(moved.y**2)]))
            times.append(array(np.linspace(one.start_s, one.end_s, len(sums[-1]))))
            total = float(sums[-1][-1])
        return Series(np.concatenate(times), np.concatenate(sums))

    def _way(self) -> Series:
        """Distance, by the velocity where it was measured."""
        t, v = self.velocity.t, self.velocity.y
        way = Series(t, np.cumsum(np.diff(t, prepend=t[:1]) * 0.5 * (v + np.append(v[:1], v[:-1]))))
        return way if len(way) else self.position

    def speed_across(self, at_s: Array) -> Array:
        """Speed across the axis, a mean over SMOOTH_S: (n,) [m/s, rad/s]; zero where it was not measured."""
        if not len(self.across):
            return np.zeros(len(at_s))
        way = about_samples(self.across)
        return array((way.impulse(at_s + 0.5 * SMOOTH_S) - way.impulse(at_s - 0.5 * SMOOTH_S)) / SMOOTH_S)

    def crossing(self) -> float:
        """Mean square of the speed across, of that along the axis, within the stretches [-]; 0 without any."""
        moved = self.motion()
        along = float(moved.y[-1]) / max(1, len(moved) - len(self.stretches)) if len(moved) else 0.0
        return float(np.mean(self.speed_across(moved.t) ** 2)) / along if along > 0.0 else 0.0

    def with_stretches(self, stretches: tuple[Stretch, ...]) -> Record:
        """The same record with other stretches."""
        return replace(self, stretches=stretches)


def _slopes(placed: Series) -> Series:
    """Slopes of positions over spans of SPAN_S, at their ends."""
    if len(placed) < 2:
        return Series(EMPTY, EMPTY)
    times = np.arange(placed.t[0], placed.t[-1], SPAN_S)
    return Series(times[1:], np.diff(np.interp(times, placed.t, placed.y)) / SPAN_S)


def side_of(record: Record) -> int:
    """Directions in which a record moves; 0: both, 1 or -1: only that one."""
    v = record.mean_velocities()
    if not len(v):
        return 1
    up, down = largest(v, 1), largest(v, -1)
    if min(up, down) > SHARE * max(up, down):
        return 0
    return 1 if up >= down else -1


@dataclass(slots=True)
class PhaseLog:
    """Changes of motion and phase, with their times [s]."""

    changes: list[tuple[float, str, str]]

    def add(self, t_s: float, motion: str, phase: str) -> None:
        """Add the motion and phase from this time on; a blocked one has begun before.

        Parameters
        ----------
        t_s : [s]
            In time order.
        motion, phase
            As of the maneuver's status.
        """
        if phase == BLOCKED:
            t_s -= BEFORE_BLOCKED_S
            self.changes = [one for one in self.changes if one[0] < t_s]
        self.changes.append((t_s, motion, phase))

    @property
    def undivided(self) -> bool:
        """Whether all motion is one excitation: the record is not that of maneuvers."""
        return {phase for _, motion, phase in self.changes if motion} == {"excite"}

    def stretches(
        self, motions: Sequence[str], phases: Sequence[str], end_s: float, join_s: float = 0.0
    ) -> list[Stretch]:
        """Spans of the given motions and phases.

        Parameters
        ----------
        motions, phases
            Those that count.
        end_s : [s]
            End of the last one.
        join_s : [s]
            Spans that are at most so far apart are joined.

        Returns
        -------
        list[Stretch]
            In time order.
        """
        ordered = sorted(self.changes)
        ends = [*(t for t, _, _ in ordered[1:]), end_s]
        spans: list[Stretch] = []
        for (start, motion, phase), end in zip(ordered, ends, strict=True):
            if motion not in motions or phase not in phases or end <= start:
                continue
            joined = bool(spans) and start - spans[-1].end_s <= join_s
            spans.append(Stretch(spans.pop().start_s if joined else start, end))
        return spans


def usable(spans: Sequence[Stretch], measured: Array, thrust: Series, tuning: Tuning) -> tuple[Stretch, ...]:
    """Cut spans where measurements pause or thrust is unknown, and into pieces within the longest length.

    Parameters
    ----------
    spans
        Of the motion and phases that count.
    measured : (n,) [s]
        Times of the measurements.
    thrust
        Thrust on the axis.
    tuning
        `gap_s`, `thrust_age_s` and `stretch_s`: longest pause, age of a thrust, and length [s].

    Returns
    -------
    tuple[Stretch, ...]
        Each from one measurement to another.
    """
    if not len(thrust) or not len(measured):
        return ()
    fresh = is_fresh(measured, thrust, tuning.thrust_age_s)
    # The path does not go on over a time of unknown thrust, however short.
    parts = np.split(measured, np.flatnonzero(np.diff(fresh.astype(int))) + 1)
    pieces: list[Stretch] = []
    for span in spans:
        for times in parts[0 if fresh[0] else 1 :: 2]:
            for run in _runs(span, times, tuning.gap_s):
                pieces += _cut(run, tuning.stretch_s)
    return tuple(pieces)


def is_fresh(measured: Array, thrust: Series, age_s: float) -> Flags:
    """Whether the thrust is known at measurements: its command is, and has been for as long as its lag matters.

    Parameters
    ----------
    measured : (n,) [s]
        Their times.
    thrust
        Each of it holds until the next.
    age_s : [s]
        For how long at most.

    Returns
    -------
    Flags
        (n,)
    """
    holds_s = longest_ages_s(thrust.y == 0.0, age_s)
    holds_s[changed_unseen(thrust)] = LOST_S
    last = np.searchsorted(thrust.t, measured, side="right") - 1
    fresh = (last >= 0) & (measured - thrust.t[np.maximum(last, 0)] <= holds_s[np.maximum(last, 0)])
    again = np.append(-np.inf, thrust.t[1:][np.diff(thrust.t) > holds_s[:-1]])
    resumed = measured - again[np.searchsorted(again, measured, side="right") - 1]
    return np.asarray(fresh & (resumed > LAG_FORGOTTEN_S))


def changed_unseen(thrust: Series) -> Flags:
    """Which thrusts were followed by another one after a pause in which messages were lost: it came sometime in it.

    Who sends at a rate repeats what does not change; of who sends changes alone, a pause says that there was none. In
    a flight on a starved computer 0.9 s of a turn were lost, with a stop in them: its drag came out 6 % too low and was
    known to 1 %, because dead bands explained what was left.

    Parameters
    ----------
    thrust
        Each of it holds until the next.

    Returns
    -------
    Flags
        (n,), never one of zero: thrusters that rest are told of no more.
    """
    steps, same = np.diff(thrust.t), np.diff(thrust.y) == 0.0
    if not len(steps) or same.mean() < REPEATED:
        return np.zeros(len(thrust), dtype=bool)
    lost = (steps > max(LOST_S, LOST_PERIODS * float(np.median(steps)))) & ~same & (thrust.y[:-1] != 0.0)
    return np.append(lost, False)


def longest_ages_s(neutral: Flags, age_s: float) -> Array:
    """For how long each thrust is known: a pause that begins with zero is one of thrusters at rest, and longer.

    Parameters
    ----------
    neutral : (m,)
        Whether it is zero.
    age_s : [s]
        Of the others.

    Returns
    -------
    Array
        (m,) [s].
    """
    return array(np.where(neutral, max(age_s, NEUTRAL_S), age_s))


def unbroken(span: Stretch, measured: Array, gap_s: float) -> list[Stretch]:
    """Cut a span where measurements pause.

    Parameters
    ----------
    span
        Of one motion.
    measured : (n,) [s]
        Times of the measurements.
    gap_s : [s]
        Longest pause that does not cut.

    Returns
    -------
    list[Stretch]
        Each from one measurement to another.
    """
    return [Stretch(float(run[0]), float(run[-1])) for run in _runs(span, measured, gap_s) if len(run) > 1]


def _runs(span: Stretch, measured: Array, gap_s: float) -> list[Array]:
    """Times (n,) [s] within a span, apart where they pause."""
    inside = measured[(measured >= span.start_s) & (measured <= span.end_s)]
    return np.split(inside, np.flatnonzero(np.diff(inside) > gap_s) + 1)


def _cut(times: Array, longest_s: float) -> list[Stretch]:
    """Pieces with equal numbers of samples, none longer than `longest_s` at regular sampling."""
    if len(times) < 2:
        return []
    count = max(1, math.ceil(float(times[-1] - times[0]) / longest_s))
    parts = [part for part in np.array_split(times, count) if len(part) > 1]
    return [Stretch(float(part[0]), float(part[-1])) for part in parts]
