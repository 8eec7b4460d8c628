"""`hindrax papers`: every published table recomputed from its printed inputs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rich.markup import escape

from hindrax_analysis.papers import recompute
from hindrax_analysis.papers.cells import Cell
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import console, make_table, print_table
from hindrax_cli.argument_types import add_json

NAME = "papers"
HELP = "every published table recomputed from its printed inputs, misprints named"
EXAMPLE = "./hindrax papers --paper B"

TITLES = {
    "A": "COB-2023-1394: thrust and drag of the Hindrax",
    "B": "COB-2023-2422: added mass by free oscillation",
    "C": "Xu, Ma, Han 2017: forced oscillation",
    "D": "Eidsvik 2015: estimates from dimensions",
    "E": "Badawy, Omer 2012: pendulum and CFD drag",
}
COLORS = {"agrees": "green", "misprint": "yellow", "does not follow": "red"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which papers, and how to print."""
    parser.add_argument("--paper", choices=sorted(TITLES), help="one paper; default all")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Recompute and print; a cell that does not follow is a finding, not a failure."""
    cells = [cell for cell in recompute() if arguments.paper in (None, cell.paper)]
    if arguments.json:
        print_json({"cells": cells})
        return 0
    for paper, title in TITLES.items():
        mine = [cell for cell in cells if cell.paper == paper]
        if mine:
            show(f"{paper}  {title}", mine)
    counts = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in COLORS}
    console().print(f"{len(cells)} cells: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return 0


def show(title: str, cells: Sequence[Cell]) -> None:
    """Print one paper as a table."""
    numbers = ("printed", "recomputed", "difference")
    table = make_table(title, ("table", "row", "quantity"), numbers, ("unit", "verdict", "note"))
    for cell in cells:
        difference = f"{cell.difference:+.2g}" if abs(cell.difference) > 1e-6 * cell.tolerance else "0"
        values = (f"{cell.printed:.6g}", f"{cell.recomputed:.6g}", difference, cell.unit)
        verdict = f"[{COLORS[cell.verdict]}]{cell.verdict}[/]"
        table.add_row(cell.table, cell.row, cell.quantity, *values, verdict, escape(cell.note))
    print_table(table)
