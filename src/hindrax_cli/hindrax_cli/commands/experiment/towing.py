"""`hindrax towing`: linear and quadratic drag from towing points."""

from __future__ import annotations

import argparse

from hindrax_analysis.experiments.towing import COLUMNS, Towing, fit
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import add_output, add_record, read_record, save_plot

NAME = "towing"
HELP = "linear and quadratic drag from towing points (tank or CFD)"
EXAMPLE = "./hindrax towing surge.csv --area 0.0616 --plot surge.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The points and what to fit."""
    add_record(parser, COLUMNS)
    parser.add_argument("--offset", action="store_true", help="fit a constant as well (net buoyancy, load cell zero)")
    parser.add_argument("--area", type=positive, metavar="M2", help="reference area for C_D [m^2]")
    parser.add_argument("--density", type=positive, default=1000.0, metavar="KG_PER_M3", help="water [kg/m^3]")
    add_output(parser)


def run(arguments: argparse.Namespace) -> int:
    """Fit and print."""
    record = read_record(arguments.record, COLUMNS, arguments.field)
    speed, drag = record["speed_mps"], record["drag_N"]
    found = fit(speed, drag, arguments.offset, arguments.area, arguments.density)
    save_plot(arguments.plot, "towing", speed, drag, found)
    if arguments.json:
        print_json(found)
    else:
        print_values(f"Drag from {found.samples} points", _rows(found))
    return 0


def _rows(found: Towing) -> list[tuple[str, object, str]]:
    rows: list[tuple[str, object, str]] = [
        ("K_Q (k_q)", found.k_q, "N s^2/m^2"),
        ("K_L (k_l)", found.k_l, "N s/m"),
        ("residual", found.residual_std_N, "N"),
    ]
    if found.b is not None:
        rows.append(("offset b", found.b, "N"))
    if found.drag_coefficient is not None:
        rows.append(("C_D of the quadratic part", found.drag_coefficient, ""))
    return rows
