"""`hindrax lights`: brightness of the lamps."""

from __future__ import annotations

import argparse

from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import load_vehicle
from hindrax_operator.connection import add_stack, operator_of, presence_of

NAME = "lights"
HELP = "set the brightness of the lamps, from 0 to 1; they go out when nobody commands the vehicle any more"
EXAMPLE = "./hindrax lights 0.5       (both; `lights 1 0`: the first only, `lights off`)"
OFF = "off"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Brightness of each lamp."""
    parser.add_argument("levels", nargs="+", metavar="LEVEL", help="of all lamps, or of each; or `off`")
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Set the lights of the stack that runs."""
    found = presence_of(arguments)
    lamps = len(load_vehicle(found.vehicle if found else vehicle_file(usual_vehicle())).output.light_channels)
    levels = parse(arguments.levels, lamps)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes.orders import set_lights  # noqa: PLC0415  # arguments are checked first

        set_lights(operator, levels)
    print_fitted(f"lights at {', '.join(f'{level:g}' for level in levels)}")
    return 0


def parse(words: list[str], lamps: int) -> list[float]:
    """Brightness of every lamp. UsageError says what was wanted."""
    try:
        levels = [0.0] if words == [OFF] else [float(word) for word in words]
    except ValueError:
        levels = []
    if len(levels) not in (1, lamps) or not all(0.0 <= level <= 1.0 for level in levels):
        raise UsageError(f"lights: found {' '.join(words)!r}, wanted one or {lamps} numbers from 0 to 1, or `off`")
    return levels * lamps if len(levels) == 1 else levels
