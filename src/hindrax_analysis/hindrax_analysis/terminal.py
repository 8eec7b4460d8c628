"""Results on the terminal: tables, values with their units, or one JSON document."""

import io
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from textwrap import TextWrapper
from typing import TextIO

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column, Table
from rich.text import Text

from hindrax_analysis.plain import print_json
from hindrax_core.text.digits import Value, rounded
from hindrax_core.text.screen_text import UNBOUNDED, fitted, print_fitted, print_whole, printable

NO_BREAK = "\0"
PROSE_WIDTH = 24
"""Least width of a column of sentences."""
NAME_WIDTH = 12
"""Least width of a column of names that wrap."""


class _Console(Console):
    """A console that leaves a closed pipe to the command: rich would end it with exit code 1."""

    def on_broken_pipe(self) -> None:
        raise  # noqa: PLE0704  # rich calls this while it handles the error


def console() -> Console:
    """Console of stdout; off a terminal as wide as what is printed, so that a pipe or a file gets whole lines."""
    return _Console(width=None if sys.stdout.isatty() else UNBOUNDED)


def screen_rows() -> int:
    """Lines that fit on the screen of stdout above its prompt; UNBOUNDED off a terminal."""
    return console().height - 1 if sys.stdout.isatty() else UNBOUNDED


class _Page(io.StringIO):
    """What is printed before it is shown: as wide, and as much of a terminal, as where it will be shown."""

    def __init__(self, shown: TextIO) -> None:
        super().__init__()
        self._shown = shown

    def isatty(self) -> bool:
        return self._shown.isatty()

    def fileno(self) -> int:
        return self._shown.fileno()


def print_what_fits(*ways: Callable[[], object], above: int = 0) -> None:
    """Print the first of several ways for which the screen has lines enough, or the last of them.

    Parameters
    ----------
    *ways
        Each prints the same result on stdout, the longest first. Off a terminal there is room for the first.
    above
        Lines already on the screen that belong to it.
    """
    text = ""
    for way in ways:
        with redirect_stdout(_Page(sys.stdout)) as page:
            way()
        text = page.getvalue()
        if text.count("\n") <= screen_rows() - above:
            break
    print_whole(text, end="")


def print_answer(document: Mapping[str, object] | object, text: object, *, as_json: bool) -> int:
    """Print one JSON document, or a text for people.

    Parameters
    ----------
    document
        What a program reads.
    text
        A sentence, or a function that prints.
    as_json
        Which of the two.

    Returns
    -------
    int
        Exit code of success.
    """
    if as_json:
        print_json(document)
    elif callable(text):
        text()
    else:
        print_fitted(text)
    return 0


@contextmanager
def working(sentence: str) -> Iterator[Callable[[object], None]]:
    """Tell on a terminal what is being computed and for how long. A file or a pipe gets nothing.

    Parameters
    ----------
    sentence
        What is computed.

    Yields
    ------
    Callable[[object], None]
        To be called with how far it is.
    """
    shown = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    screen = Console(stderr=True)
    quiet = not sys.stderr.isatty()
    with Progress(
        *shown, console=screen, transient=True, refresh_per_second=4, redirect_stdout=False, disable=quiet
    ) as progress:
        task = progress.add_task(sentence, total=None)
        yield lambda reached: progress.update(task, description=f"{sentence}: {reached}")


class ResultTable(Table):
    """A table that can do without some of its columns, and may show the name of a group once."""

    spare: Sequence[str] = ()
    """Headings of columns that a narrow screen does without, the first to go last."""
    grouped = False
    """Whether rows with the same first cell are a group."""
    dense = False
    """Whether no lines are drawn, to be one line shorter."""


def print_table(
    title: str,
    words: Sequence[str],
    numbers: Sequence[str],
    rows: Iterable[Sequence[object]],
    prose: Sequence[str] = (),
    *,
    spare: Sequence[str] = (),
    grouped: bool = False,
    dense: bool = False,
) -> list[str]:
    """Print rows below their headings.

    Brackets are text, also in a cell; a Text keeps its style, a float has five digits, None and NaN are empty.

    Parameters
    ----------
    title
        Above it.
    words, numbers, prose
        Headings of columns that begin at the left, end at the right, and may wrap.
    rows
        A cell for each heading.
    spare
        Headings that a screen that is too narrow does without, the last first.
    grouped
        Whether the first cell names a group.
    dense
        Whether it is drawn without lines, for a screen that is full.

    Returns
    -------
    list[str]
        Headings that were left out.
    """
    table = ResultTable(title=printable(title))
    table.spare, table.grouped, table.dense = spare, grouped, dense
    for heading in words:
        table.add_column(Text(heading), no_wrap=True)
    for heading in numbers:
        table.add_column(Text(heading), justify="right", no_wrap=True)
    for heading in prose:
        table.add_column(Text(heading))
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(printable(_text(cell))) for cell in row))
    return _print_whole_or_stacked(table)


