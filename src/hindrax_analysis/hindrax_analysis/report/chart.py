"""A chart as inline SVG: it takes its colors from the page, so it fits light, dark and paper without a second drawing.

A chart is layers over two axes. Every layer has a role (measured, model, truth, ...), which is a CSS class; the page
gives each role one color everywhere, and the legend under the chart names the roles that occur.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal, TypeAlias

import numpy as np

from hindrax_ident.arrays import Array, Index, array

MARGIN = 0.05
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
BUCKETS = 360
WIDTH, HEIGHT = 480.0, 300.0
LEFT, RIGHT, TOP, BOTTOM = 78.0, 18.0, 10.0, 44.0
MOST_POINTS = 700

Role: TypeAlias = Literal["measured", "model", "online", "plateau", "truth", "paper", "prior", "earlier", "limit"]


@dataclass(frozen=True, slots=True)
class Scale:
    """Linear map of [low, high] onto [start, end] of the drawing."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: Array | float) -> Array:
        """Coordinate of each value: (n,) [px], clipped far outside the drawing."""
        span = self.end - self.start
        place = self.start + (np.asarray(value, float) - self.low) / (self.high - self.low) * span
        return array(np.clip(place, min(self.start, self.end) - 4e3, max(self.start, self.end) + 4e3))


def data_range(parts: Sequence[Array], *, margin: float = MARGIN) -> tuple[float, float]:
    """Range of all finite numbers, with a margin; never of zero width."""
    known = np.concatenate([np.ravel(part) for part in parts]) if parts else np.zeros(0)
    known = known[np.isfinite(known)]
    if not len(known):
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    room = (high - low) * margin if high > low else max(1e-9, 0.5 * abs(high))
    return low - room, high + room


def ticks(low: float, high: float, wanted: int = 5) -> list[float]:
    """Round numbers within a range.

    Parameters
    ----------
    low, high
        Ends.
    wanted
        About so many.

    Returns
    -------
    list[float]
        Multiples of 1, 2, 2.5 or 5 times a power of ten.
    """
    raw = (high - low) / max(1, wanted)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * one for one in ROUND_STEPS if power * one >= raw * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def tick_text(value: float, marks: Sequence[float]) -> str:
    """Shortest text that distinguishes the ticks of an axis, with a true minus sign."""
    largest = max((abs(mark) for mark in marks), default=0.0)
    step = min((b - a for a, b in itertools.pairwise(marks)), default=1.0)
    if largest >= 1e5 or 0.0 < largest < 1e-3:
        apart = 2 + math.floor(math.log10(largest)) - math.floor(math.log10(step))
        return f"{value:.{max(3, apart)}g}".replace("-", "\u2212")
    digits = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0.0 else 0
    digits += 0 if step <= 0.0 or math.isclose(round(step, digits), step, rel_tol=1e-6) else 1
    return f"{value:.{digits}f}".replace("-", "\u2212")


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """First, last, least and greatest point of each bucket, in order: (m,) each; the line looks the same."""
    if len(x) <= 4 * BUCKETS:
        return x, y
    edges = np.linspace(0, len(x), BUCKETS + 1).astype(int)
    keep: list[int] = []
    for a, b in itertools.pairwise(edges.tolist()):
        part = np.where(np.isfinite(y[a:b]), y[a:b], 0.0)
        keep += sorted({a, a + int(part.argmin()), a + int(part.argmax()), b - 1})
    index = np.array(sorted(set(keep)))
    return x[index], y[index]


def evenly_chosen(count: int, most: int) -> Index:
    """Indices of at most `most` of `count` points, evenly spaced: (m,)."""
    index: Index = np.unique(np.linspace(0, max(0, count - 1), min(count, most)).astype(np.intp))
    return index


@dataclass(frozen=True, slots=True)
class Layer:
    """Numbers y over x, (n,) each, in the color of a role; `variant` is a further CSS class, such as dashed or faint.

    Without a `label` it is not in the legend.
    """

    x: Array
    y: Array
    role: Role
    label: str = ""
    variant: str = ""

    @property
    def css(self) -> str:
        """CSS classes of the drawing and of its key in the legend."""
        return f"{type(self).__name__.lower()} {self.role} {self.variant}".rstrip()


class Line(Layer):
    """A line through points, interrupted at values that are not finite."""


@dataclass(frozen=True, slots=True)
class Points(Layer):
    """Dots; `small` ones for many samples."""

    small: bool = False


class Stems(Layer):
    """Vertical strokes from zero, for an autocorrelation."""


class Band(Layer):
    """The area between two lines, the rows of y: (2, n)."""


class Bars(Layer):
    """A histogram: edges x (n + 1,), heights y (n,)."""


@dataclass(frozen=True, slots=True)
class Chart:
    """Layers, labels and units of the axes, and the caption. Ranges follow from the layers by default."""

    title: str
    x_label: str
    y_label: str
    caption: str
    layers: tuple[Layer, ...]
    y_range: tuple[float, float] | None = None
    zero: bool = True


def figure(chart: Chart) -> str:
    """HTML of a chart: heading, drawing, legend, caption."""
    return (
        f"<figure><h3>{escape(chart.title)}</h3>{drawing(chart)}{_legend(chart)}"
        f"<figcaption>{escape(chart.caption)}</figcaption></figure>"
    )


