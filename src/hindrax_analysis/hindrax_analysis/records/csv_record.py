"""CSV records of any origin: the header line names columns and units."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hindrax_analysis.records.csv_columns import Meaning, factor_of, meaning_of, near_miss, number, time_of
from hindrax_analysis.records.csv_rows import Row, cells_of, check_width, rows_of
from hindrax_analysis.records.recording import Recording
from hindrax_core.errors import HindraxError
from hindrax_core.signals import NAN
from hindrax_ident.arrays import Array, array

MOST_LINES = 250_000
"""More than an hour at 60 Hz; the identification of as many takes 2 GB."""
UNIX_SCALES = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"))
"""Times above the first number are since 1970: factor and unit."""
REAL_FORCES = "forces are those achieved by the thrusters, about the center of mass"


def read_csv(text: str, source: str, frame: str = "", *, part: bool = False) -> Recording:
    """Read a record with named columns (`COLUMNS`); cells may be empty, so rates may differ.

    `frame`: body axes of all columns, flu or fsd (also without one). With `part`, velocities or forces alone do.
    HindraxError names line and column, what was found and what was wanted.
    """
    header, rows = _rows(text, source)
    meanings = _meanings(header, source, part=part)
    if not any(_is_data(row[i]) for _, row in rows[:1] for i in meanings if i < len(row)):
        meanings, rows = _with_units(meanings, rows, source), rows[1:]
    for line, cells in rows:
        check_width(cells, header, f"{source}, line {line}")
    columns = {
        meaning.name: array(meaning.factor * _values(rows, i, meaning, f"column {header[i]}", source))
        for i, meaning in meanings.items()
    }
    if "t_ns" in columns:
        columns["t"] = array(columns["t"] + columns.pop("t_ns"))
    _check_times(columns["t"], rows, source)
    has_unit = any(meaning.has_unit for meaning in meanings.values() if meaning.name == "t")
    scale, by_size = (1.0, "") if has_unit else _unix_unit(columns["t"])
    columns["t"] = array(scale * columns["t"])
    order = np.argsort(columns["t"], kind="stable")
    recording = _recording(source, {name: array(values[order]) for name, values in columns.items()})
    axes = "x forward, y left, z up, as named" if frame == "flu" else "SNAME: x forward, y starboard, z down"
    assumptions = [by_size, f"axes are {axes}", REAL_FORCES]
    recording = recording.half_turned() if frame == "flu" else recording
    return replace(recording, assumptions=tuple(one for one in assumptions if one))


def _rows(text: str, source: str) -> tuple[list[str], list[Row]]:
    """Cells of the header line, and line number and cells of each line below it."""
    count = text.count("\n")
    if count > MOST_LINES:
        raise HindraxError(
            f"{source}: found {count} lines, wanted at most {MOST_LINES}; keep the maneuvers only, or every nth line"
        )
    rows = rows_of(text, source, _is_header)
    if len(rows) < 2:
        raise HindraxError(
            f"{source}: found {len(rows)} lines, wanted a header line with column names and data below it"
        )
    return rows[0][1], rows[1:]


def _is_header(line: str) -> bool:
    """Whether a line names the time and another known column."""
    try:
        found = {known.name for cell in cells_of([line])[0] if (known := meaning_of(cell))}
    except (HindraxError, csv.Error, IndexError):
        return False
    return "t" in found and len(found) > 1


def _meanings(header: list[str], source: str, *, part: bool) -> dict[int, Meaning]:
    """Meaning of each used column, by index. HindraxError when too few, or two mean the same."""
    try:
        found = {i: known for i, cell in enumerate(header) if (known := meaning_of(cell))}
    except HindraxError as error:
        raise HindraxError(f"{source}, {error}") from None
    _check_names([(known.name, header[i]) for i, known in found.items()], header, source, part=part)
    return found


def _check_names(found: list[tuple[str, str]], header: list[str], source: str, *, part: bool) -> None:
    names = [name for name, _ in found]
    twice = [cell for name, cell in found if names.count(name) > 1]
    if twice:
        raise HindraxError(f"{source}: columns {' and '.join(twice)} mean the same, wanted one; remove the other")
    pairs = [(speed, force) for speed, force in zip("uvwpqr", "XYZKMN", strict=True) if force in names]
    usable = [force for speed, force in pairs if speed in names or (speed == "w" and "depth" in names)]
    if "t" not in names or not (usable or (part and len(names) > 1)):
        raise HindraxError(
            f"{source}: found the columns {', '.join(header)}; wanted t and at least one pair of velocity and force "
            "of the same axis (u and X, v and Y, w and Z, p and K, q and M, r and N), with the unit where it is not "
            f"SI, such as u_cmps; rename them in the header line{_hint(set(names), header)}"
        )


def _hint(names: set[str], header: list[str]) -> str:
    """Remedy for the missing part of a record."""
    if "t" not in names:
        return "; speeds and forces without times are for `hindrax towing`"
    misses = [miss for cell in header if not meaning_of(cell) and (miss := near_miss(cell))]
    if misses:
        return f"; {'; '.join(misses)}"
    return "" if names & set("XYZKMN") else "; forces are missing: convert pulses or commands to newtons first"


def _is_data(cell: str) -> bool:
    """Whether a cell may belong to a row of data: a number, a time, or empty."""
    try:
        time_of(cell)
    except ValueError:
        return False
    return True


def _with_units(meanings: dict[int, Meaning], rows: list[Row], source: str) -> dict[int, Meaning]:
    """Meanings with the units of a line below the header line."""
    line, units = rows[0]
    out = {}
    for i, meaning in meanings.items():
        unit = units[i].strip("()[]") if i < len(units) else ""
        try:
            factor = factor_of(meaning.name, unit, meaning.name)
        except HindraxError as error:
            raise HindraxError(f"{source}, line {line}, {error}") from None
        out[i] = Meaning(meaning.name, factor, has_unit=True)
    return out


def _values(rows: list[Row], index: int, meaning: Meaning, column: str, source: str) -> Array:
    """Numbers of one column: (n,), in the unit of the file; NaN for empty cells."""
    read: Callable[[str], float] = time_of if meaning.name == "t" else number
    out = []
    for line, cells in rows:
        text = cells[index] if index < len(cells) else ""
        try:
            out.append(read(text))
        except ValueError:
            what = f"found {text!r}, wanted a number with a decimal point, or nothing"
            raise HindraxError(f"{source}, line {line}, {column}: {what}") from None
    return np.array(out)


def _check_times(time: Array, rows: list[Row], source: str) -> None:
    if not np.all(np.isfinite(time)):
        line = rows[int(np.argmin(np.isfinite(time)))][0]
        raise HindraxError(f"{source}, line {line}: no time, wanted a number in every line; remove the line")
    if len(time) > 1 and np.ptp(time) == 0.0:
        raise HindraxError(f"{source}: all times are the same ({time[0]:g}), wanted increasing times")


def _unix_unit(time: Array) -> tuple[float, str]:
    """Seconds per unit of times without a unit, by their size, and the assumption made."""
    size = abs(float(np.median(time)))
    found = [(factor, unit) for least, factor, unit in UNIX_SCALES if size > least]
    return (found[0][0], f"times are in {found[0][1]} since 1970, by their size") if found else (1.0, "")


def _recording(source: str, columns: dict[str, Array]) -> Recording:
    t = columns["t"]
    origin = float(t[0])
    time = array(t - origin)
    empty = np.full(len(t), NAN)
    velocity = np.stack([columns.get(name, empty) for name in "uvwpqr"], axis=1)
    wrench = np.stack([columns.get(name, empty) for name in "XYZKMN"], axis=1)
    attitude = np.stack([columns.get(name, empty) for name in ("roll", "pitch", "depth")], axis=1)
    parts = [_rows_with_data(time, table) for table in (velocity, wrench, attitude)]
    return Recording(source, *parts[0], *parts[1], *parts[2], origin)


def _rows_with_data(time: Array, table: Array) -> tuple[Array, Array]:
    """Times [s], (m,), and rows, (m, k), with at least one finite value."""
    rows = np.isfinite(table).any(axis=1)
    return array(time[rows]), array(table[rows])
