"""Bench records in CSV: named columns, and errors that name line and column."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_analysis.records.csv.columns import check_width, rows_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_ident.arrays import Array

MOST_JITTER = 0.01
"""Deviation of a time step from the median, relative, up to which a record counts as evenly sampled."""

LONGEST_GAP = 10.0
"""Time step, in median steps, above which samples are missing and interpolation is not valid."""

LARGEST_QUANTITY = 1e12
"""No quantity of these experiments is as large in its unit, and squares of what is larger are no numbers."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a record: its name in the header line ends with the unit."""

    name: str
    meaning: str
    required: bool = True


def describe(columns: Sequence[Column]) -> str:
    """One line per column, for the help of a command."""
    return "\n".join(f"  {c.name:<20} {c.meaning}{'' if c.required else ' (optional)'}" for c in columns)


def read_columns(text: str, columns: Sequence[Column], source: str) -> dict[str, Array]:
    """Numbers of the named columns of a CSV file; other columns are ignored.

    Parameters
    ----------
    text
        The file.
    columns
        Those wanted; optional ones may be missing.
    source
        Its name, for errors.

    Returns
    -------
    dict[str, Array]
        (n,) each, by name, in the units of their names.

    Raises
    ------
    UsageError
        Names the source, the line, the column, what was found and what was wanted.
    """
    rows = rows_of(text, source)
    if not rows:
        wanted = ", ".join(column.name for column in columns)
        raise UsageError(f"{source}: the file is empty, wanted a header line with {wanted}")
    header = rows[0][1]
    present = [column.name for column in columns if _has(header, column, source)]
    if present and not rows[1:]:
        raise UsageError(f"{source}: found a header line and no data below it, wanted at least one line of numbers")
    values: dict[str, list[float]] = {name: [] for name in present}
    for line, cells in rows[1:]:
        check_width(cells, header, f"{source}, line {line}")
        for name in present:
            values[name].append(_number(cells, header.index(name), f"{source}, line {line}, column {name}"))
    return {name: np.array(numbers, dtype=np.float64) for name, numbers in values.items()}


def _has(header: list[str], column: Column, source: str) -> bool:
    if header.count(column.name) > 1:
        raise UsageError(f"{source}: column {column.name} occurs {header.count(column.name)} times, wanted once")
    if column.name in header:
        return True
    if column.required:
        raise UsageError(
            f"{source}: no column {column.name} ({column.meaning}); found {', '.join(header)}; "
            "rename it in the header line"
        )
    return False


def _number(cells: list[str], index: int, where: str) -> float:
    if index >= len(cells):
        raise UsageError(f"{where}: the line has only {len(cells)} cells, wanted a number in cell {index + 1}")
    try:
        number = float(cells[index])
    except ValueError:
        raise UsageError(f"{where}: found {cells[index]!r}, wanted a number with a decimal point") from None
    if not np.isfinite(number):
        raise UsageError(f"{where}: found {cells[index]!r}, wanted a finite number; remove the line")
    if abs(number) > LARGEST_QUANTITY:
        raise UsageError(f"{where}: found {cells[index]!r}, wanted a measurement; check the unit, or remove the line")
    return number


def evenly(time_s: Array, signals: Sequence[Array], source: str) -> tuple[float, list[Array]]:
    """Signals on an even time base from the start of the record; jitter is removed by interpolation.

    Parameters
    ----------
    time_s : (n,) [s]
        Times of the samples.
    signals : (n,) each
        Of these times.
    source
        Name of the record, for errors.

    Returns
    -------
    tuple[float, list[Array]]
        Sampling rate [Hz], and the signals, (m,) each.

    Raises
    ------
    HindraxError
        For fewer than 16 samples, time that does not increase, or a gap of more than ten steps.
    """
    steps = np.diff(time_s)
    if time_s.size < 16:
        raise HindraxError(f"{source}: found {time_s.size} samples, wanted at least 16; record longer")
    if not np.all(steps > 0.0):
        sample = int(np.argmin(steps > 0.0)) + 2
        raise HindraxError(f"{source}: time_s does not increase at sample {sample}; sort the record or remove doubles")
    median = float(np.median(steps))
    if float(steps.max()) > LONGEST_GAP * median:
        sample = int(np.argmax(steps)) + 1
        raise HindraxError(f"{source}: {steps.max():.3g} s are missing after sample {sample}; cut the record there")
    if float(np.max(np.abs(steps / median - 1.0))) <= MOST_JITTER:
        return 1.0 / float(np.mean(steps)), list(signals)
    even = np.arange(time_s[0], time_s[-1] + 0.5 * median, median)
    return 1.0 / median, [np.interp(even, time_s, signal) for signal in signals]
