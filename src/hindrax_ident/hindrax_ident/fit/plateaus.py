"""Method of COB-2023-1394: one mean velocity and one mean force per plateau, then batch least squares.

Always computed, so that results can be compared with the paper's. Where the maneuver names no plateaus, spans of
constant thrust are used without their first part, the transient.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.records.axis_record import Record, Series, Stretch

SHORTEST_PLATEAU_S = 2.0
TRANSIENT = 0.5
"""Share of a span of constant thrust that counts as transient."""
STEADY_THRUST = 0.05
"""Largest change of the thrust, relative to its largest value in the record, within a plateau."""


@dataclass(frozen=True, slots=True)
class Plateaus:
    """Mean velocity [m/s, rad/s], mean force [N, N m] and duration [s] of each plateau, (n,) each."""

    v: Array
    force: Array
    duration_s: Array

    def on_side(self, side: int) -> Plateaus:
        """Plateaus of one direction of motion; all of them for 0."""
        keep = np.ones(len(self.v), bool) if side == 0 else np.sign(self.v) == side
        return Plateaus(self.v[keep], self.force[keep], self.duration_s[keep])


@dataclass(frozen=True, slots=True)
class BatchFit:
    """k_q, k_l, b and their covariance. COB-2023-1394 eq. 6 to 8."""

    theta: Array
    covariance: Array


def measure(record: Record) -> Plateaus:
    """Means over the plateaus of a record; without velocities, the slope of the position."""
    spans = record.plateaus or detected(record)
    if not spans:
        return Plateaus(np.zeros(0), np.zeros(0), np.zeros(0))
    edges = np.array([(span.start_s, span.end_s) for span in spans])
    impulses = np.diff(record.impulse(edges.ravel()).reshape(-1, 2), axis=1)[:, 0]
    speeds = np.array([_speed(record, span) for span in spans])
    duration = edges[:, 1] - edges[:, 0]
    seen = np.isfinite(speeds)
    return Plateaus(speeds[seen], (impulses / duration)[seen], duration[seen])


def _speed(record: Record, span: Stretch) -> float:
    """Mean of the velocities within a span, or slope of the positions; NaN with too few samples."""
    measured, placed = record.within(span)
    if len(measured) >= 3:
        return float(measured.y.mean())
    if len(placed) >= 3:
        return float(np.polyfit(placed.t - placed.t[0], placed.y, 1)[0])
    return math.nan


def detected(record: Record) -> tuple[Stretch, ...]:
    """Later part of every span of constant thrust within the stretches."""
    if not len(record.thrust):
        return ()
    limit = STEADY_THRUST * float(np.abs(record.thrust.y).max())
    parts = [(record.thrust.between(one.start_s, one.end_s), one.end_s) for one in record.stretches]
    return tuple(span for thrust, end_s in parts for span in _still(thrust, end_s, limit))


def _still(thrust: Series, end_s: float, limit: float) -> list[Stretch]:
    edges = [*thrust.t.tolist(), end_s]
    found, begin = [], 0
    for index in range(1, len(thrust) + 1):
        if index < len(thrust) and abs(float(thrust.y[index] - thrust.y[begin])) <= limit:
            continue
        start, end = edges[begin], edges[index]
        if end - start >= SHORTEST_PLATEAU_S:
            found.append(Stretch(start + TRANSIENT * (end - start), end))
        begin = index
    return found


def fit(plateaus: Plateaus) -> BatchFit | None:
    """Batch least squares on [|v| v, v, 1]; None with fewer than four plateaus or a singular regressor."""
    n = len(plateaus.v)
    if n < 4:
        return None
    v = plateaus.v
    X = np.stack([np.abs(v) * v, v, np.ones(n)], axis=1)
    theta, _, rank, _ = np.linalg.lstsq(X, plateaus.force, rcond=1e-9)
    if rank < 3:
        return None
    residual = plateaus.force - X @ theta
    variance = float(residual @ residual) / (n - 3)
    return BatchFit(array(theta), array(np.linalg.inv(X.T @ X) * variance))
