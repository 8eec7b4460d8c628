"""Plots for the papers and the pool side: units on every axis, one color per meaning, no global state.

Each function returns a matplotlib Figure with the Agg canvas; the caller saves it (`figure.savefig(path)`).
matplotlib is imported by `new_figure`: it takes long, and only who draws waits for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hindrax_core.vehicle import AXES
from hindrax_ident.assess.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED = "#33658a"
MODEL = "#d1495b"
SECOND = "#6c9a3b"
BAND_ALPHA = 0.2


def new_figure(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Make a figure of rows x columns plots.

    Parameters
    ----------
    rows, columns
        Of plots.
    width, height : [inches]
        Of the figure.

    Returns
    -------
    tuple[Figure, list[Axes]]
        The figure, and its axes row by row.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # only who draws waits for it
    from matplotlib.figure import Figure  # noqa: PLC0415  # the same

    figure = Figure(figsize=(width, height), layout="constrained", dpi=120)
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(rows, columns, index + 1) for index in range(rows * columns)]
    for axis in axes:
        axis.grid(visible=True, color="0.9")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def label(axis: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes of a plot, and its title.

    Parameters
    ----------
    axis
        Of a plot.
    x, y
        With their units.
    title
        Empty: none.
    """
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.set_title(title, loc="left", fontsize=10)


def prediction(predictions: Sequence[Prediction]) -> Figure:
    """Measured and predicted motion over time, one plot per axis."""
    figure, rows = new_figure(len(predictions), 1, 9.0, 2.6 * len(predictions))
    for axis, one in zip(rows, predictions, strict=True):
        edges = np.flatnonzero(np.diff(one.window)) + 1
        axis.plot(one.t, one.measured, ".", markersize=2.0, color=MEASURED, label="measured")
        apart = [np.insert(values, edges, np.nan) for values in (one.t, one.predicted)]
        axis.plot(*apart, color=MODEL, label="predicted from the beginning of each window")
        label(axis, "time [s]", f"{AXES[one.axis]} [{one.unit}]")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8)
    return figure
