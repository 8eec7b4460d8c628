"""`hindrax papers`: the published tables recomputed from their printed inputs."""

import argparse
from collections.abc import Mapping, Sequence

from rich.text import Text

from hindrax_analysis.terminal import print_answer, print_table
from hindrax_cli.argument_types import add_json
from hindrax_cli.command import command, option
from hindrax_core.text.screen_text import print_fitted
from hindrax_laboratory.papers import recompute
from hindrax_laboratory.papers.cells import Cell, Verdict

TITLES = {
    "A": "COB-2023-1394: thrust and drag of the Hindrax",
    "B": "COB-2023-2422: added mass by free oscillation",
    "C": "Xu, Ma, Han 2017: forced oscillation",
    "D": "Eidsvik 2015: estimates from dimensions",
    "E": "Badawy, Omer 2012: pendulum and CFD drag",
}
COLORS: Mapping[Verdict, str] = {"agrees": "green", "misprint": "yellow", "does not follow": "red"}
VERDICTS: Sequence[Verdict] = tuple(COLORS)


@command(
    "./hindrax papers --paper B",
    option("--paper", choices=sorted(TITLES), help="the cells of one paper"),
    option("--all", action="store_true", help="the cells of every paper; default: how many agree, and the misprints"),
    add_json,
)
def papers(arguments: argparse.Namespace) -> int:
    """Every published table recomputed from its printed inputs, misprints named."""
    cells = [cell for cell in recompute() if arguments.paper in (None, cell.paper)]
    show = _show_cells if arguments.all or arguments.paper else _show_summary
    return print_answer({"cells": cells}, lambda: show(cells), as_json=arguments.json)


def _show_summary(cells: Sequence[Cell]) -> None:
    """Print how many cells of each paper agree, and the misprints."""
    rows = []
    for paper, title in TITLES.items():
        mine = [cell.verdict for cell in cells if cell.paper == paper]
        rows.append((f"{paper}  {title}", *(mine.count(verdict) for verdict in VERDICTS)))
    print_table("Cells of the published tables, recomputed", ("paper",), VERDICTS, rows)
    wrong = [cell for cell in cells if cell.verdict == "misprint"]
    numbers = [
        (cell.paper, cell.row, cell.quantity, f"{cell.printed:.6g}", f"{cell.recomputed:.6g}", cell.unit)
        for cell in wrong
    ]
    print_table("Misprints", ("paper", "row", "quantity"), ("printed", "recomputed", "unit"), numbers)
    print_fitted("all cells, also those that do not follow: --paper A, or --all")


def _show_cells(cells: Sequence[Cell]) -> None:
    """Print a table for each paper; a cell that does not follow is a finding, not a failure."""
    for paper, title in TITLES.items():
        mine = [cell for cell in cells if cell.paper == paper]
        if mine:
            _show_paper(f"{paper}  {title}", mine)
    counts = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in VERDICTS}
    print_fitted(f"{len(cells)} cells: {', '.join(f'{count} {verdict}' for verdict, count in counts.items())}")


def _show_paper(title: str, cells: Sequence[Cell]) -> None:
    numbers, rows = ("printed", "recomputed", "difference"), []
    for cell in cells:
        difference = f"{cell.difference:+.2g}" if abs(cell.difference) > 1e-6 * cell.tolerance else "0"
        values = (f"{cell.printed:.6g}", f"{cell.recomputed:.6g}", difference, cell.unit)
        verdict = Text(cell.verdict, style=COLORS[cell.verdict])
        rows.append((cell.table, cell.row, cell.quantity, *values, verdict, cell.note))
    print_table(
        title,
        ("table", "row", "quantity"),
        numbers,
        rows,
        ("unit", "verdict", "note"),
        spare=("table", "difference", "note"),
        grouped=True,
    )
