"""Fit of a thruster's curve to a sweep, for `hindrax bollard` and `hindrax thruster fit`: options, block, output.

Data as manufacturers publish them become a table, a sweep of one's own becomes cubics, or a table where asked for.
"""

import argparse
from collections.abc import Mapping, Sequence

import numpy as np
import yaml

from hindrax_analysis.terminal import print_answer, print_table, print_values, print_what_fits
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import read_record, save_plot
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.knobs import build
from hindrax_core.text.digits import measured
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.thrust.curves import Curve, problems_of
from hindrax_ident.arrays import Array
from hindrax_laboratory.bollard import COEFFICIENTS, COLUMNS, BollardCurve, Direction, fit, vehicle_block
from hindrax_laboratory.measured_table import BASIC_ESC_us, MeasuredTable, measured_table
from hindrax_laboratory.thruster_sheets import Sheet, is_published, sheets_of

OUTLIERS = "remove outliers (--plot shows them)"
SUCH_AS = "such as 0.02 of kitchen or luggage scales, or 0.005 of a load cell that was checked with a known weight [-]"
MANUFACTURER_SIGMA = 0.05
"""Another specimen of the thruster, in another tank, at another speed controller; our estimate."""
MOST_MISSED = 0.1
AROUND = 3
"""Lines that stand above and below a curve: its plot, and where its block is."""
CURVE_REMEDY = f"look for another unit, or {OUTLIERS}"


def add_rig(parser: argparse._ActionsContainer) -> None:
    """Setup of the sweep, and the name of its curve."""
    parser.add_argument("--lever-ratio", type=positive, default=1.0, metavar="RATIO", help="thrust over load [-]")
    parser.add_argument("--stop", type=positive, default=1500.0, metavar="US", help="stop pulse [us]")
    found = f"half width without thrust [us]; default: by the data, or {BASIC_ESC_us:g} of a Basic ESC"
    parser.add_argument("--dead-band", type=positive, metavar="US", help=found)
    parser.add_argument("--supply", type=positive, metavar="V", help="supply voltage [V]; default: the column's mean")
    how = f"deviation of the load cell's gain [-]; needed, but for data of a manufacturer ({MANUFACTURER_SIGMA:g})"
    parser.add_argument("--load-cell-std", type=positive, metavar="PART", help=how)
    parser.add_argument(
        "--table", action="store_true", help="a table in place of cubics, as data of a manufacturer get"
    )
    parser.add_argument("--name", default="main", help="name of the curve in the vehicle file")


def fitted(arguments: argparse.Namespace) -> tuple[BollardCurve | MeasuredTable, str]:
    """Curve of a sweep or of published data, and its block for the vehicle file; UsageError without --load-cell-std."""
    published = not arguments.field and is_published(arguments.record)
    if not published and arguments.load_cell_std is None and arguments.record.exists():
        raise UsageError(f"--load-cell-std: found none, wanted how far the load cell may be off, {SUCH_AS}")
    if published or arguments.table:
        return _tabulated(
            arguments, sheets_of(arguments.record, arguments.supply) if published else [_sweep(arguments)]
        )
    from hindrax_laboratory import plots  # noqa: PLC0415  # of all experiments, slow to import

    columns = read_record(arguments.record, COLUMNS, arguments.field)
    curve = fit(
        columns["pulse_us"],
        columns["load_N"],
        lever_ratio=arguments.lever_ratio,
        stop_us=arguments.stop,
        dead_band_us=arguments.dead_band,
        supply_V=_supply(arguments, columns),
        load_cell_sigma=arguments.load_cell_std,
    )
    thrust = columns["load_N"] * arguments.lever_ratio
    save_plot(arguments.plot, plots.bollard, columns["pulse_us"], thrust, curve)
    block = vehicle_block(curve, arguments.name, f"bollard pull, {arguments.record.name}")
    _check_block(block, arguments.name)
    return curve, block


def _supply(arguments: argparse.Namespace, columns: Mapping[str, Array]) -> float | None:
    if arguments.supply is None and "supply_V" in columns:
        return float(np.mean(columns["supply_V"]))
    given: float | None = arguments.supply
    return given


def _sweep(arguments: argparse.Namespace) -> Sheet:
    """Our own sweep as one sheet; its voltage must be known, as that of each row of a table."""
    columns = read_record(arguments.record, COLUMNS, arguments.field)
    volts = _supply(arguments, columns)
    if volts is None:
        raise UsageError(
            f"{arguments.record}: found no column supply_V, wanted the voltage of the sweep; give --supply V"
        )
    return Sheet(round(volts, 3), columns["pulse_us"], columns["load_N"] * arguments.lever_ratio)


