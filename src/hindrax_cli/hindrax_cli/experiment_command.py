"""Shared by the bench experiment commands: options, reading a record, saving a plot."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hindrax_bag.read.bag_reader import is_bag
from hindrax_bag.read.message_columns import series
from hindrax_cli.argument_types import add_json, positive
from hindrax_cli.command import Declare, option
from hindrax_core.errors import UsageError, cause
from hindrax_core.events import NS_PER_S
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.text.text_file import nothing_left, require_place, writing
from hindrax_ident.arrays import Array
from hindrax_laboratory.experiment_record import Column, describe, read_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOT_KINDS = (".png", ".svg", ".pdf")


DENSITY = option("--density", type=positive, default=1000.0, metavar="KG_PER_M3", help="water [kg/m^3]")


def add_output(parser: argparse.ArgumentParser) -> None:
    """Options of every experiment: --plot and --json."""
    parser.add_argument("--plot", type=Path, metavar="FILE", help=f"save a plot ({', '.join(PLOT_KINDS)})")
    add_json(parser)


def require_plot(path: Path | None) -> None:
    """UsageError where a picture is wanted of a kind, or at a place, that cannot be written."""
    if path is None:
        return
    if path.suffix.lower() not in PLOT_KINDS:
        raise UsageError(f"--plot {path}: found {path.suffix or 'no ending'}, wanted one of {', '.join(PLOT_KINDS)}")
    require_place(path, "--plot ")


def record(columns: Sequence[Column], nargs: str | None = None) -> Declare:
    """The record itself (one, or as many as `nargs` says), and where in a bag its columns are."""

    def declare(parser: argparse.ArgumentParser) -> None:
        what = "CSV file with a header line, or a bag with --field"
        parser.add_argument("record", type=Path, nargs=nargs, metavar="CSV_OR_BAG", help=what)
        where = "field of a bag for a column, e.g. load_N=/load_cell:wrench.force.x"
        parser.add_argument("--field", action="append", default=[], metavar="COLUMN=TOPIC:PATH", help=where)
        parser.description = f"{parser.description}\n\ncolumns of the record:\n{describe(columns)}"

    return declare


def read_record(path: Path, columns: Sequence[Column], fields: Sequence[str]) -> dict[str, Array]:
    """Read columns of a record.

    Parameters
    ----------
    path
        CSV file, or a bag.
    columns
        Names and units.
    fields
        COLUMN=TOPIC:PATH of a bag; empty: it is no bag.

    Returns
    -------
    dict[str, Array]
        By name, each (n,) in SI.

    Raises
    ------
    UsageError
        Where it cannot be read, or a bag has no fields named.
    """
    if fields:
        return _read_bag(path, fields, columns)
    if is_bag(path):
        raise UsageError(f"{path}: is a bag; name its columns with --field COLUMN=TOPIC:PATH")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read ({cause(error)})") from error
    return read_columns(text, columns, str(path))


def _read_bag(path: Path, fields: Sequence[str], columns: Sequence[Column]) -> dict[str, Array]:
    """Columns by name, each (n,) in SI, from message fields; interpolated to the time base of the first field."""
    names, places = zip(*(_place(field, columns) for field in fields), strict=True)
    found = series(path, places)
    start = found[0].stamps[0]
    times = [(np.array(one.stamps) - start) / NS_PER_S for one in found]
    values = (np.interp(times[0], time, np.array(one.values)) for time, one in zip(times, found, strict=True))
    return {"time_s": times[0], **dict(zip(names, values, strict=True))}


def _place(field: str, columns: Sequence[Column]) -> tuple[str, str]:
    """Column, and `TOPIC:PATH` with the numbers of elements in brackets."""
    column, _, where = field.partition("=")
    topic, _, words = where.partition(":")
    if not (column and topic and words):
        raise UsageError(f"--field {field}: wanted COLUMN=TOPIC:PATH")
    if column not in [known.name for known in columns]:
        raise UsageError(f"--field {field}: no column {column}; there are {', '.join(known.name for known in columns)}")
    return column, re.sub(r"\.(\d+)", r"[\1]", where)


def save_plot(path: Path | None, draw: Callable[..., Figure], *data: object) -> None:
    """Save a drawing when it is asked for; UsageError where that cannot be.

    Parameters
    ----------
    path
        File, whose suffix names the format; None: no drawing.
    draw, *data
        What draws, and its arguments.
    """
    require_plot(path)
    if path is None:
        return
    figure = draw(*data)
    with writing(f"--plot {path}", "name another place"), nothing_left(path):
        figure.savefig(path)
    print_stderr(f"plot: {path}")
