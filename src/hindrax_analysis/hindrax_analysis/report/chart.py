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
    """Round numbers within a range, about as many as wanted."""
    raw = (high - low) / max(1, wanted)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * one for one in ROUND_STEPS if power * one >= raw * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [0.0 if n == 0 else n * step for n in range(first, last + 1)]


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
class Series:
    """Numbers over a coordinate, (n,) each. Without a `label` it is not in the legend."""

    x: Array
    y: Array
    role: Role
    label: str = ""


@dataclass(frozen=True, slots=True)
class Line(Series):
    """A line through points, interrupted at values that are not finite."""

    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Points(Series):
    """Dots; `small` ones for many samples."""

    small: bool = False


class Stems(Series):
    """Vertical strokes from zero, for an autocorrelation."""


@dataclass(frozen=True, slots=True)
class Band:
    """The area between two lines; the outer of two bands is `faint`."""

    x: Array
    low: Array
    high: Array
    role: Role
    label: str = ""
    faint: bool = False


@dataclass(frozen=True, slots=True)
class Bars:
    """A histogram: edges (n + 1,), heights (n,)."""

    edges: Array
    heights: Array
    role: Role
    label: str = ""


Layer: TypeAlias = Line | Band | Points | Bars | Stems


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
        f"<figure><h4>{escape(chart.title)}</h4>{drawing(chart)}{_legend(chart)}"
        f"<figcaption>{escape(chart.caption)}</figcaption></figure>"
    )


def drawing(chart: Chart) -> str:
    """SVG of a chart."""
    x_range = data_range([xs(layer) for layer in chart.layers], margin=0.02)
    y_range = chart.y_range or data_range([ys(layer) for layer in chart.layers])
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
    """Vertical lines over the span from top to bottom at round numbers, which stand below it, and the label."""
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


def xs(layer: Layer) -> Array:
    """Coordinates along x: (n,), in the unit of the axis."""
    return layer.edges if isinstance(layer, Bars) else layer.x


def ys(layer: Layer) -> Array:
    """Coordinates along y that the range includes: (n,), in the unit of the axis."""
    if isinstance(layer, Band):
        return np.concatenate([layer.low, layer.high])
    if isinstance(layer, Bars):
        return np.append(layer.heights, 0.0)
    return np.append(layer.y, 0.0) if isinstance(layer, Stems) else layer.y


def _drawn(layer: Layer, sx: Scale, sy: Scale) -> str:
    if isinstance(layer, Line):
        dash = " dashed" if layer.dashed else ""
        return f'<path class="line {layer.role}{dash}" d="{_path(*thinned(layer.x, layer.y), sx, sy)}"/>'
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
    known = np.isfinite(layer.low) & np.isfinite(layer.high)
    index = np.flatnonzero(known)[evenly_chosen(int(known.sum()), MOST_POINTS)] if known.any() else np.zeros(0, int)
    if not len(index):
        return ""
    x = np.concatenate([layer.x[index], layer.x[index][::-1]])
    y = np.concatenate([layer.high[index], layer.low[index][::-1]])
    return f'<path class="band {layer.role}{" faint" if layer.faint else ""}" d="{_path(x, y, sx, sy)}Z"/>'


def _bars(layer: Bars, sx: Scale, sy: Scale) -> str:
    base, edges = float(sy(0.0)), sx(layer.edges).tolist()
    rects = []
    for a, b, top in zip(edges[:-1], edges[1:], sy(layer.heights).tolist(), strict=True):
        rects.append(
            f'<rect x="{a + 0.5:.1f}" y="{top:.1f}" width="{max(0.5, b - a - 1):.1f}" height="{base - top:.1f}"/>'
        )
    return f'<g class="bars {layer.role}">{"".join(rects)}</g>'


def _legend(chart: Chart) -> str:
    rows = []
    for layer in chart.layers:
        kind = f"{type(layer).__name__.lower()} {layer.role}"
        kind += " faint" if isinstance(layer, Band) and layer.faint else ""
        kind += " dashed" if isinstance(layer, Line) and layer.dashed else ""
        rows += [f'<span><i class="key {kind}"></i>{escape(layer.label)}</span>'] if layer.label else []
    return f'<p class="legend">{"".join(rows)}</p>' if len(rows) > 1 else ""
