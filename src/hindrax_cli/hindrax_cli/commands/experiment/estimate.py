"""`hindrax estimate`: added mass, drag and inertia from dimensions. Eidsvik 2015."""

from __future__ import annotations

import argparse
import sys

from hindrax_analysis.experiments.estimate import Dimensions, EmpiricalModel, empirical, hydrodynamics_of
from hindrax_analysis.exports.vehicle_block import block_text
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import make_table, print_table
from hindrax_cli.argument_types import add_vehicle, positive
from hindrax_cli.experiment_command import add_output, save_plot
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_core.vehicle import AXES, load_vehicle

NAME = "estimate"
HELP = "added mass, drag and inertia from dimensions and projected areas"
EXAMPLE = (
    "./hindrax estimate --length 0.404 --width 0.108 --height 0.214 --mass 8 "
    "--front 0.023112 --side 0.086456 --top 0.031663"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Dimensions, or a vehicle file that has them."""
    add_vehicle(parser, "take what is not given from the file of this vehicle", default=False)
    for name, unit, what in (
        ("length", "m", "along x"),
        ("width", "m", "along y"),
        ("height", "m", "along z"),
        ("mass", "kg", "dry mass"),
    ):
        parser.add_argument(f"--{name}", type=positive, metavar=unit.upper(), help=f"{what} [{unit}]")
    for name in ("front", "side", "top"):
        parser.add_argument(f"--{name}", type=positive, metavar="M2", help="projected area [m^2]; default the full box")
    parser.add_argument("--density", type=positive, metavar="KG_PER_M3", help="water [kg/m^3]")
    parser.add_argument("--buoyancy-arm", type=float, metavar="M", help="center of mass up to center of buoyancy [m]")
    add_output(parser)


def run(arguments: argparse.Namespace) -> int:
    """Estimate and print."""
    model = empirical(_dimensions(arguments))
    for note in model.notes:
        print_fitted(f"note: {note}", sys.stderr)
    save_plot(arguments.plot, "estimate", model)
    if arguments.json:
        print_json(model)
    else:
        show(model)
        print_fitted("\nfor the vehicle file (prior of plans, truth of the mock):\n")
        print_whole(block_text(hydrodynamics_of(model)))
    return 0


def _dimensions(arguments: argparse.Namespace) -> Dimensions:
    given = {name: getattr(arguments, name) for name in ("length", "width", "height", "mass", "front", "side", "top")}
    density, arm = arguments.density, arguments.buoyancy_arm
    if arguments.vehicle is not None:
        vehicle = load_vehicle(arguments.vehicle)
        known = dict(zip(("length", "width", "height"), vehicle.envelope_m, strict=True)) | {"mass": vehicle.mass_kg}
        if vehicle.projected_areas_m2 is not None:
            known |= dict(zip(("front", "side", "top"), vehicle.projected_areas_m2, strict=True))
        given = {name: value if value is not None else known.get(name) for name, value in given.items()}
        density = density or vehicle.water.density_kgpm3
        if arm is None:
            arm = vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2]
    missing = [f"--{name}" for name in ("length", "width", "height", "mass") if given[name] is None]
    if missing:
        raise UsageError(f"{', '.join(missing)} not given; name them, or a --vehicle FILE that has them")
    return Dimensions(
        given["length"],
        given["width"],
        given["height"],
        given["mass"],
        given["front"],
        given["side"],
        given["top"],
        density_kgpm3=density or 1000.0,
        buoyancy_arm_m=arm or 0.0,
    )


def show(model: EmpiricalModel) -> None:
    """Print translations and rotations, each with their units."""
    for title, axes, units in (
        ("translation", range(3), ("[kg]", "[N s^2/m^2]", "[N s/m]")),
        ("rotation", range(3, 6), ("[kg m^2]", "[Nm s^2]", "[Nm s]")),
    ):
        quantities = zip(("added mass", "quadratic drag", "linear drag"), units, strict=True)
        headings = [f"{quantity} {unit}" for quantity, unit in quantities]
        headings += ["inertia [kg m^2]"] if title == "rotation" else []
        table = make_table(f"Estimate from dimensions, {title}", ["axis"], headings)
        for index in axes:
            values = [model.added_mass[index], model.quadratic_drag[index], model.linear_drag[index]]
            values += [model.inertia_kgm2[index - 3]] if title == "rotation" else []
            table.add_row(AXES[index], *(f"{value:.3g}" for value in values))
        print_table(table)
    print_fitted(
        f"scale from two to three dimensions: added mass {model.scale_added_mass:.3f}, drag {model.scale_drag:.3f}"
    )
