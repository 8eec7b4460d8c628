"""What the bench experiment commands share: reading a record, printing a result, saving a plot."""

from __future__ import annotations

import argparse
import importlib
import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hindrax_bag.reader import messages
from hindrax_core.errors import HindraxError, UsageError
from hindrax_ident.bench.plain import plain
from hindrax_ident.bench.record import Column, describe, read_columns
from hindrax_ident.bench.regression import Array, Value

PLOT_KINDS = (".png", ".svg", ".pdf")


def add_output(parser: argparse.ArgumentParser) -> None:
    """Options of every experiment: --plot and --json."""
    parser.add_argument("--plot", type=Path, metavar="FILE", help=f"save a plot ({', '.join(PLOT_KINDS)})")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")


def add_record(parser: argparse.ArgumentParser, columns: Sequence[Column], nargs: str | None = None) -> None:
    """The record itself (one, or as many as `nargs` says), and where in a bag its columns are."""
    what = "CSV file with a header line, or a bag with --field"
    parser.add_argument("record", type=Path, nargs=nargs, metavar="CSV_OR_BAG", help=what)
    parser.add_argument(
        "--field",
        action="append",
        default=[],
        metavar="COLUMN=TOPIC:PATH",
        help="where a column is in a bag, e.g. acceleration_mps2=/icm20948/imu:linear_acceleration.z",
    )
    parser.description = f"{parser.description}\n\ncolumns of the record:\n{describe(columns)}"


def read_record(path: Path, columns: Sequence[Column], fields: Sequence[str]) -> dict[str, Array]:
    """Columns of a CSV file, or of a bag where fields are given. UsageError when the file cannot be read."""
    if fields:
        return _read_bag(path, fields, columns)
    if path.is_dir() or path.suffix == ".mcap":
        raise UsageError(f"{path}: is a bag; say with --field COLUMN=TOPIC:PATH where its columns are")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read ({error})") from error
    return read_columns(text, columns, str(path))


def _read_bag(path: Path, fields: Sequence[str], columns: Sequence[Column]) -> dict[str, Array]:
    """Columns from the fields of messages; all on the time base of the first field, others interpolated."""
    places = [_place(field, columns) for field in fields]
    series: dict[str, tuple[list[float], list[float]]] = {column: ([], []) for column, _, _ in places}
    for message in messages(path, {topic for _, topic, _ in places}):
        content = message.decoded()
        for column, topic, words in places:
            if topic == message.topic:
                series[column][0].append(_stamp_s(content, message.received))
                series[column][1].append(_follow(content, words, f"{path}, {topic}"))
    empty = [topic for column, topic, _ in places if not series[column][0]]
    if empty:
        raise HindraxError(f"{path}: no message on {empty[0]}; `hindrax bag info {path}` lists the topics")
    start = series[places[0][0]][0]
    time = np.array(start) - start[0]
    record = {"time_s": time}
    for column, (stamps, values) in series.items():
        record[column] = np.interp(time, np.array(stamps) - start[0], np.array(values))
    return record


def _place(field: str, columns: Sequence[Column]) -> tuple[str, str, list[str]]:
    column, _, where = field.partition("=")
    topic, _, words = where.partition(":")
    if not (column and topic and words):
        raise UsageError(f"--field {field}: wanted COLUMN=TOPIC:PATH")
    if column not in [known.name for known in columns]:
        raise UsageError(f"--field {field}: no column {column}; there are {', '.join(known.name for known in columns)}")
    return column, topic, words.split(".")


def _stamp_s(content: Any, received_ns: int) -> float:
    """Time of the measurement where the message has a header, else of receipt."""
    header = getattr(content, "header", None)
    return header.stamp.sec + 1e-9 * header.stamp.nanosec if header is not None else 1e-9 * received_ns


def _follow(content: Any, words: Sequence[str], where: str) -> float:
    for word in words:
        try:
            content = content[int(word)] if word.isdigit() else getattr(content, word)
        except (AttributeError, IndexError, TypeError):
            raise HindraxError(f"{where}: no field {'.'.join(words)} (stopped at {word})") from None
    return float(content)


def save_plot(path: Path | None, name: str, *data: Any) -> None:
    """Draw and save `hindrax_ident.bench.plots.NAME(*data)` when asked to; the kind follows from the file's name.

    UsageError for a kind that cannot be written. Imported here: matplotlib takes long, and only --plot needs it.
    """
    if path is None:
        return
    if path.suffix.lower() not in PLOT_KINDS:
        raise UsageError(f"--plot {path}: found {path.suffix or 'no ending'}, wanted one of {', '.join(PLOT_KINDS)}")
    figure = getattr(importlib.import_module("hindrax_ident.bench.plots"), name)(*data)
    try:
        figure.savefig(path)
    except OSError as error:
        raise UsageError(f"--plot {path}: cannot be written ({error})") from error
    print(f"plot: {path}", file=sys.stderr)


def print_json(document: Mapping[str, object] | object) -> None:
    """One JSON document on stdout; what is not a number is null."""
    print(json.dumps(plain(document), indent=2, allow_nan=False))


def console() -> Console:
    """Console of stdout; wide where nobody watches, so that a pipe or a file gets whole lines."""
    return Console(width=None if sys.stdout.isatty() else 160)


def make_table(title: str, words: Sequence[str], numbers: Sequence[str], last: Sequence[str] = ()) -> Table:
    """Table with columns for words (left), numbers (right) and words again; brackets in headings are text."""
    table = Table(title=escape(title), title_justify="left")
    for heading in words:
        table.add_column(escape(heading))
    for heading in numbers:
        table.add_column(escape(heading), justify="right")
    for heading in last:
        table.add_column(escape(heading))
    return table


def print_values(title: str, rows: Sequence[tuple[str, object, str]]) -> None:
    """Table of name, value (with its standard deviation where it has one) and unit."""
    table = make_table(title, ["what"], ["value", "std"], ["unit"])
    for name, value, unit in rows:
        number, spread = (value.value, value.std) if isinstance(value, Value) else (value, None)
        table.add_row(name, _text(number), _text(spread), unit)
    console().print(table)


def _text(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def positive(text: str) -> float:
    """Argument type: a finite number above zero."""
    number = float(text)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return number


def pace(text: str) -> float:
    """Argument type: times real time, 0 for no bound."""
    number = float(text)
    if not (math.isfinite(number) and number >= 0.0):
        raise argparse.ArgumentTypeError(f"found {text}, wanted 0 (no bound) or more")
    return number


def seed(text: str) -> int:
    """Argument type: seed of everything random; goals carry it in 32 bits."""
    number = int(text)
    if not 0 <= number < 1 << 32:
        raise argparse.ArgumentTypeError(f"found {text}, wanted 0 to {(1 << 32) - 1}")
    return number