def drawing(chart: Chart) -> str:
    """SVG of a chart."""
    x_range = data_range([layer.x for layer in chart.layers], margin=0.02)
    y_range = chart.y_range or data_range([_with_base(layer) for layer in chart.layers])
    sx = Scale(*x_range, LEFT, WIDTH - RIGHT)
    sy = Scale(*y_range, HEIGHT - BOTTOM, TOP)
    body = "".join(_drawn(layer, sx, sy) for layer in chart.layers)
    # A nested SVG clips to the frame without an identifier, which would have to be unique in the page.
    frame = f"{LEFT} {TOP} {WIDTH - LEFT - RIGHT} {HEIGHT - TOP - BOTTOM}"
    x, y, width, height = frame.split()
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(chart.title)}">{_axes(chart, sx, sy)}'
        f'<svg x="{x}" y="{y}" width="{width}" height="{height}" viewBox="{frame}">{body}</svg></svg>'
    )


def _axes(chart: Chart, sx: Scale, sy: Scale) -> str:
    parts = []
    marks = ticks(sy.low, sy.high)
    for mark in marks:
        y = float(sy(mark))
        kind = "zero" if mark == 0.0 and chart.zero else "grid"
        parts.append(
            f'<line class="{kind}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick_text(mark, marks)}</text>'
        )
    across = x_axis(sx, chart.x_label, (TOP, HEIGHT - BOTTOM), 6, zero=sx.low < 0.0 and chart.zero)
    middle = 0.5 * (TOP + HEIGHT - BOTTOM)
    return (
        f'{"".join(parts)}{across}<text class="label" transform="translate(14 {middle:.0f}) rotate(-90)" '
        f'text-anchor="middle">{escape(chart.y_label)}</text>'
    )


def x_axis(scale: Scale, label: str, span: tuple[float, float], wanted: int, *, zero: bool = False) -> str:
    """Vertical lines over a span at round numbers, which stand below it, and the label.

    Parameters
    ----------
    scale
        From values to pixels.
    label
        With its unit.
    span : [pixels]
        Top and bottom.
    wanted
        About so many lines.
    zero
        Whether the line of zero stands out.

    Returns
    -------
    str
        SVG.
    """
    top, bottom = span
    parts, marks = [], ticks(scale.low, scale.high, wanted)
    for mark in marks:
        x = float(scale(mark))
        kind = "zero" if mark == 0.0 and zero else "grid"
        parts.append(
            f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{bottom}"/><text class="tick" '
            f'x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{tick_text(mark, marks)}</text>'
        )
    middle, below = 0.5 * (scale.start + scale.end), bottom + BOTTOM - 8
    parts.append(f'<text class="label" x="{middle:.0f}" y="{below:.0f}" text-anchor="middle">{escape(label)}</text>')
    return "".join(parts)


def _with_base(layer: Layer) -> Array:
    """Values that the range along y includes, in the unit of the axis: bars and stems stand on zero."""
    return np.append(layer.y, 0.0) if isinstance(layer, Bars | Stems) else layer.y


def _drawn(layer: Layer, sx: Scale, sy: Scale) -> str:
    if isinstance(layer, Line):
        return f'<path class="{layer.css}" d="{_path(*thinned(layer.x, layer.y), sx, sy)}"/>'
    if isinstance(layer, Band):
        return _band(layer, sx, sy)
    if isinstance(layer, Points):
        keep = evenly_chosen(len(layer.x), MOST_POINTS)
        size = 3.2 if layer.small else 7.2
        dots = zip(sx(layer.x[keep]).tolist(), sy(layer.y[keep]).tolist(), strict=True)
        # A stroke of no length with round ends is a dot: one path instead of hundreds of circles.
        marks = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in dots)
        return f'<path class="dots {layer.role}" stroke-width="{size:g}" d="{marks}"/>'
    if isinstance(layer, Bars):
        return _bars(layer, sx, sy)
    base = float(sy(0.0))
    pairs = zip(sx(layer.x).tolist(), sy(layer.y).tolist(), strict=True)
    strokes = "".join(f"M{x:.1f} {base:.1f}V{y:.1f}" for x, y in pairs)
    return f'<path class="stem {layer.role}" d="{strokes}"/>'


def _path(x: Array, y: Array, sx: Scale, sy: Scale) -> str:
    known = np.isfinite(x) & np.isfinite(y)
    words, pen = [], "M"
    for ok, px, py in zip(known.tolist(), sx(x).tolist(), sy(y).tolist(), strict=True):
        if ok:
            words.append(f"{pen}{px:.1f} {py:.1f}")
        pen = "L" if ok else "M"
    return "".join(words)


def _band(layer: Band, sx: Scale, sy: Scale) -> str:
    known = np.flatnonzero(np.isfinite(layer.y).all(axis=0))
    if not len(known):
        return ""
    index = known[evenly_chosen(len(known), MOST_POINTS)]
    low, high = layer.y[:, index]
    x, y = np.concatenate([layer.x[index], layer.x[index][::-1]]), np.concatenate([high, low[::-1]])
    return f'<path class="{layer.css}" d="{_path(x, y, sx, sy)}Z"/>'


def _bars(layer: Bars, sx: Scale, sy: Scale) -> str:
    base, edges = float(sy(0.0)), sx(layer.x).tolist()
    rects = []
    for a, b, top in zip(edges[:-1], edges[1:], sy(layer.y).tolist(), strict=True):
        rects.append(
            f'<rect x="{a + 0.5:.1f}" y="{top:.1f}" width="{max(0.5, b - a - 1):.1f}" height="{base - top:.1f}"/>'
        )
    return f'<g class="{layer.css}">{"".join(rects)}</g>'


def _legend(chart: Chart) -> str:
    keys = [(layer.css, escape(layer.label)) for layer in chart.layers if layer.label]
    rows = [f'<span><i class="key {css}"></i>{label}</span>' for css, label in keys]
    return f'<p class="legend">{"".join(rows)}</p>' if len(rows) > 1 else ""
