"""Thrust over pulse as manufacturers publish it: a workbook with a sheet for each voltage, or one of them as CSV.

Columns are found by their names, in any order: PWM [us], force or thrust with its unit, voltage where it is given. Blue
Robotics' T200 workbook has ` PWM (us)`, ` RPM`, ` Current (A)`, ` Voltage (V)`, ` Power (W)`, ` Force (Kg f)` and
` Efficiency (g/W)` on sheets `10 V` to `20 V`, after one that is to be read first.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from hindrax_analysis.records.csv.columns import KGF, LBF, rows_of
from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.text.screen_text import how_to_install
from hindrax_ident.arrays import Array, array

PULSE, FORCE, VOLTAGE = ("pwm", "pulse"), ("force", "thrust"), ("voltage", "supply")
UNITS = {"kgf": KGF, "kg": KGF, "gf": 1e-3 * KGF, "g": 1e-3 * KGF, "lbf": LBF, "lb": LBF, "lbs": LBF, "n": 1.0}
LEADING = 5
"""Lines among which the header of a CSV file is."""
STEP_V = 0.75
"""A sweep sags by less; more apart are the voltages of two sweeps."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """One sweep at one voltage: pulses (n,) [us] and forces (n,) [N], positive at the longer pulses."""

    supply_V: float
    pulse_us: Array
    force_N: Array


def is_workbook(path: Path) -> bool:
    """Whether the name of the file is that of a workbook."""
    return path.suffix.lower() in (".xlsx", ".xlsm")


def is_published(path: Path) -> bool:
    """Whether a file is a workbook, or begins as published data do."""
    if is_workbook(path):
        return True
    try:
        return any(is_sheet([str(cell) for cell in row]) for row in _csv(path)[:LEADING])
    except (HindraxError, UsageError):
        return False


def is_sheet(header: Sequence[str]) -> bool:
    """Whether a header line is that of published data: pulses and a force with its unit."""
    return _place(header, PULSE) is not None and _force(header) is not None


def sheets_of(path: Path, supply_V: float | None = None) -> list[Sheet]:
    """Every sweep of a workbook or a CSV file, by rising voltage.

    Parameters
    ----------
    path
        As manufacturers publish it.
    supply_V : [V]
        Voltage where the data name none.

    Returns
    -------
    list[Sheet]
        Thrust over pulses at one voltage each.

    Raises
    ------
    UsageError
        When the file cannot be read, holds no thrust over pulses, or two sweeps at one voltage.
    """
    tables = _workbook(path) if is_workbook(path) else [("", _csv(path))]
    found = [
        sheet for name, rows in tables for sheet in _sheets(name, rows, f"{path}{name and ', sheet '}{name}", supply_V)
    ]
    if not found:
        raise UsageError(f"{path}: found no sheet with PWM [us] and Force or Thrust with a unit (kgf, lbf, g, N)")
    found.sort(key=lambda sheet: sheet.supply_V)
    for one, other in pairwise(found):
        if other.supply_V - one.supply_V < STEP_V:
            volts = f"{one.supply_V:.4g} and {other.supply_V:.4g} V"
            raise UsageError(f"{path}: found two sweeps, at {volts}, wanted one for each voltage")
    return found


def _workbook(path: Path) -> list[tuple[str, list[list[object]]]]:
    try:
        from openpyxl import load_workbook  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(
            f"{path}: workbooks need openpyxl; {how_to_install('workbook')}; or save the sheets as CSV"
        ) from error
    try:
        book = load_workbook(path, read_only=True, data_only=True)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({cause(error)})") from error
    except (BadZipFile, KeyError, ValueError) as error:
        raise UsageError(f"{path}: is no workbook (.xlsx); save it once more as one, or as CSV") from error
    return [(sheet.title, [list(row) for row in sheet.iter_rows(values_only=True)]) for sheet in book.worksheets]


def _csv(path: Path) -> list[list[object]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        text = path.read_text(encoding="latin-1")  # the micro sign of a spreadsheet's own CSV
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({cause(error)})") from error
    return [list(cells) for _, cells in rows_of(text, str(path))]


def _sheets(name: str, rows: Sequence[Sequence[object]], where: str, supply_V: float | None) -> Iterator[Sheet]:
    """The sweeps below the header line of one sheet; none where it has no such line."""
    for index, row in enumerate(rows):
        header = [str(cell or "") for cell in row]
        if is_sheet(header):
            yield from _sweeps(header, rows[index + 1 :], name, where, supply_V)
            return


def _sweeps(
    header: list[str], rows: Sequence[Sequence[object]], name: str, where: str, supply_V: float | None
) -> Iterator[Sheet]:
    force = _force(header)
    places = (_place(header, PULSE), force and force[0], _place(header, VOLTAGE))
    numbers = [_numbers(row, places) for row in rows]
    kept = array(np.array([line for line in numbers if not np.isnan(line[:2]).any()]).reshape(-1, 3))
    if force is None or not len(kept):
        raise UsageError(f"{where}: found a header line and no numbers below it")
    named = re.search(r"(\d+(?:\.\d+)?)\s*V\b", name)
    volts = kept[:, 2]
    if np.isnan(volts).any():
        given = supply_V or (float(named[1]) if named else None)
        if given is None:
            raise UsageError(f"{where}: found no voltage; give it with --supply V")
        volts = np.full(len(kept), given)
    order = np.argsort(volts, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(volts[order]) > STEP_V) + 1):
        rows_of_it = np.sort(part)
        yield Sheet(round(float(volts[part].mean()), 3), kept[rows_of_it, 0], kept[rows_of_it, 1] * force[1])


def _numbers(row: Sequence[object], places: Sequence[int | None]) -> Array:
    """Pulse, force and voltage of a line: (3,), NaN where a cell holds no number."""
    return array(np.array([_number(row[one]) if one is not None and one < len(row) else np.nan for one in places]))


def _number(cell: object) -> float:
    try:
        return float(str(cell))
    except ValueError:
        return float("nan")


def _place(header: Sequence[str], words: Sequence[str]) -> int | None:
    """Column whose name begins with one of the words."""
    return next((index for index, cell in enumerate(header) if cell.strip().lower().startswith(tuple(words))), None)


def _force(header: Sequence[str]) -> tuple[int, float] | None:
    """Column of the force and newtons per unit of it; the first one whose unit is known."""
    for index, cell in enumerate(header):
        if cell.strip().lower().startswith(FORCE):
            unit = re.sub(r"[^a-z]", "", re.split(r"[(\[_]", cell.lower(), maxsplit=1)[-1])
            if unit in UNITS:
                return index, UNITS[unit]
    return None
