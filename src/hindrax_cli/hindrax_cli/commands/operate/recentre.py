"""`hindrax recentre`: say where in the pool the vehicle is, and begin dead reckoning there."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_operator.connection import add_stack, operator_of

NAME = "recentre"
HELP = "say where in the pool the vehicle is; dead reckoning goes on from there"
EXAMPLE = "./hindrax recentre     (at the start of the pilot's parameters; also: recentre 5 3, recentre 5 3 90)"
PLACE_HELP = "meters from the south and the west wall, degrees from the length; default: the start, turned as reckoned"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Place and heading."""
    parser.add_argument("place", nargs="*", metavar="X Y [DEG]", help=PLACE_HELP)
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Tell the pilot and wait for its answer."""
    x_m, y_m, turned_rad = place_of(arguments.place)
    from hindrax_operator.nodes.orders import recentre  # noqa: PLC0415  # invalid arguments are refused before rclpy is loaded

    with operator_of(arguments) as operator:
        recentre(operator, x_m, y_m, turned_rad)
    print_fitted(f"the vehicle is {shown(x_m, y_m)}")
    return 0


def place_of(words: Sequence[str]) -> tuple[float, float, float]:
    """x, y [m] and heading [rad], NaN where none is given. UsageError says what was wanted."""
    wanted = "nothing, or X Y [DEG]: meters from the south and the west wall, and degrees from the pool's length"
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = [math.nan]
    if len(numbers) not in (0, 2, 3) or not all(map(math.isfinite, numbers)):
        raise UsageError(f"place: found {' '.join(words)!r}, wanted {wanted}")
    x_m, y_m, degrees = (*numbers, *[math.nan] * (3 - len(numbers)))
    return x_m, y_m, math.radians(degrees)


def shown(x_m: float, y_m: float) -> str:
    """The place for a person."""
    return "at its start" if math.isnan(x_m) else f"{x_m:.2f} m from the south wall, {y_m:.2f} m from the west wall"
