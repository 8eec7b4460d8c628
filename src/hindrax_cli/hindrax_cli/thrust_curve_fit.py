"""Fit of a thruster's curve to a sweep, for `hindrax bollard` and `hindrax thruster fit`: options, block, output."""

import argparse

import numpy as np
import yaml

from hindrax_analysis.terminal import print_answer, print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import read_record, save_plot
from hindrax_core.curves import Curve, problems_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.knobs import build
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_laboratory import plots
from hindrax_laboratory.bollard import COEFFICIENTS, COLUMNS, BollardCurve, Direction, fit, vehicle_block

OUTLIERS = "remove outliers (--plot shows them)"
UNFIT = f"look for another unit, or {OUTLIERS}"


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
    save_plot(arguments.plot, plots.bollard, columns["pulse_us"], thrust, curve)
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
