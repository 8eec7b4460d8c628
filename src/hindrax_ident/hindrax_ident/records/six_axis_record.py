"""Record of all six axes at once: velocities and depth as measured, thrust, roll and pitch, on one grid of times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, Index, array, rounding
from hindrax_ident.model.thrust_lag import ONE_LAG
from hindrax_ident.records.axis_record import Series, is_fresh

FINEST_S, COARSEST_S = 0.04, 0.1
"""Bounds of the step of the grid: thrust lags are longer, and what is faster is averaged by the noise of the fit."""
LONGEST_STRETCH_S = 60.0
"""Longest stretch with one linear system: what is longer is cut, which bounds the memory."""
SPECTRUM_STEP_S, BINS_OF_A_SINE = 0.1, 2.0
"""Sampling of the thrust for its spectrum; and how many bins of a spectrum with Hann's window one sine takes."""
FEWEST_VELOCITIES = 20
"""Fewest velocities of an axis that is fitted."""


@dataclass(frozen=True, slots=True)
class Grid:
    """One stretch: times (n,) [s] evenly spaced, and roll and pitch at the middle of each step, (n - 1, 2) [rad]."""

    times_s: Array
    angles_rad: Array

    @property
    def step_s(self) -> float:
        """Length of each step."""
        return float(self.times_s[1] - self.times_s[0])

    @property
    def down(self) -> Array:
        """Downward in body axes, at the middle of each step: (n - 1, 3). Fossen 2011 eq. 2.18, last row."""
        roll, pitch = self.angles_rad.T
        return array(np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=1))

    def places(self, t: Array) -> tuple[Index, Array]:
        """Step in which each time (m,) is, and the part of it that has passed [-]."""
        at = (t - self.times_s[0]) / self.step_s
        index: Index = np.clip(at.astype(np.intp), 0, len(self.times_s) - 2)
        return index, at - index


@dataclass(frozen=True, slots=True)
class SixAxisRecord:
    """Velocities of the axes, depth where it stands for heave, thrust on all axes from each time on, and stretches.

    SNAME axes about the center of mass; `wrench` (m, 6) [N, N m] at `wrench_t` (m,) [s].
    """

    velocities: tuple[Series, ...]
    depth: Series
    wrench_t: Array
    wrench: Array
    grids: tuple[Grid, ...]
    later_s: tuple[float, float] = ONE_LAG
    """By how much the lags of thrust that goes and turns round are longer (see `Record.later_s`)."""

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes that were measured and that thrust has moved."""
        counts = [len(one) + (len(self.depth) if axis == 2 else 0) for axis, one in enumerate(self.velocities)]
        pushed = np.ptp(self.wrench, axis=0) > [rounding(self.wrench, axis) for axis in range(6)]
        return tuple(axis for axis in range(6) if counts[axis] >= FEWEST_VELOCITIES and pushed[axis])

    def frequencies(self, axis: int) -> float:
        """As how many equal sines the thrust of an axis is spread over its spectrum.

        The participation ratio of the power, (sum P)^2 / sum P^2. A thrust of n sines determines 2 n numbers of a
        linear system (persistent excitation; Ljung, System Identification, 2nd ed., section 13.2).

        Parameters
        ----------
        axis
            0 to 5.

        Returns
        -------
        float
            1 for one sine.
        """
        times = np.arange(self.wrench_t[0], self.wrench_t[-1], SPECTRUM_STEP_S)
        y = np.interp(times, self.wrench_t, self.wrench[:, axis])
        power = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)))) ** 2
        return float(power.sum() ** 2 / max(1e-300, float(np.sum(power**2)))) / BINS_OF_A_SINE

    @property
    def duration_s(self) -> float:
        """Time in all stretches."""
        return float(sum(one.times_s[-1] - one.times_s[0] for one in self.grids))


def six_axis_record(
    velocity: tuple[Array, Array],
    wrench: tuple[Array, Array],
    attitude: tuple[Array, Array],
    gap_s: float,
    thrust_age_s: float = math.inf,
) -> SixAxisRecord:
    """Make a record of tables, each with its times; NaN where something is unknown.

    Parameters
    ----------
    velocity : (n,) [s], (n, 6) [m/s, rad/s]
        Body velocities about the center of mass.
    wrench : (m,) [s], (m, 6) [N, N m]
        Thrust, each from its time on.
    attitude : (k,) [s], (k, 3) [rad, rad, m]
        Roll, pitch and depth. The depth is used where no velocity of heave was measured.
    gap_s : [s]
        A longer pause between measurements divides stretches.
    thrust_age_s : [s]
        A thrust that is older is not known any more, which divides them too.

    Returns
    -------
    SixAxisRecord
        On grids of at most COARSEST_S.

    Raises
    ------
    ValueError
        Where no stretch is long enough, or there are too few velocities and forces.
    """
    (v_t, v), (w_t, w), (a_t, a) = velocity, wrench, attitude
    velocities = tuple(_finite(v_t, one) for one in v.T)
    depth = _finite(a_t, a[:, 2]) if len(velocities[2]) < FEWEST_VELOCITIES else Series(array([]), array([]))
    known_w = np.isfinite(w).any(axis=1)
    w_t, w = w_t[known_w], np.nan_to_num(w[known_w])
    measured = np.unique(np.concatenate([one.t for one in (*velocities, depth)]))
    if not len(w_t) or len(measured) < FEWEST_VELOCITIES:
        raise ValueError("the record holds too few velocities and forces for a fit of all axes")
    measured = measured[measured >= w_t[0]]
    fresh = is_fresh(measured, Series(w_t, array(np.linalg.norm(w, axis=1))), thrust_age_s)
    edges = np.flatnonzero((np.diff(measured) > gap_s) | (np.diff(fresh.astype(int)) != 0)) + 1
    known = np.split(fresh, edges)
    pieces = [
        part
        for part, there in zip(np.split(measured, edges), known, strict=True)
        if len(part) > FEWEST_VELOCITIES and there.all()
    ]
    angles = [_finite(a_t, one) for one in a.T[:2]]
    step_s = min(COARSEST_S, max(FINEST_S, _period(velocities)))
    grids = tuple(grid for part in pieces for grid in _grids(part, step_s, angles))
    if not grids:
        raise ValueError("the record holds no stretch without pauses that is long enough for a fit of all axes")
    return SixAxisRecord(velocities, depth, w_t, w, grids)


def _finite(t: Array, y: Array) -> Series:
    known = np.isfinite(y)
    return Series(t[known], y[known])


def _period(velocities: Sequence[Series]) -> float:
    """Time between the samples of the axis that was measured most often [s]."""
    steps = [float(np.median(np.diff(one.t))) for one in velocities if len(one) > 1]
    return min(steps, default=COARSEST_S)


def _grids(times_s: Array, step_s: float, angles: Sequence[Series]) -> list[Grid]:
    begin, end = float(times_s[0]), float(times_s[-1])
    out, count = [], max(1, math.ceil((end - begin) / LONGEST_STRETCH_S))
    edges = np.linspace(begin, end, count + 1)
    for start, stop in itertools.pairwise(edges.tolist()):
        steps = math.floor((stop - start) / step_s)
        if steps > FEWEST_VELOCITIES:
            t = start + step_s * np.arange(steps + 1)
            middle = t[:-1] + 0.5 * step_s
            level = [np.interp(middle, one.t, one.y) if len(one) else np.zeros(steps) for one in angles]
            out.append(Grid(t, np.stack(level, axis=1)))
    return out