def _print_whole_or_stacked(table: ResultTable) -> list[str]:
    """Print a table; on a narrow screen with fewer columns, else row by row. Returns the headings left out."""
    screen = console()
    # A column without remarks would be a stripe of nothing.
    table.columns = [column for column in table.columns if any(column.cells) or (column.header and column.no_wrap)]
    present = [name for name in table.spare if any(str(column.header) == name for column in table.columns)]
    # First headings get several lines, then columns go, then names wrap, and at last the table falls into lines.
    steps = [(count, True, False) for count in range(len(present), -1, -1)]
    for count, broken, folded in ((len(present), False, False), *steps, (0, True, True)):
        shown = _narrowed(table, present[count:], broken=broken, folded=folded)
        if _least_width(shown) <= screen.width:
            if table.title:
                screen.print(Text(fitted(str(table.title), screen.width), style="table.title"))
            screen.print(shown)
            if present[count:]:
                print_fitted(f"(no room here for: {', '.join(present[count:])}; a wider screen shows it)")
            return present[count:]
    lines = [fitted(str(table.title), screen.width)] if table.title else []
    for cells in zip(*(column.cells for column in table.columns), strict=True):
        lines += _stacked(table.columns, [str(cell) for cell in cells], screen.width)
    print_whole("\n".join(lines))
    return []


def _narrowed(table: ResultTable, left_out: Sequence[str], *, broken: bool, folded: bool) -> Table:
    """The same table without some columns, each group named once.

    `broken`: long headings have several lines; `folded`: long names too.
    """
    made = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0)) if table.dense else Table(show_edge=False)
    columns = [column for column in table.columns if str(column.header) not in left_out]
    for column in columns:
        heading = _broken(column) if broken and column.no_wrap else column.header
        name = folded and column.no_wrap and column.justify == "left"
        least = _least_of_name(column) if name else None
        made.add_column(heading, justify=column.justify, no_wrap=column.no_wrap and not name, min_width=least)
    before = ""
    for first, *others in zip(*(column.cells for column in columns), strict=True):
        repeated = table.grouped and str(first) == before
        before = str(first)
        made.add_row(Text() if repeated else first, *others)
    return made


def _least_of_name(column: Column) -> int:
    """Width of a column of names that wrap: as wide as its longest word, and no wider than its longest name."""
    cells = [str(one) for one in (*column.cells, *str(column.header).split())]
    longest = max((len(word) for cell in cells for word in cell.split()), default=1)
    return min(max(map(len, cells), default=1), max(NAME_WIDTH, longest))


def _broken(column: Column) -> Text:
    """Heading of a column on as many lines as make it no wider than its cells, or its longest word."""
    words = str(column.header).split()
    width = max(map(len, (*words, *map(str, column.cells))), default=1)
    return Text("\n".join(TextWrapper(width, break_long_words=False, break_on_hyphens=False).wrap(" ".join(words))))


def _stacked(columns: Sequence[Column], cells: Sequence[str], width: int) -> list[str]:
    """One row on lines of its own: its columns of words are its name, then each value behind its heading.

    A heading with a unit is never left out.
    """
    words, pairs = [], []
    for column, cell in zip(columns, cells, strict=True):
        heading = str(column.header)
        if column.no_wrap and column.justify == "left" and "[" not in heading:
            words.append(cell)
        elif cell:
            pairs.append(f"{heading}: {cell}" if heading else cell)
    # A heading and its number stay on one line; sentences wrap.
    glued = [pair.replace(" ", NO_BREAK) if len(pair) <= width // 2 else pair for pair in pairs]
    wrap = TextWrapper(
        width, initial_indent="  ", subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    # Names that are too long side by side stand below each other.
    name = ["  ".join(words)] if len("  ".join(words)) <= width else words
    return [*(one for one in name if one), *(line.replace(NO_BREAK, " ") for line in wrap.wrap(";  ".join(glued)))]


def _least_width(table: Table) -> int:
    """Characters a line at which no name and no number is cut; prose counts with the least it is readable in."""
    wide = Console(width=UNBOUNDED)
    spare = 0
    for column in table.columns:
        if not column.no_wrap:
            widest = max((wide.measure(cell).maximum for cell in column.cells), default=0)
            spare += max(0, widest - (column.min_width or PROSE_WIDTH))
    return wide.measure(table).maximum - spare


def cells_of(value: Value) -> tuple[str, str]:
    """Value and standard deviation for a table; empty where unknown."""
    if math.isnan(value.std):
        return _text(value.value), ""
    return rounded(value.value, value.std)


def print_values(title: str, rows: Sequence[tuple[str, object, str]]) -> None:
    """Print a table of name, value (with its standard deviation, if any) and unit."""
    cells = [
        (name, *(cells_of(value) if isinstance(value, Value) else (value, "")), unit) for name, value, unit in rows
    ]
    print_table(title, ["quantity"], ["value", "std"], cells, ["unit"])


def _text(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.5g}" if isinstance(value, float) else str(value)
