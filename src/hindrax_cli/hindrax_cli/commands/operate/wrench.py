"""`hindrax wrench`: apply a wrench for a while."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from hindrax_cli.argument_types import positive
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec6
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import WRENCH_SYMBOLS, WRENCH_UNITS, load_vehicle
from hindrax_operator.connection import add_stack, operator_of, presence_of

NAME = "wrench"
HELP = "push with a wrench for a while, added to the holds; it ends with this command"
EXAMPLE = "./hindrax wrench 10 0 0 0 0 0 --for 2      (forward with 10 N for 2 s)"
MEANINGS = (
    "forward [N]",
    "to starboard [N]",
    "down [N]",
    "roll, starboard down [N m]",
    "pitch, bow up [N m]",
    "yaw, to starboard [N m]",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Wrench and time."""
    for symbol, meaning in zip(WRENCH_SYMBOLS, MEANINGS, strict=True):
        parser.add_argument(symbol, type=float, help=meaning)
    parser.add_argument(
        "--for", dest="seconds", type=positive, default=2.0, metavar="S", help="how long [s]; default 2"
    )
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Repeat the wrench at 10 Hz until its time is over or Ctrl-C; the vehicle forgets it 0.5 s after the last."""
    wrench = checked([getattr(arguments, symbol) for symbol in WRENCH_SYMBOLS])
    found = presence_of(arguments)
    if found is not None:
        require_within(wrench, load_vehicle(found.vehicle).limits.wrench)
    from hindrax_operator.nodes.orders import apply_wrench, require_armed  # noqa: PLC0415  # invalid arguments cost no rclpy

    with operator_of(arguments) as operator:
        require_armed(operator)
        print_fitted(f"pushing {wrench_text(wrench)} for {arguments.seconds:g} s; Ctrl-C ends it")
        print_fitted(outcome_text(apply_wrench(operator, wrench, arguments.seconds)))
    return 0


def checked(values: Sequence[float]) -> Vec6:
    """Six finite numbers, or UsageError."""
    for symbol, value in zip(WRENCH_SYMBOLS, values, strict=True):
        if not math.isfinite(value):
            raise UsageError(f"wrench {symbol}: found {value}, wanted a finite number")
    X, Y, Z, K, M, N = values
    return (X, Y, Z, K, M, N)


def require_within(wrench: Vec6, limits: Vec6) -> None:
    """UsageError for an axis beyond the limits of the vehicle file: the vehicle would silently give less."""
    for symbol, value, most in zip(WRENCH_SYMBOLS, wrench, limits, strict=True):
        if abs(value) > most:
            raise UsageError(
                f"wrench {symbol}: found {value:g}, wanted {-most:g} to {most:g} (limits of the vehicle file)"
            )


def wrench_text(wrench: Sequence[float]) -> str:
    """Return the axes that are not zero, with their units."""
    parts = [
        f"{s} {v:+.1f} {u}" for s, v, u in zip(WRENCH_SYMBOLS, wrench, WRENCH_UNITS, strict=True) if abs(v) >= 0.05
    ]
    return ", ".join(parts) or "nothing"


def outcome_text(allocation: Any) -> str:
    """Return what the thrusters made of it at the end, holds included."""
    text = f"done; with the holds it was {wrench_text(allocation.achieved)}"
    lacking = wrench_text(allocation.shortfall)
    if lacking != "nothing":
        text += f"; lacking {lacking}"
    return text + (f"; refused: {'; '.join(allocation.refused)}" if allocation.refused else "")
