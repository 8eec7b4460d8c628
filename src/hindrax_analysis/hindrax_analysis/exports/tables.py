"""The result as a table for a spreadsheet (CSV) or for a paper (LaTeX)."""

import csv
import io
import math
from dataclasses import replace

from hindrax_analysis.coefficients_file import TABULATED, SavedCoefficients
from hindrax_analysis.exports.export_model import abort_notes, identified, unit_of
from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import last_place
from hindrax_ident.assess.results import Number

SYMBOLS = {"k_q": "$k_q$", "k_l": "$k_l$", "b": "$b$", "added_mass": "$m_a$"}


def result_table(saved: SavedCoefficients, source: str) -> SavedCoefficients:
    """Rows of a table of results: identified motions; HindraxError when there are none."""
    motions, aborted = identified(saved), abort_notes(saved)
    if not motions:
        raise HindraxError(f"{source}: no motion is identifiable{f', {aborted[0]}' if aborted else ''}; fly it again")
    return replace(saved, label=source, motions=motions)


def write_csv(table: SavedCoefficients) -> str:
    """One line per motion: value, deviations and unit of each coefficient, then what to quote; empty where missing."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        [
            "motion",
            *(f"{name}{part}" for name in TABULATED for part in ("", "_std", "_std_calibrated", "_unit")),
            *(f"{name}{part}" for name in TABULATED for part in ("_corrected", "_low95", "_high95")),
        ]
    )
    for motion, result in table.motions.items():
        row = [motion]
        for name in TABULATED:
            found = result.coefficients.get(name, Number(math.nan, math.nan))
            numbers = (found.value, found.std, found.std_calibrated)
            row += [*("" if math.isnan(number) else f"{number:.9g}" for number in numbers), unit_of(motion, name)]
        for name in TABULATED:
            one = result.coefficients.get(name)
            known = one is not None and one.corrected
            row += [f"{x:.9g}" for x in (known.value, *known.interval95)] if known else [""] * 3
        writer.writerow(row)
    return text.getvalue()


def write_latex(table: SavedCoefficients) -> str:
    """A tabular that needs no package: values as quoted, with half of their 68 % intervals."""
    head = " & ".join(["motion", *SYMBOLS.values()])
    rows = [
        " & ".join([motion.replace("_", " "), *(_latex_cell(result.coefficients.get(name)) for name in TABULATED)])
        + r" \\"
        for motion, result in table.motions.items()
    ]
    caption = f"% {table.conditions.vehicle}, from {table.label}; N, N m, kg, SI; half of the 68 % interval"
    begin, line, end = r"\begin{tabular}{lrrrr}", r"\hline", r"\end{tabular}"
    return "\n".join([caption, begin, line, head + r" \\", line, *rows, line, end]) + "\n"


def _latex_cell(value: Number | None) -> str:
    if value is None:
        return "--"
    # Without a correction the deviation of the noise, as before.
    center, std = value.quoted if value.corrected is not None else (value.value, value.std)
    if not std > 0.0:
        return f"${center:.4g}$"
    digits = max(0, -last_place(std, 2))
    return rf"${center:z.{digits}f} \pm {std:.{digits}f}$"