def _tabulated(arguments: argparse.Namespace, sheets: Sequence[Sheet]) -> tuple[MeasuredTable, str]:
    from hindrax_laboratory import plots  # noqa: PLC0415  # of all experiments, slow to import

    found = measured_table(sheets, arguments.stop, arguments.dead_band)
    save_plot(arguments.plot, plots.thrust_table, sheets, found)
    sigma = MANUFACTURER_SIGMA if arguments.load_cell_std is None else arguments.load_cell_std
    table = found.table
    rows = {"pulse_us": list(table.pulse_us), "supply_V": list(table.supply_V), "force_N": [*map(list, table.force_N)]}
    block = {
        "stop_us": arguments.stop,
        "gain_sigma": sigma,
        "source": f"table of {arguments.record.name}",
        "table": {**rows, "sigma_N": round(found.residual_N, 3)},
    }
    text = yaml.safe_dump({"curves": {arguments.name: block}}, sort_keys=False, width=120, default_flow_style=None)
    _check_block(text, arguments.name)
    return found, text


def _check_block(block: str, name: str) -> None:
    """HindraxError where a vehicle file with this block would be refused: load cell not tared, volts in millivolts."""
    try:
        problems = problems_of(build(Curve, yaml.safe_load(block)["curves"][name], f"curves.{name}"))
    except UsageError as error:
        raise HindraxError(f"bollard: the sweep gives no curve for a vehicle file: {error}; {CURVE_REMEDY}") from error
    if problems:
        raise HindraxError(
            f"bollard: {'; '.join(problems)}; tare the load cell, widen --dead-band, take --table, or {OUTLIERS}"
        )


def print_curve(arguments: argparse.Namespace, curve: BollardCurve | MeasuredTable, block: str) -> None:
    """Print the curve, the block, and a warning where a cubic falls or does not follow the smallest forces.

    Parameters
    ----------
    arguments
        With `json`.
    curve
        Of the fit, or the table itself.
    block
        For the vehicle file.
    """
    if isinstance(curve, MeasuredTable):
        print_answer({"curve": curve, "block": block}, lambda: _show_table(curve, block), as_json=arguments.json)
        return
    for direction, name in ((curve.negative, "negative"), (curve.positive, "positive")):
        if not direction.monotone:
            low, high = direction.monotone_from_us, direction.monotone_to_us
            print_stderr(f"warning: the {name} cubic rises only from {low:.0f} to {high:.0f} us")
    if curve.missed_at_low > MOST_MISSED:
        part = 100.0 * curve.missed_at_low
        print_stderr(f"warning: below 2 N the cubics miss up to {part:.0f} % of the force; --table follows it")
    print_answer({"curve": curve, "block": block}, lambda: _show_curve(curve, block), as_json=arguments.json)


def _show_table(found: MeasuredTable, block: str) -> None:
    rows = [
        (f"{volts:g} V", f"{below:g} to {above:g}", f"{row[0]:.2f}", f"{row[-1]:.2f}")
        for volts, (below, above), row in zip(found.table.supply_V, found.dead_us, found.table.force_N, strict=True)
    ]
    print_table("Thrust", ["supply"], ["dead band [us]", "at full astern [N]", "at full ahead [N]"], rows)
    knots = len(found.table.pulse_us)
    print_fitted(
        f"{found.samples} samples, {knots} knots; deviation of a sample from the table: {found.residual_N:.2g} N"
    )
    print_whole(block, end="")  # a list that goes on below is YAML still


def _show_curve(curve: BollardCurve, block: str) -> None:
    """Whole tables where the screen has room; the coefficients of a short one are in the block."""
    directions = {"negative": curve.negative, "positive": curve.positive}

    def tables() -> None:
        for name, direction in directions.items():
            print_values(f"{name}: {direction.from_us:.0f} to {direction.to_us:.0f} us", _direction_rows(direction))
        end()

    def lines() -> None:
        for name, direction in directions.items():
            ends = (direction.from_us, direction.to_us)
            found = [(at, direction.force_N(at)) for at in ends]
            forces = ", ".join(f"{measured(one.value, one.std)} N at {at:.0f} us" for at, one in found)
            print_fitted(f"{name}: {forces}")
        residuals = " and ".join(f"{one.residual_std_N:.2g}" for one in directions.values())
        end(f"residuals {residuals} N; ")

    def end(before: str = "") -> None:
        print_fitted(f"{before}gain deviation at full thrust: {100.0 * curve.gain_sigma:.2f} %")
        print_whole(block, end="")  # a list that goes on below is YAML still

    print_what_fits(tables, lines, above=AROUND)


def _direction_rows(direction: Direction) -> list[tuple[str, object, str]]:
    units = ("N", "N/us", "N/us^2", "N/us^3")
    rows: list[tuple[str, object, str]] = list(zip(COEFFICIENTS, direction.c, units, strict=True))
    rows.append((f"thrust at {direction.from_us:.0f} us", direction.force_N(direction.from_us), "N"))
    rows.append((f"thrust at {direction.to_us:.0f} us", direction.force_N(direction.to_us), "N"))
    rows.append(("residual", f"{direction.residual_std_N:.2g}", "N"))
    rows.append(("rises with the pulse everywhere", direction.monotone, ""))
    return rows
