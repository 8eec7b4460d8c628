"""Argument types shared by several commands."""

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_cli.command import Declare, option
from hindrax_core.topics import NAMESPACE, namespace_arguments
from hindrax_core.vehicle import load_vehicle

if TYPE_CHECKING:
    from hindrax_bringup.node_options import ParameterOverrides
    from hindrax_drivers.nodes.thruster_settings import Settings

NumberT = TypeVar("NumberT", int, float)
WHICH = "vehicle: its file, or its name"


def checked(kind: type[NumberT], wanted: str, fits: Callable[[NumberT], bool]) -> Callable[[str], NumberT]:
    """Argument type: a number that fits; any other is refused with what was wanted.

    Parameters
    ----------
    kind
        `int` or `float`.
    wanted
        Words of the range, for the refusal.
    fits
        Whether a number is within it.

    Returns
    -------
    Callable[[str], NumberT]
        For the `type` of an argument.
    """

    def read(text: str) -> NumberT:
        number = kind(text)
        if not fits(number):
            bound = "" if math.isfinite(number) or "finite" in wanted else ", and finite"
            raise argparse.ArgumentTypeError(f"found {text}, wanted {wanted}{bound}")
        return number

    read.__name__ = kind.__name__  # by which the parser says what it wanted of a text that is no number
    return read


def within(kind: type[NumberT], low: NumberT, high: NumberT) -> Callable[[str], NumberT]:
    """Argument type: a number within bounds.

    Parameters
    ----------
    kind
        `int` or `float`.
    low, high
        Both are still taken.

    Returns
    -------
    Callable[[str], NumberT]
        For the `type` of an argument.
    """
    return checked(kind, f"{low:.10g} to {high:.10g}", lambda number: low <= number <= high)


def at_least(low: int) -> Callable[[str], int]:
    """Argument type: a whole number from `low` on."""
    return checked(int, f"{low} or more", lambda number: number >= low)


finite = checked(float, "a finite number", math.isfinite)
positive = checked(float, "more than 0", lambda number: 0.0 < number < math.inf)
pace = checked(float, "0 (no bound) or more", lambda number: 0.0 <= number < math.inf)
"""Times real time."""
seed = within(int, 0, (1 << 32) - 1)
"""Of everything random; goals carry it in 32 bits."""


def share(text: str) -> float:
    """Argument type: a share above zero, also as percent: 0.02 or 2%."""
    number = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
    if not 0.0 < number <= 1.0:
        raise argparse.ArgumentTypeError(f"found {text}, wanted more than 0, at most 1 or 100%")
    return number


def vehicle(name: str) -> str:
    """Argument type: the file of a vehicle that is named by its file or its name."""
    if not name:
        raise argparse.ArgumentTypeError("found no name, wanted a vehicle")
    return str(vehicle_file(name))


def add_vehicle(parser: argparse.ArgumentParser, meaning: str = WHICH) -> None:
    """Vehicle; the default one where none is named."""
    parser.add_argument("--vehicle", type=vehicle, default=usual_vehicle(), metavar="NAME", help=meaning)


def named_vehicle(meaning: str) -> Declare:
    """A vehicle where one is named, else None."""
    return option("--vehicle", type=vehicle, metavar="NAME", help=meaning)


def add_tuning(parser: argparse.ArgumentParser) -> None:
    """Namespace and parameters of the nodes."""
    parser.add_argument("--namespace", default=NAMESPACE, metavar="/NAME", help=f"of the nodes; default {NAMESPACE}")
    add_parameters(parser)


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """Parameters of the nodes, for a command whose vehicle is named otherwise."""
    parser.add_argument("--params", default="", metavar="FILE", help="ROS parameter file for the nodes")
    one = "one parameter, repeatable: pilot.holds.turn_radps:=0.3 (docs/reference/parameters.md)"
    parser.add_argument("--set", action="append", default=[], metavar="NODE.NAME:=VALUE", help=one)


def tuning_of(arguments: argparse.Namespace) -> "ParameterOverrides":
    """Read them back."""
    from hindrax_bringup.node_options import ParameterOverrides  # noqa: PLC0415  # the wheel has no nodes

    vehicle = load_vehicle(arguments.vehicle) if arguments.vehicle else None
    unproven = ("pilot.guards.unproven:=fly",) if getattr(arguments, "uncommissioned", False) else ()
    sensors = tuple(vehicle.sensors) if vehicle else ()
    tuning = ParameterOverrides(arguments.namespace, arguments.params, (*arguments.set, *unproven), sensors)
    if vehicle and (arguments.params or arguments.set):
        from hindrax_operator.node_parameters import check_parameters  # noqa: PLC0415  # it loads every node's knobs

        check_parameters(tuning, vehicle)
    return tuning


def output_settings(arguments: argparse.Namespace) -> "Settings":
    """Vehicle, port and guard of the thruster output by the arguments of a command, as its node reads them."""
    from hindrax_drivers.nodes.thruster_settings import NODE, read_settings  # noqa: PLC0415  # few commands need it

    tuning, own = tuning_of(arguments), f"{NODE}."
    words = ["-p", f"vehicle:={arguments.vehicle}", *namespace_arguments(tuning.namespace, own_clock=False)]
    words += ["--params-file", tuning.file] if tuning.file else []
    for text in tuning.settings:
        words += ["-p", text.removeprefix(own)] if text.startswith(own) else []
    return read_settings(words)


add_uncommissioned = option(
    "--uncommissioned",
    action="store_true",
    help="fly maneuvers as fast as the vehicle file says although `commission` has not proven it",
)
add_json = option("--json", action="store_true", help="one JSON document on stdout")
add_sensor = option(
    "--sensor", metavar="NAME", help="its name in the vehicle file, where that has several; default: the first"
)
add_i2c_port = option("--port", metavar="PORT", help="I2C bus, or mock:SOCKET; default: of the vehicle file")
