"""`hindrax forced`: acceleration derivatives from forced oscillation. Xu, Ma, Han 2017."""

from __future__ import annotations

import argparse

from hindrax_analysis.experiments.forced import COLUMNS, MOTIONS, Coefficient, Model, derivatives, run_from_columns
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import cells_of, make_table, print_table
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import add_output, add_record, read_record, save_plot

NAME = "forced"
HELP = "acceleration derivatives from forced oscillation (planar motion mechanism), Fourier and direct fit"
EXAMPLE = "./hindrax forced heave_0.1Hz.csv heave_0.2Hz.csv --motion heave --mass 78 --length 0.875 --plot heave.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The runs of one motion, one file per frequency, and the model."""
    add_record(parser, COLUMNS, nargs="+")
    parser.add_argument("--motion", choices=list(MOTIONS), required=True, help="what the mechanism drives")
    parser.add_argument("--mass", type=positive, required=True, metavar="KG", help="mass of the model [kg]")
    parser.add_argument(
        "--length", type=positive, required=True, metavar="M", help="length, for dimensionless forms [m]"
    )
    parser.add_argument("--inertia", type=positive, metavar="KGM2", help="of the model, for pitch and yaw [kg m^2]")
    parser.add_argument("--restoring", type=float, default=0.0, metavar="NM", help="m g z_B, for pitch [Nm]")
    parser.add_argument("--density", type=positive, default=1000.0, metavar="KG_PER_M3", help="water [kg/m^3]")
    add_output(parser)


def run(arguments: argparse.Namespace) -> int:
    """Analyze all runs together and print."""
    motion = MOTIONS[arguments.motion]
    inertia = {motion.name: arguments.inertia} if arguments.inertia is not None else {}
    model = Model(arguments.mass, arguments.length, inertia, arguments.restoring, arguments.density)
    records = [(path, read_record(path, COLUMNS, arguments.field)) for path in arguments.record]
    found = derivatives([run_from_columns(record, motion, str(path)) for path, record in records], model)
    save_plot(arguments.plot, "forced", found)
    if arguments.json:
        print_json({"motion": motion.name, "runs": len(records), "coefficients": {item.name: item for item in found}})
    else:
        show(motion.name, found)
    return 0


def show(motion: str, found: list[Coefficient]) -> None:
    """Print both ways side by side."""
    headings = ("Fourier", "std", "direct fit", "std", "apart %", "dimensionless")
    table = make_table(f"Forced {motion}: force = derivative x motion", ["coefficient"], headings, ["unit"])
    for item in found:
        told = [text for one in (item.fourier, item.direct) for text in cells_of(one)]
        numbers = (*told, f"{item.difference_percent:.2f}", f"{item.dimensionless:.5f}")
        table.add_row(item.name, *numbers, item.unit)
    print_table(table)
