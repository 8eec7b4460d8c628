"""Blocks of the vehicle file: `hindrax bollard` (thrust curve, COB-2023-1394) and `estimate` (Eidsvik 2015)."""

import argparse

from hindrax_analysis.exports.vehicle_block import block_text
from hindrax_analysis.terminal import print_answer, print_table
from hindrax_cli.argument_types import named_vehicle, positive
from hindrax_cli.command import command, option
from hindrax_cli.experiment_command import add_output, record, save_plot
from hindrax_cli.thrust_curve_fit import add_rig, fitted, print_curve
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_ident.model.empirical_model import Dimensions, EmpiricalModel, empirical, hydrodynamics_of
from hindrax_laboratory import plots
from hindrax_laboratory.bollard import COLUMNS

SIZES = (("length", "m", "along x"), ("width", "m", "along y"), ("height", "m", "along z"), ("mass", "kg", "dry mass"))
AREAS = ("front", "side", "top")
ESTIMATED = {
    "added mass": ("kg", "kg m^2"),
    "quadratic drag": ("N s^2/m^2", "N m s^2"),
    "linear drag": ("N s/m", "N m s"),
    "inertia": ("kg m^2",),
}
"""Columns of the estimate, with the units of translation and rotation."""


@command(
    "./hindrax bollard sweep.csv --lever-ratio 2.0 --supply 14.8 --load-cell-std 0.005 --plot curve.png",
    record(COLUMNS),
    add_rig,
    add_output,
)
def bollard(arguments: argparse.Namespace) -> int:
    """Thrust curve from a bollard-pull sweep, with the block for the vehicle file."""
    print_curve(arguments, *fitted(arguments))
    return 0


@command(
    "./hindrax estimate --length 0.404 --width 0.108 --height 0.214 --mass 8 "
    "--front 0.023112 --side 0.086456 --top 0.031663",
    named_vehicle("take missing values from this vehicle file"),
    *(option(f"--{name}", type=positive, metavar=unit.upper(), help=f"{what} [{unit}]") for name, unit, what in SIZES),
    *(
        option(f"--{name}", type=positive, metavar="M2", help="projected area [m^2]; default the full box")
        for name in AREAS
    ),
    option("--density", type=positive, metavar="KG_PER_M3", help="water [kg/m^3]"),
    option("--buoyancy-arm", type=float, metavar="M", help="center of mass up to center of buoyancy [m]"),
    add_output,
)
def estimate(arguments: argparse.Namespace) -> int:
    """Added mass, drag and inertia from dimensions and projected areas."""
    model = empirical(_dimensions(arguments))
    for note in model.notes:
        print_stderr(f"note: {note}")
    save_plot(arguments.plot, plots.estimate, model)
    return print_answer(model, lambda: _show_estimate(model), as_json=arguments.json)


def _dimensions(arguments: argparse.Namespace) -> Dimensions:
    sizes = [name for name, _, _ in SIZES]
    given = {name: getattr(arguments, name) for name in (*sizes, *AREAS)}
    density, arm = arguments.density, arguments.buoyancy_arm
    if arguments.vehicle is not None:
        vehicle = load_vehicle(arguments.vehicle)
        known = dict(zip(sizes, (*vehicle.envelope_m, vehicle.mass_kg), strict=True))
        if vehicle.projected_areas_m2 is not None:
            known |= dict(zip(AREAS, vehicle.projected_areas_m2, strict=True))
        given = {name: value if value is not None else known.get(name) for name, value in given.items()}
        density = vehicle.water.density_kgpm3 if density is None else density
        if arm is None:
            arm = vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2]
    missing = [f"--{name}" for name in sizes if given[name] is None]
    if missing:
        raise UsageError(f"{', '.join(missing)} not given; name them, or a --vehicle FILE that has them")
    length, width, height, mass, front, side, top = given.values()
    return Dimensions(length, width, height, mass, front, side, top, density or 1000.0, arm or 0.0)


def _show_estimate(model: EmpiricalModel) -> None:
    rows = []
    for index, axis in enumerate(AXES):
        values = [model.added_mass[index], model.quadratic_drag[index], model.linear_drag[index]]
        values += [model.inertia_kgm2[index - 3]] if index >= 3 else []
        rows.append((axis, *(f"{value:.3g}" for value in values), *([""] if index < 3 else [])))
    units = "; ".join(f"{quantity} [{', '.join(of)}]" for quantity, of in ESTIMATED.items())
    print_table(f"Estimate from dimensions: {units}", ["axis"], list(ESTIMATED), rows)
    print_fitted(
        f"scale from two to three dimensions: added mass {model.scale_added_mass:.3f}, drag {model.scale_drag:.3f}"
    )
    print_fitted("for the vehicle file (prior of plans, truth of the mock):")
    print_whole(block_text(hydrodynamics_of(model)), end="")
