"""Blocks of the vehicle file: `hindrax bollard` (thrust curve, COB-2023-1394) and `estimate` (Eidsvik 2015)."""

import argparse

import numpy as np
import yaml

from hindrax_analysis.experiments.bollard import COEFFICIENTS, COLUMNS, BollardCurve, Direction, fit, vehicle_block
from hindrax_analysis.experiments.estimate import Dimensions, EmpiricalModel, empirical, hydrodynamics_of
from hindrax_analysis.exports.vehicle_block import block_text
from hindrax_analysis.terminal import print_answer, print_table, print_values
from hindrax_cli.argument_types import named_vehicle, positive
from hindrax_cli.command import command, option
from hindrax_cli.experiment_command import add_output, read_record, record, save_plot
from hindrax_core.curves import Curve, problems_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.knobs import build
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.vehicle import AXES, load_vehicle

OUTLIERS = "remove outliers (--plot shows them)"
UNFIT = f"look for another unit, or {OUTLIERS}"
SIZES = (("length", "m", "along x"), ("width", "m", "along y"), ("height", "m", "along z"), ("mass", "kg", "dry mass"))
AREAS = ("front", "side", "top")


def add_rig(parser: argparse._ActionsContainer) -> None:
    """Setup of the sweep, and the name of its curve."""
    parser.add_argument("--lever-ratio", type=positive, default=1.0, metavar="RATIO", help="thrust over load [-]")
    parser.add_argument("--stop", type=positive, default=1500.0, metavar="US", help="stop pulse [us]")
    parser.add_argument("--dead-band", type=positive, default=25.0, metavar="US", help="half width without thrust [us]")
    parser.add_argument("--supply", type=positive, metavar="V", help="supply voltage [V]; default: the column's mean")
    parser.add_argument(
        "--load-cell-std", type=float, default=0.0, metavar="PART", help="deviation of the load cell's gain [-]"
    )
    parser.add_argument("--name", default="main", help="name of the curve in the vehicle file")


@command(
    "./hindrax bollard sweep.csv --lever-ratio 2.0 --supply 14.8 --plot curve.png", record(COLUMNS), add_rig, add_output
)
def bollard(arguments: argparse.Namespace) -> int:
    """Thrust curve from a bollard-pull sweep, with the block for the vehicle file."""
    print_curve(arguments, *fitted(arguments))
    return 0


def fitted(arguments: argparse.Namespace) -> tuple[BollardCurve, str]:
    """Curve of the sweep, drawn where asked for, and its block for the vehicle file."""
    columns = read_record(arguments.record, COLUMNS, arguments.field)
    supply = arguments.supply
    if supply is None and "supply_V" in columns:
        supply = float(np.mean(columns["supply_V"]))
    curve = fit(
        columns["pulse_us"],
        columns["load_N"],
        lever_ratio=arguments.lever_ratio,
        stop_us=arguments.stop,
        dead_band_us=arguments.dead_band,
        supply_V=supply,
        load_cell_sigma=arguments.load_cell_std,
    )
    thrust = columns["load_N"] * arguments.lever_ratio
    save_plot(arguments.plot, "bollard", columns["pulse_us"], thrust, curve)
    block = vehicle_block(curve, arguments.name, f"bollard pull, {arguments.record.name}")
    _check_block(block, arguments.name)
    return curve, block


def _check_block(block: str, name: str) -> None:
    """HindraxError where a vehicle file with this block would be refused: load cell not tared, volts in millivolts."""
    try:
        problems = problems_of(build(Curve, yaml.safe_load(block)["curves"][name], f"curves.{name}"))
    except UsageError as error:
        raise HindraxError(f"bollard: the sweep gives no curve for a vehicle file: {error}; {UNFIT}") from error
    if problems:
        raise HindraxError(f"bollard: {'; '.join(problems)}; tare the load cell, widen --dead-band, or {OUTLIERS}")


def print_curve(arguments: argparse.Namespace, curve: BollardCurve, block: str) -> None:
    """Print the curve, the block, and a warning where the cubic falls."""
    for direction, name in ((curve.negative, "negative"), (curve.positive, "positive")):
        if not direction.monotone:
            low, high = direction.monotone_from_us, direction.monotone_to_us
            print_stderr(f"warning: the {name} cubic rises only from {low:.0f} to {high:.0f} us")
    print_answer({"curve": curve, "block": block}, lambda: _show_curve(curve, block), as_json=arguments.json)


def _show_curve(curve: BollardCurve, block: str) -> None:
    for name, direction in (("negative", curve.negative), ("positive", curve.positive)):
        print_values(f"{name}: {direction.from_us:.0f} to {direction.to_us:.0f} us", _direction_rows(direction))
    print_fitted(f"gain deviation at full thrust: {100.0 * curve.gain_sigma:.2f} %")
    print_whole(block, end="")  # a list that goes on below is YAML still


def _direction_rows(direction: Direction) -> list[tuple[str, object, str]]:
    units = ("N", "N/us", "N/us^2", "N/us^3")
    rows: list[tuple[str, object, str]] = list(zip(COEFFICIENTS, direction.c, units, strict=True))
    rows.append((f"thrust at {direction.from_us:.0f} us", direction.force_N(direction.from_us), "N"))
    rows.append((f"thrust at {direction.to_us:.0f} us", direction.force_N(direction.to_us), "N"))
    rows.append(("residual", f"{direction.residual_std_N:.2g}", "N"))
    rows.append(("rises with the pulse everywhere", direction.monotone, ""))
    return rows


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
    save_plot(arguments.plot, "estimate", model)
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
        density = density or vehicle.water.density_kgpm3
        if arm is None:
            arm = vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2]
    missing = [f"--{name}" for name in sizes if given[name] is None]
    if missing:
        raise UsageError(f"{', '.join(missing)} not given; name them, or a --vehicle FILE that has them")
    length, width, height, mass, front, side, top = given.values()
    return Dimensions(length, width, height, mass, front, side, top, density or 1000.0, arm or 0.0)


def _show_estimate(model: EmpiricalModel) -> None:
    for title, axes, units in (
        ("translation", range(3), ("[kg]", "[N s^2/m^2]", "[N s/m]")),
        ("rotation", range(3, 6), ("[kg m^2]", "[Nm s^2]", "[Nm s]")),
    ):
        quantities = zip(("added mass", "quadratic drag", "linear drag"), units, strict=True)
        headings = [f"{quantity} {unit}" for quantity, unit in quantities]
        headings += ["inertia [kg m^2]"] if title == "rotation" else []
        rows = []
        for index in axes:
            values = [model.added_mass[index], model.quadratic_drag[index], model.linear_drag[index]]
            values += [model.inertia_kgm2[index - 3]] if title == "rotation" else []
            rows.append((AXES[index], *(f"{value:.3g}" for value in values)))
        print_table(f"Estimate from dimensions, {title}", ["axis"], headings, rows)
    print_fitted(
        f"scale from two to three dimensions: added mass {model.scale_added_mass:.3f}, drag {model.scale_drag:.3f}"
    )
    print_fitted("\nfor the vehicle file (prior of plans, truth of the mock):\n")
    print_whole(block_text(hydrodynamics_of(model)), end="")
