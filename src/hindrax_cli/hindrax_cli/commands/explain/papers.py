"""`hindrax papers`: the published tables recomputed from their printed inputs."""

import argparse
from collections.abc import Sequence

from rich.text import Text

from hindrax_analysis.terminal import console, print_answer, print_table
from hindrax_cli.argument_types import add_json
from hindrax_cli.command import command, option
from hindrax_laboratory.papers import recompute
from hindrax_laboratory.papers.cells import Cell

TITLES = {
    "A": "COB-2023-1394: thrust and drag of the Hindrax",
    "B": "COB-2023-2422: added mass by free oscillation",
    "C": "Xu, Ma, Han 2017: forced oscillation",
    "D": "Eidsvik 2015: estimates from dimensions",
    "E": "Badawy, Omer 2012: pendulum and CFD drag",
}
COLORS = {"agrees": "green", "misprint": "yellow", "does not follow": "red"}


@command(
    "./hindrax papers --paper B", option("--paper", choices=sorted(TITLES), help="one paper; default all"), add_json
)
def papers(arguments: argparse.Namespace) -> int:
    """Every published table recomputed from its printed inputs, misprints named."""
    cells = [cell for cell in recompute() if arguments.paper in (None, cell.paper)]
    return print_answer({"cells": cells}, lambda: _show(cells), as_json=arguments.json)


def _show(cells: Sequence[Cell]) -> None:
    """Print a table for each paper; a cell that does not follow is a finding, not a failure."""
    for paper, title in TITLES.items():
        mine = [cell for cell in cells if cell.paper == paper]
        if mine:
            _show_paper(f"{paper}  {title}", mine)
    counts = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in COLORS}
    console().print(f"{len(cells)} cells: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))


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
