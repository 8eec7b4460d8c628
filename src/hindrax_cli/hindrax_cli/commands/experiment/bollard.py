"""`hindrax bollard`: the thrust curve from a bollard-pull sweep. COB-2023-1394."""

from __future__ import annotations

import argparse
import sys

import numpy as np
import yaml

from hindrax_analysis.experiments.bollard import COEFFICIENTS, COLUMNS, BollardCurve, Direction, fit, vehicle_block
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import add_output, add_record, read_record, save_plot
from hindrax_core.curves import Curve, problems_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.knobs import build
from hindrax_core.text.screen_text import print_fitted

NAME = "bollard"
HELP = "thrust curve from a bollard-pull sweep, with the block for the vehicle file"
EXAMPLE = "./hindrax bollard sweep.csv --lever-ratio 2.0 --supply 14.8 --plot curve.png"
OUTLIERS = "remove outliers (--plot shows them)"
UNFIT = f"look for another unit, or {OUTLIERS}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The sweep and the rig."""
    add_record(parser, COLUMNS)
    add_rig(parser)
    add_output(parser)


def add_rig(parser: argparse._ActionsContainer) -> None:
    """What the sweep was measured with, and the name of its curve."""
    parser.add_argument("--lever-ratio", type=positive, default=1.0, metavar="RATIO", help="thrust over load [-]")
    parser.add_argument("--stop", type=positive, default=1500.0, metavar="US", help="pulse at rest [us]")
    parser.add_argument("--dead-band", type=positive, default=25.0, metavar="US", help="half width without thrust [us]")
    parser.add_argument("--supply", type=positive, metavar="V", help="supply voltage [V]; default: the column's mean")
    parser.add_argument("--load-cell-std", type=float, default=0.0, metavar="PART", help="deviation of its gain [-]")
    parser.add_argument("--name", default="main", help="name of the curve in the vehicle file")


def run(arguments: argparse.Namespace) -> int:
    """Fit both directions and print, with the block for the vehicle file."""
    print_curve(arguments, *fitted(arguments))
    return 0


def fitted(arguments: argparse.Namespace) -> tuple[BollardCurve, str]:
    """Curve of the sweep, drawn where asked for, and its block for the vehicle file."""
    record = read_record(arguments.record, COLUMNS, arguments.field)
    supply = arguments.supply
    if supply is None and "supply_V" in record:
        supply = float(np.mean(record["supply_V"]))
    curve = fit(
        record["pulse_us"],
        record["load_N"],
        lever_ratio=arguments.lever_ratio,
        stop_us=arguments.stop,
        dead_band_us=arguments.dead_band,
        supply_V=supply,
        load_cell_sigma=arguments.load_cell_std,
    )
    thrust = record["load_N"] * arguments.lever_ratio
    save_plot(arguments.plot, "bollard", record["pulse_us"], thrust, curve)
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
            print_fitted(f"warning: the {name} cubic rises only from {low:.0f} to {high:.0f} us", sys.stderr)
    if arguments.json:
        print_json({"curve": curve, "block": block})
    else:
        show(curve)
        print_fitted(block, end="")  # a list that goes on below is YAML still


def show(curve: BollardCurve) -> None:
    """Print both directions."""
    for name, direction in (("negative", curve.negative), ("positive", curve.positive)):
        print_values(f"{name}: {direction.from_us:.0f} to {direction.to_us:.0f} us", _rows(direction))
    print_fitted(f"gain deviation at full thrust: {100.0 * curve.gain_sigma:.2f} %")


def _rows(direction: Direction) -> list[tuple[str, object, str]]:
    units = ("N", "N/us", "N/us^2", "N/us^3")
    rows: list[tuple[str, object, str]] = list(zip(COEFFICIENTS, direction.c, units, strict=True))
    rows.append((f"thrust at {direction.from_us:.0f} us", direction.force_N(direction.from_us), "N"))
    rows.append((f"thrust at {direction.to_us:.0f} us", direction.force_N(direction.to_us), "N"))
    rows.append(("residual", direction.residual_std_N, "N"))
    rows.append(("rises with the pulse everywhere", direction.monotone, ""))
    return rows
