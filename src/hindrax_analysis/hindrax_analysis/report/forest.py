"""Forest plot: one coefficient, one row per source, a dot with its 95 % band each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from hindrax_analysis.digits import TWO_SIDED_95
from hindrax_analysis.report.chart import WIDTH, Role
from hindrax_analysis.report.scale import Scale, data_range, tick_text, ticks
from hindrax_ident.arrays import Array

ROW = 26.0
LEFT, RIGHT, TOP, BOTTOM = 148.0, 14.0, 6.0, 42.0


@dataclass(frozen=True, slots=True)
class Entry:
    """One row: a value and its standard deviations (noise; with calibration), NaN where unknown."""

    label: str
    value: float
    std: float
    std_calibrated: float
    role: Role
    excluded: bool = False
    """Not identifiable: shown, but not included in the range."""


def forest(title: str, unit: str, entries: Sequence[Entry], caption: str, reference: float | None = None) -> str:
    """HTML of one coefficient; `reference` is a vertical line through all rows (the truth of the mock)."""
    entries = [entry for entry in entries if math.isfinite(entry.value)]
    height = TOP + ROW * len(entries) + BOTTOM
    scale = _scale(entries, reference)
    rows = "".join(_row(entry, TOP + ROW * (i + 0.5), scale) for i, entry in enumerate(entries))
    label = f"{title} [{unit}]" if unit else title
    return (
        f'<figure class="forest"><h4>{escape(title)}</h4><svg viewBox="0 0 {WIDTH:g} {height:g}" role="img" '
        f'aria-label="{escape(label)}">{_axis(scale, height, label)}{_reference(reference, scale, height)}{rows}</svg>'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _scale(entries: Sequence[Entry], reference: float | None) -> Scale:
    """Scale that includes every identifiable value; much wider bands are clipped at the frame."""
    entries = [entry for entry in entries if not entry.excluded] or entries
    values = np.array([entry.value for entry in entries] + ([reference] if reference is not None else []))
    reach = np.array([_reach(entry) for entry in entries])
    room = 1.2 * float(np.ptp(values)) + 4.0 * float(np.median(reach)) if len(reach) else 1.0
    ends: list[Array] = [values]
    for entry, wide in zip(entries, reach.tolist(), strict=True):
        ends.append(np.array([entry.value - min(wide, room), entry.value + min(wide, room)]))
    return Scale(*data_range(ends), LEFT, WIDTH - RIGHT)


def _reach(entry: Entry) -> float:
    known = [std for std in (entry.std, entry.std_calibrated) if math.isfinite(std)]
    return TWO_SIDED_95 * max(known, default=0.0)


def _axis(scale: Scale, height: float, label: str) -> str:
    marks = ticks(scale.low, scale.high, 5)
    bottom = height - BOTTOM
    parts = []
    for mark in marks:
        x = float(scale(mark))
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{bottom:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{bottom + 16:.1f}" text-anchor="middle">{tick_text(mark, marks)}</text>'
        )
    middle = 0.5 * (LEFT + WIDTH - RIGHT)
    parts.append(
        f'<text class="label" x="{middle:.0f}" y="{height - 8:.0f}" text-anchor="middle">{escape(label)}</text>'
    )
    return "".join(parts)


def _reference(value: float | None, scale: Scale, height: float) -> str:
    if value is None:
        return ""
    x = float(scale(value))
    return f'<path class="line truth dashed" d="M{x:.1f} {TOP}V{height - BOTTOM:.1f}"/>'


def _row(entry: Entry, y: float, scale: Scale) -> str:
    parts = [f'<text class="name" x="{LEFT - 10:.0f}" y="{y + 4:.1f}" text-anchor="end">{escape(entry.label)}</text>']
    for std, kind in ((entry.std_calibrated, "outer"), (entry.std, "inner")):
        if math.isfinite(std) and std > 0.0:
            ends = scale(np.array([entry.value - TWO_SIDED_95 * std, entry.value + TWO_SIDED_95 * std]))
            a, b = (min(WIDTH - RIGHT, max(LEFT, end)) for end in ends.tolist())
            parts.append(f'<path class="whisker {kind} {entry.role}" d="M{a:.1f} {y:.1f}H{b:.1f}"/>')
    x = float(scale(entry.value))
    if LEFT <= x <= WIDTH - RIGHT:
        parts.append(f'<path class="dots {entry.role}" stroke-width="9" d="M{x:.1f} {y:.1f}h0"/>')
    else:
        # An arrow on the side of a value outside the frame.
        tip, back = (WIDTH - RIGHT, -9.0) if x > LEFT else (LEFT, 9.0)
        parts.append(
            f'<path class="stem {entry.role}" d="M{tip + back:.1f} {y - 6:.1f}L{tip:.1f} {y:.1f}l{back:g} 6"/>'
        )
    return "".join(parts)
