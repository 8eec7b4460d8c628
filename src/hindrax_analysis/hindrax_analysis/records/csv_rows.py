"""Rows of a CSV file of any origin, with the numbers of their lines."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence

from hindrax_core.errors import HindraxError

PREAMBLE = 40
"""Lines searched for the header line."""
Row = tuple[int, list[str]]
"""Line number, and its cells without spaces around them."""


def rows_of(text: str, source: str, is_header: Callable[[str], bool] = bool) -> list[Row]:
    """Row of the header line, or else of the first line, and of each line below it; none for a file without rows.

    Separators are comma, semicolon or tab, or spaces where there is no other; empty lines and those that begin with #
    are skipped. Where the comma does not separate it is that of decimals, and becomes a point.
    """
    numbered = [(n, line.lstrip("\ufeff")) for n, line in enumerate(text.splitlines(), start=1)]
    lines = [(n, line) for n, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    lines = lines[next((i for i, (_, line) in enumerate(lines[:PREAMBLE]) if is_header(line)), 0) :]
    try:
        cells = cells_of([line for _, line in lines])
    except csv.Error as error:
        raise HindraxError(f"{source}: is not CSV ({error})") from error
    if len(cells) != len(lines):
        raise HindraxError(f"{source}: a quotation mark is not closed, wanted one row per line")
    return [(n, row) for (n, _), row in zip(lines, cells, strict=True)]


def cells_of(lines: Sequence[str]) -> list[list[str]]:
    """Cells of each line, separated as in the first one."""
    first = next(iter(lines), "")
    found = max(",;\t", key=first.count)
    separator = found if found in first else " "
    spaced = separator == " "
    rows = csv.reader((line.strip() for line in lines) if spaced else lines, delimiter=separator, skipinitialspace=True)
    return [[(cell if separator == "," else cell.replace(",", ".")).strip() for cell in row] for row in rows]


def check_width(cells: Sequence[str], header: Sequence[str], where: str) -> None:
    """HindraxError for a row with more cells than the header line: its cells may be shifted."""
    if any(cells[len(header) :]):
        raise HindraxError(
            f"{where}: found {len(cells)} cells, wanted {len(header)} as in the header line; write decimals with a "
            "point, or separate the cells with semicolons"
        )
