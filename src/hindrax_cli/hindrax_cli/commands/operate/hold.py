"""`hindrax hold`: keep heading, roll, pitch, depth, altitude or the place in the pool."""

from __future__ import annotations

import argparse
import math

from hindrax_control.hold.holds import HOLDS, STATION
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_operator.connection import add_stack, operator_of
from hindrax_operator.snapshot import ANGLES

NAME = "hold"
HELP = "hold an axis where it is or at a value, or let go of it"
EXAMPLE = "./hindrax hold heading 90     (also: hold depth, hold altitude 0.8, hold pitch -10, hold all off)"

OFF = "off"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Axis and value."""
    parser.add_argument(
        "axis",
        choices=(*HOLDS, "all"),
        help="depth and altitude replace each other; station: the place in the pool, by the DVL",
    )
    parser.add_argument(
        "value", nargs="?", metavar="VALUE", help="degrees or meters; `off` lets go; default: where the vehicle is"
    )
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Send setpoints and wait until the pilot has them."""
    axes, value, engaged = parse(arguments.axis, arguments.value)
    from hindrax_operator.nodes.orders import hold  # noqa: PLC0415  # invalid arguments are refused before rclpy is loaded

    with operator_of(arguments) as operator:
        found = hold(operator, axes, value, engaged=engaged)
    for axis in axes:
        print_fitted(f"holding {axis} at {shown(axis, found[axis])}" if engaged else f"let go of {axis}")
    return 0


def parse(axis: str, text: str | None) -> tuple[tuple[str, ...], float, bool]:
    """Axes, value [rad or m] (NaN: where the vehicle is) and whether to engage. UsageError says what was wanted."""
    if text == OFF:
        return (HOLDS if axis == "all" else (axis,)), math.nan, False
    if axis == "all":
        raise UsageError("hold all: only `off` goes for all; name one axis to hold it")
    if text is None:
        return (axis,), math.nan, True
    if axis == STATION:
        raise UsageError(f"hold station: found {text!r}, wanted `off` or nothing: it is kept where the vehicle is")
    unit = "a number of degrees" if axis in ANGLES else "a number of meters"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(f"hold {axis}: found {text!r}, wanted {unit}, `off`, or nothing (where the vehicle is)")
    return (axis,), math.radians(value) if axis in ANGLES else value, True


def shown(axis: str, value: float) -> str:
    """Setpoint for a person; headings from 0 to 360."""
    if axis == STATION:
        return "this place"
    if axis not in ANGLES:
        return f"{value:.2f} m"
    degrees = math.degrees(value)
    return f"{degrees % 360.0:.1f} deg" if axis == "heading" else f"{degrees:+.1f} deg"
