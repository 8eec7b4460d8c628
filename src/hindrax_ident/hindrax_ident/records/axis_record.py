"""Record of one axis of a run: velocities, positions, thrust, and the stretches of time in which the model holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.model.thrust_lag import LaggedThrust

EMPTY: Array = np.zeros(0)
SPAN_S = 0.5
"""Time over which a velocity is a mean, where its noise must not count."""
SHARE = 0.25
"""Share of the highest speed that the other direction must reach."""


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


def series(points: list[tuple[float, float]]) -> Series:
    """Points sorted by time; of several at one time, the last."""
    if not points:
        return Series(EMPTY, EMPTY)
    table = np.array(sorted(points, key=lambda point: point[0]))
    last = np.concatenate([np.diff(table[:, 0]) > 0.0, [True]])
    return Series(table[last, 0], table[last, 1])


@dataclass(frozen=True, slots=True)
class Stretch:
    """A span of time with one motion, in which every sample may be used."""

    start_s: float
    end_s: float
    motion: str = ""
    phase: str = ""


@dataclass(frozen=True, slots=True)
class Record:
    """One axis of one run, times in seconds from the run's first event.

    `thrust` is the commanded thrust, `known` the hydrostatic force, `coriolis` that due to motion along other axes,
    `coriolis_errors` its errors (see `model.coriolis.coriolis_errors`); all hold until their next sample. `position` is
    the depth [m] in heave, the angle [rad] in roll and pitch, empty elsewhere. `effort` is the sum of the squared
    contributions of all thrusters on the axis [N^2, N^2 m^2], `inflow` that of the squared wrench per newton times the
    root of the force [N^0.5, N^0.5 m^2]; they hold like thrust, and are empty where unknown.
    """

    velocity: Series
    thrust: Series
    stretches: tuple[Stretch, ...]
    known: Series = Series(EMPTY, EMPTY)
    coriolis: Series = Series(EMPTY, EMPTY)
    coriolis_errors: tuple[Series, ...] = ()
    position: Series = Series(EMPTY, EMPTY)
    effort: Series = Series(EMPTY, EMPTY)
    inflow: Series = Series(EMPTY, EMPTY)
    lag_s: float = 0.0
    plateaus: tuple[Stretch, ...] = ()
    latency_s: float = 0.0
    """Known latency of the stamps of velocity and position; the series have the stamps as received."""
    supply_measured: bool = False
    """Whether the supply voltage behind the thrust was measured all the time; else it was assumed."""

    def impulse(self, at_s: Array) -> Array:
        """Impulse of thrust after its lag and of known forces, up to each time: (n,) [N s, N m s]."""
        thrust = LaggedThrust(self.thrust.t, self.thrust.y, self.lag_s).impulse(at_s - self.latency_s)
        return array(thrust + sum(part.impulse(at_s) for part in self._measured()))

    def force(self, at_s: Array) -> Array:
        """Thrust after its lag and known forces: (n,) [N, N m]."""
        thrust = LaggedThrust(self.thrust.t, self.thrust.y, self.lag_s).force(at_s - self.latency_s)
        return array(thrust + sum(part.force(at_s) for part in self._measured()))

    def _measured(self) -> list[LaggedThrust]:
        """Forces computed from velocities and attitudes, with the same latency as the fitted measurements."""
        return [LaggedThrust(part.t, part.y, 0.0) for part in (self.known, self.coriolis) if len(part)]

    def efforts(self, at_s: Array) -> Array:
        """Integral of the effort (without one: of the squared thrust) after the lag: (n,) [N^2 s, N^2 m^2 s]."""
        known = self.effort if len(self.effort) else Series(self.thrust.t, self.thrust.y**2)
        return LaggedThrust(known.t, known.y, self.lag_s).impulse(at_s - self.latency_s)

    def mean_velocities(self) -> Array:
        """Mean velocities over spans of SPAN_S within the stretches, of what measures the motion: (n,) [m/s, rad/s]."""
        t, v = self.velocity.t, self.velocity.y
        way = Series(t, np.cumsum(np.diff(t, prepend=t[:1]) * 0.5 * (v + np.append(v[:1], v[:-1]))))
        placed = way if len(way) else self.position
        parts = [_slopes(placed.between(one.start_s, one.end_s)) for one in self.stretches]
        return array(np.concatenate(parts)) if parts else EMPTY

    def with_stretches(self, stretches: tuple[Stretch, ...]) -> Record:
        """The same record with other stretches."""
        return replace(self, stretches=stretches)


def _slopes(placed: Series) -> Array:
    """Slopes of positions over spans of SPAN_S: (n,)."""
    if len(placed) < 2:
        return EMPTY
    times = np.arange(placed.t[0], placed.t[-1], SPAN_S)
    return array(np.diff(np.interp(times, placed.t, placed.y)) / SPAN_S)


def side_of(record: Record) -> int:
    """Directions in which a record moves; 0: both, 1 or -1: only that one."""
    v = record.mean_velocities()
    if not len(v):
        return 1
    up, down = float(np.percentile(v, 98.0)), float(np.percentile(v, 2.0))
    if min(up, -down) > SHARE * max(up, -down):
        return 0
    return 1 if up >= -down else -1
