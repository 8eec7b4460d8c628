"""`hindrax allocate`: one wrench to forces and pulses, explained."""

import argparse
import re

from hindrax_analysis.terminal import print_answer, print_table
from hindrax_cli.argument_types import add_json, add_vehicle, finite, positive
from hindrax_cli.command import command, option
from hindrax_control.allocation.allocator import Allocator
from hindrax_core.errors import UsageError
from hindrax_core.signals import Allocation
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import AXES, WRENCH_SYMBOLS, WRENCH_UNITS, load_vehicle


def _negative_numbers(parser: argparse.ArgumentParser) -> None:
    # Python 3.11 takes "-1e-5" for an option, and there is no public way to tell it otherwise.
    parser._negative_number_matcher = re.compile(r"^-(\d|\.\d|inf|nan)")  # noqa: SLF001  # see above


@command(
    "./hindrax allocate --wrench 14 0 2 0 0 0.5 --disable T3",
    _negative_numbers,
    option("--wrench", nargs=6, type=finite, required=True, metavar=WRENCH_SYMBOLS, help="wanted, SNAME axes [N, N m]"),
    option("--disable", action="extend", nargs="+", default=[], metavar="NAME", help="leave out thrusters"),
    option("--supply", type=positive, metavar="V", help="supply voltage; default: of the vehicle file"),
    add_vehicle,
    add_json,
)
def allocate(arguments: argparse.Namespace) -> int:
    """One wrench to forces and pulses, explained."""
    allocator = Allocator(load_vehicle(arguments.vehicle))
    disabled = frozenset(word for name in arguments.disable for word in name.split(","))
    unknown = sorted(disabled - set(allocator.names))
    if unknown:
        raise UsageError(f"--disable: found {unknown[0]!r}, wanted some of {', '.join(allocator.names)}")
    X, Y, Z, K, M, N = arguments.wrench
    allocation = allocator.allocate((X, Y, Z, K, M, N), disabled, supply_V=arguments.supply)
    found = _document(allocator.names, allocation)
    return print_answer(found, lambda: _show(allocator.names, allocation), as_json=arguments.json)


def _document(names: tuple[str, ...], allocation: Allocation) -> dict[str, object]:
    return {
        "forces": dict(zip(names, allocation.forces_N, strict=True)),
        "pulses": dict(zip(names, allocation.pulses_us, strict=True)),
        "achieved": list(allocation.achieved),
        "shortfall": list(allocation.shortfall),
        "saturated": [name for name, at_limit in zip(names, allocation.saturated, strict=True) if at_limit],
        "lost_axes": list(allocation.lost_axes),
        "disabled": list(allocation.disabled),
        "refused": list(allocation.refused),
    }


def _show(names: tuple[str, ...], allocation: Allocation) -> None:
    thrusters, axes = [], []
    outputs = allocation.forces_N, allocation.pulses_us, allocation.saturated
    for name, force, pulse, at_limit in zip(names, *outputs, strict=True):
        note = "disabled" if name in allocation.disabled else "at its limit" if at_limit else ""
        thrusters.append((name, f"{force:z.2f}", str(pulse), note))
    print_table("Thrusters", ("name",), ("force [N]", "pulse [us]", ""), thrusters)
    wrenches = allocation.wanted, allocation.achieved, allocation.shortfall
    for axis, symbol, unit, *values in zip(AXES, WRENCH_SYMBOLS, WRENCH_UNITS, *wrenches, strict=True):
        lost = "lost" if axis in allocation.lost_axes else ""
        axes.append((f"{axis} {symbol} [{unit}]", *(f"{value:z.3f}" for value in values), lost))
    print_table("Wrench", ("axis",), ("wanted", "achieved", "shortfall", ""), axes)
    for refusal in allocation.refused:
        print_fitted(f"refused: {refusal}")
