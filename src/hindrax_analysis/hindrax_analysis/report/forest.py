"""Forest plot: one coefficient, one row per source, a dot with its 95 % interval each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from hindrax_analysis.report.chart import BOTTOM, WIDTH, Role, Scale, data_range, x_axis
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_ident.assess.results import Number

ROW = 26.0
LEFT, RIGHT, TOP = 148.0, 18.0, 6.0
MOST_LEFT = 0.55 * WIDTH
CHARACTER = 8.6
"""Width of a character of a name on a phone."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One row: a coefficient of one source."""

    label: str
    number: Number
    role: Role
    excluded: bool = False
    """Not identifiable: shown, but not included in the range."""


def forest(title: str, unit: str, entries: Sequence[Entry], caption: str, reference: float | None = None) -> str:
    """Plot one coefficient of several runs or methods below each other.

    Parameters
    ----------
    title, unit
        Of the coefficient.
    entries
        Value and intervals, one row each.
    caption
        Below the plot.
    reference
        Vertical line through all rows (the truth of the mock); None: none.

    Returns
    -------
    str
        HTML.
    """
    entries = [entry for entry in entries if math.isfinite(entry.number.value)]
    height = TOP + ROW * len(entries) + BOTTOM
    scale = _scale(entries, reference)
    line = ""
    if reference is not None:
        line = f'<path class="line truth dashed" d="M{float(scale(reference)):.1f} {TOP}V{height - BOTTOM:.1f}"/>'
    rows = "".join(_row(entry, TOP + ROW * (i + 0.5), scale) for i, entry in enumerate(entries))
    label = f"{title} [{unit}]" if unit else title
    return (
        f'<figure class="forest"><h3>{escape(title)}</h3><svg viewBox="0 0 {WIDTH:g} {height:g}" role="img" '
        f'aria-label="{escape(label)}">{x_axis(scale, label, (TOP, height - BOTTOM), 5)}{line}{rows}</svg>'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _scale(entries: Sequence[Entry], reference: float | None) -> Scale:
    """Scale that includes every identifiable value; much wider intervals are clipped at the frame."""
    longest = max((len(entry.label) for entry in entries), default=0)
    entries = [entry for entry in entries if not entry.excluded] or entries
    values = np.array([entry.number.quoted[0] for entry in entries] + ([reference] if reference is not None else []))
    own = np.array([entry.number.quoted[0] for entry in entries])
    ends = [
        [abs(end - x) for _, pair in _whiskers(entry.number) for end in pair]
        for entry, x in zip(entries, own, strict=True)
    ]
    reach = np.array([max(one, default=0.0) for one in ends])
    room = 1.2 * float(np.ptp(values)) + 4.0 * float(np.median(reach)) if len(reach) else 1.0
    shown = np.minimum(reach, room)
    left = min(MOST_LEFT, max(LEFT, 10.0 + CHARACTER * longest))
    return Scale(*data_range([values, own - shown, own + shown]), left, WIDTH - RIGHT)


def _whiskers(number: Number) -> list[tuple[str, tuple[float, float]]]:
    """95 % intervals of a coefficient: the outer one as quoted, the inner one of the noise, about the fit."""
    intervals = {"outer": (number.value, number.std_calibrated), "inner": (number.value, number.std)}
    known = {
        kind: (x - TWO_SIDED_95 * std, x + TWO_SIDED_95 * std)
        for kind, (x, std) in intervals.items()
        if math.isfinite(std) and std > 0.0
    }
    if number.corrected is not None:
        known["outer"] = number.corrected.interval95
    return list(known.items())


def _row(entry: Entry, y: float, scale: Scale) -> str:
    left, room = scale.start, scale.start - 10.0
    # A name that is too long even so is condensed.
    fit = f' textLength="{room:.0f}" lengthAdjust="spacingAndGlyphs"' if CHARACTER * len(entry.label) > room else ""
    name = f'<text class="name" x="{room:.0f}" y="{y + 4:.1f}" text-anchor="end"{fit}>{escape(entry.label)}</text>'
    parts = [name]
    for kind, pair in _whiskers(entry.number):
        a, b = (min(WIDTH - RIGHT, max(left, end)) for end in scale(np.array(pair)).tolist())
        parts.append(f'<path class="whisker {kind} {entry.role}" d="M{a:.1f} {y:.1f}H{b:.1f}"/>')
    x = float(scale(entry.number.quoted[0]))
    if left <= x <= WIDTH - RIGHT:
        parts.append(f'<path class="dots {entry.role}" stroke-width="9" d="M{x:.1f} {y:.1f}h0"/>')
    else:
        # An arrow on the side of a value outside the frame.
        tip, back = (WIDTH - RIGHT, -9.0) if x > left else (left, 9.0)
        parts.append(
            f'<path class="stem {entry.role}" d="M{tip + back:.1f} {y - 6:.1f}L{tip:.1f} {y:.1f}l{back:g} 6"/>'
        )
    return "".join(parts)
