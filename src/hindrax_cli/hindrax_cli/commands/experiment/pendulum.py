"""`hindrax pendulum`: added mass and drag from a pendulum in water. Badawy, Omer 2012."""

from __future__ import annotations

import argparse

from hindrax_analysis.experiments.pendulum import COLUMNS, Pendulum, PendulumFit, analyze
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import add_output, add_record, read_record, save_plot
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import GRAVITY_mps2

NAME = "pendulum"
HELP = "added mass and drag from a pendulum that comes to rest in water"
EXAMPLE = "./hindrax pendulum surge.csv --mass 3.739 --arm 0.40 --buoyancy-kgf 2.24 --plot surge.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The record and the pendulum."""
    add_record(parser, COLUMNS)
    parser.add_argument("--mass", type=positive, required=True, metavar="KG", help="dry mass [kg]")
    parser.add_argument("--arm", type=positive, required=True, metavar="M", help="axis to vehicle [m]")
    buoyancy = parser.add_mutually_exclusive_group(required=True)
    buoyancy.add_argument("--buoyancy", type=float, metavar="N", help="buoyancy [N]")
    buoyancy.add_argument("--buoyancy-kgf", type=float, metavar="KGF", help="buoyancy [kgf]")
    parser.add_argument(
        "--window", type=positive, metavar="S", help="smoothing polynomial [s]; default the best of four"
    )
    add_output(parser)


def run(arguments: argparse.Namespace) -> int:
    """Analyze one record and print."""
    record = read_record(arguments.record, COLUMNS, arguments.field)
    buoyancy = arguments.buoyancy if arguments.buoyancy is not None else arguments.buoyancy_kgf * GRAVITY_mps2
    pendulum = Pendulum(arguments.mass, buoyancy, arguments.arm)
    fit = analyze(record["time_s"], record["theta_rad"], pendulum, arguments.window, str(arguments.record))
    save_plot(arguments.plot, "pendulum", fit)
    if arguments.json:
        ways = {"output_error": fit.output_error, "regression": fit.regression}
        print_json({**ways, "residual_rad": fit.residual_rad, "samples": fit.samples})
    else:
        show(fit)
    return 0


def show(fit: PendulumFit) -> None:
    """Print both ways, the better one first."""
    for title, found in (
        ("Fit of the simulated angle", fit.output_error),
        ("Regression of the paper (17-18), on derivatives", fit.regression),
    ):
        rows: list[tuple[str, object, str]] = [
            ("added mass", found.added_mass_kg, "kg"),
            ("K_L", found.k_l, "N s/m"),
            ("K_Q", found.k_q, "N s^2/m^2"),
            ("alpha", found.alpha, "1/s^2"),
            ("beta", found.beta, "1/s"),
            ("gamma", found.gamma, ""),
        ]
        print_values(title, rows)
    print_fitted(f"{fit.samples} samples, residual {1e3 * fit.residual_rad:.3g} mrad")
