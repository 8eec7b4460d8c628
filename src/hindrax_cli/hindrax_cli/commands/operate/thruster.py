"""`hindrax thruster`: one thruster alone, its curve from a bench sweep, and disabled thrusters."""

import argparse
from pathlib import Path

import yaml

from hindrax_analysis.terminal import print_answer
from hindrax_cli.argument_types import add_json, add_vehicle, positive
from hindrax_cli.command import command, option
from hindrax_cli.thrust_curve_fit import add_rig, fitted, print_curve
from hindrax_cli.vehicle_edit import keep, require_editable
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_operator.connection import add_stack, operator_of

ACTIONS = ("fit", "disable", "enable")


def _groups(parser: argparse.ArgumentParser) -> None:
    alone = parser.add_argument_group("one thruster alone")
    alone.add_argument("--force", type=float, metavar="N", help="along its axis, negative: astern [N]")
    alone.add_argument("--for", dest="seconds", type=positive, default=2.0, metavar="S", help="how long; default 2 [s]")
    alone.add_argument("--mock", action="store_true", help="of the mock vehicle")
    health = parser.add_argument_group("disable")
    health.add_argument("--reason", default="disabled by the operator", help="one sentence for the bag and the display")
    sweep = parser.add_argument_group(
        "fit", "a sweep with columns pulse_us, load_N, supply_V; or a workbook or CSV of the manufacturer"
    )
    add_rig(sweep)
    sweep.add_argument("--write", action="store_true", help="put the curve into the vehicle file")
    sweep.add_argument("--plot", type=Path, metavar="FILE", help="draw the sweep and the curve")
    sweep.add_argument("--field", action="append", default=[], help=argparse.SUPPRESS)
    add_json(sweep)


@command(
    "# armed for it alone, so not beside a running stack:\n"
    "./hindrax thruster 3 --force 5 --for 2\n"
    "./hindrax thruster fit sweep.csv --lever-ratio 2 --load-cell-std 0.005 --write\n"
    "./hindrax thruster fit T200-Public-Performance-Data.xlsx --write\n"
    "./hindrax thruster disable T3 --reason 'blade lost'\n"
    "./hindrax thruster enable T3",
    option("what", metavar="N|fit|disable|enable", help="a thruster (3 or T3), or an action"),
    option("which", nargs="*", metavar="FILE|T3", help="sweep to fit, thrusters to disable or enable"),
    add_vehicle,
    add_stack,
    _groups,
)
def thruster(arguments: argparse.Namespace) -> int:
    """Run one thruster, fit its curve from a sweep, disable or enable it."""
    if arguments.what == "fit":
        return _fit(arguments)
    if arguments.what in ACTIONS:
        return _set_health(arguments)
    if arguments.which or arguments.force is None:
        raise UsageError(f"thruster {arguments.what}: wanted --force NEWTONS and nothing else, or {', '.join(ACTIONS)}")
    from hindrax_operator.one_thruster import run_one  # noqa: PLC0415  # fitting does without the stack

    vehicle, how = Path(arguments.vehicle), (arguments.what, arguments.force, arguments.seconds)
    print_fitted(run_one(*how, vehicle, mock=arguments.mock, pid=arguments.stack))
    return 0


def _fit(arguments: argparse.Namespace) -> int:
    if len(arguments.which) != 1:
        raise UsageError(
            f"thruster fit: found {len(arguments.which)} files, wanted one sweep (CSV, or a workbook .xlsx)"
        )
    arguments.record = Path(arguments.which[0])
    require_editable(arguments)
    curve, block = fitted(arguments)
    name, fresh = arguments.name, yaml.safe_load(block)["curves"][arguments.name]
    kept = keep(arguments, ("curves", name), fresh, f"curves.{name} of {arguments.vehicle}")
    print_curve(arguments, curve, block)
    if not arguments.json:
        print_fitted(kept)
    return 0


def _set_health(arguments: argparse.Namespace) -> int:
    names = set(arguments.which)
    if not names:
        raise UsageError(f"thruster {arguments.what}: found no thruster, wanted one or more such as T3")
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes.orders import set_health  # noqa: PLC0415  # rclpy reads the environment of the stack

        left_out = set_health(operator, names, arguments.reason, usable=arguments.what == "enable")
        lost = list(operator.allocation.lost_axes) if operator.allocation is not None else []
    text = f"disabled: {', '.join(left_out) or 'none'}" + (f"; lost axes: {', '.join(lost)}" if lost else "")
    return print_answer({"disabled": left_out, "lost_axes": lost}, text, as_json=arguments.json)
