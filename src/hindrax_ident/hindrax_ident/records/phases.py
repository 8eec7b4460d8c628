"""Phases of a maneuver to the stretches of time in which a motion's model holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.signals import BLOCKED
from hindrax_ident.arrays import Array
from hindrax_ident.records.axis_record import Series, Stretch
from hindrax_ident.tuning import Tuning

BEFORE_BLOCKED_S = 2.0
"""What led to a thrust without motion is no free motion either; the pilot says it after a second and a half."""


@dataclass(slots=True)
class PhaseLog:
    """Changes of motion and phase, with their times [s]."""

    changes: list[tuple[float, str, str]]
    last_s: float = 0.0

    def add(self, t_s: float, motion: str, phase: str) -> None:
        """Add the motion and phase from this time on; a blocked one has begun before."""
        if phase == BLOCKED:
            t_s -= BEFORE_BLOCKED_S
            self.changes = [one for one in self.changes if one[0] < t_s]
        self.changes.append((t_s, motion, phase))
        self.last_s = max(self.last_s, t_s)

    def stretches(
        self, motions: Sequence[str], phases: Sequence[str], end_s: float, join_s: float = 0.0
    ) -> list[Stretch]:
        """Spans of the given motions and phases; spans up to `join_s` apart are joined."""
        ordered = sorted(self.changes)
        ends = [*(t for t, _, _ in ordered[1:]), end_s]
        spans: list[Stretch] = []
        for (start, motion, phase), end in zip(ordered, ends, strict=True):
            if motion not in motions or phase not in phases or end <= start:
                continue
            if spans and start - spans[-1].end_s <= join_s:
                spans[-1] = Stretch(spans[-1].start_s, end, motion, phase)
            else:
                spans.append(Stretch(start, end, motion, phase))
        return spans


def usable(spans: Sequence[Stretch], measured: Array, thrust: Series, tuning: Tuning) -> tuple[Stretch, ...]:
    """Cut spans where measurements pause or thrust is unknown, and into pieces within the longest length."""
    if not len(thrust) or not len(measured):
        return ()
    last = np.searchsorted(thrust.t, measured, side="right") - 1
    fresh = (last >= 0) & (measured - thrust.t[np.maximum(last, 0)] <= tuning.thrust_age_s)
    times = measured[fresh]
    pieces: list[Stretch] = []
    for span in spans:
        inside = times[(times >= span.start_s) & (times <= span.end_s)]
        for run in np.split(inside, np.flatnonzero(np.diff(inside) > tuning.gap_s) + 1):
            pieces += _cut(run, span, tuning.stretch_s)
    return tuple(pieces)


def _cut(times: Array, span: Stretch, longest_s: float) -> list[Stretch]:
    """Pieces with equal numbers of samples, none longer than `longest_s` at regular sampling."""
    if len(times) < 2:
        return []
    count = max(1, math.ceil(float(times[-1] - times[0]) / longest_s))
    parts = [part for part in np.array_split(times, count) if len(part) > 1]
    return [Stretch(float(part[0]), float(part[-1]), span.motion, span.phase) for part in parts]
