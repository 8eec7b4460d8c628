"""`hindrax weigh`: gain of the thrust from a known weight, guided step by step, in mock, or from a bag."""

import argparse
import math
import select
import sys
import termios
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from hindrax_analysis.identification.known_weight import SHARES, Hold, LoadSpan, Weighing, holds_of
from hindrax_analysis.identification.known_weight import weigh as weighed
from hindrax_analysis.terminal import print_answer, print_table, print_values, working
from hindrax_bringup.stack import OTHER_WORLD, WORLD_HELP
from hindrax_cli.argument_types import add_json, add_vehicle, positive, seed
from hindrax_cli.command import command, option
from hindrax_cli.vehicle_edit import keep, require_editable
from hindrax_control.maneuver.goal import largest_wrench
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import after
from hindrax_core.text.digits import Value
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_operator.connection import add_stack, operator_of

ACTS = {
    "surge": ("a line over a pulley pulls it ahead", "a line over a pulley pulls it astern"),
    "sway": ("a line over a pulley pulls it to starboard", "a line over a pulley pulls it to port"),
    "heave": ("the weight hangs under its middle", "a float of this lift is tied to the middle of its top"),
    "yaw": (
        "two lines over pulleys pull with that each, ahead to starboard and behind to port",
        "two lines over pulleys pull with that each, ahead to port and behind to starboard",
    ),
}
LEVER_SIGMA_m = 0.002


def _elsewhere(parser: argparse.ArgumentParser) -> None:
    mock = parser.add_argument_group("in mock, in lock-step")
    mock.add_argument("--mock", action="store_true", help="the mock vehicle, and a mock operator")
    mock.add_argument("--world", default="ideal", help=f"{WORLD_HELP}. Default: ideal")
    mock.add_argument("--seed", type=seed, default=1, help="of the mock's noise; default 1")
    bag = parser.add_argument_group("after the fact")
    bag.add_argument("--bag", type=Path, metavar="BAG", help="a record of this stack")
    when = "load with the axis [N, N m] and its interval, in seconds from the start of the bag; repeatable"
    bag.add_argument("--hold", action="append", default=[], metavar="LOAD:FROM:TO", help=when)


@command(
    "# with an armed stack, guided:\n"
    "./hindrax weigh surge --load 15 --write\n"
    "./hindrax weigh heave --load 18 --mock --world pool --seed 3\n"
    "./hindrax weigh surge --bag runs/1/bag --hold 0:20:50 --hold 15:80:110 --hold=-15:140:170",
    option("axis", choices=tuple(ACTS), help="roll and pitch: their righting moment carries the load"),
    option("--load", type=positive, metavar="N", help="force of the weight, in water if it hangs in water [N]"),
    option("--load-std", type=positive, default=0.002, metavar="PART", help="its deviation; default 0.002 [-]"),
    option("--lever", type=positive, metavar="M", help="yaw: distance between the two lines along the hull [m]"),
    option("--one-way", action="store_true", help="only the first direction: no float, no second pulley"),
    add_vehicle,
    option("--write", action="store_true", help="put the gain into the vehicle file"),
    add_json,
    add_stack,
    _elsewhere,
)
def weigh(arguments: argparse.Namespace) -> int:
    """Gain of the thrust on an axis from a known weight or a line over a pulley, without a load cell."""
    require_editable(arguments)
    vehicle, axis = load_vehicle(arguments.vehicle), AXES.index(arguments.axis)
    found = weighed(_holds(arguments, vehicle, axis), axis, vehicle, load_sigma=_sigma(arguments))
    kept = found.refused or _keep(arguments, vehicle, found)
    document = {"weighing": found, "written": arguments.write and not found.refused, "refused": found.refused}
    print_answer(document, lambda: show(found, kept), as_json=arguments.json)
    return 1 if found.refused else 0


def _sigma(arguments: argparse.Namespace) -> float:
    """Standard deviation of the load on the axis [-]."""
    lever = LEVER_SIGMA_m / arguments.lever if arguments.lever else 0.0
    return math.hypot(arguments.load_std, lever)


def _holds(arguments: argparse.Namespace, vehicle: Vehicle, axis: int) -> list[Hold]:
    shares = tuple(max(0.0, share) for share in SHARES) if arguments.one_way else SHARES
    if arguments.bag:
        return _from_bag(arguments, vehicle, axis)
    lever = _lever_m(arguments) if arguments.axis == "yaw" else 1.0
    check_load(vehicle, arguments.axis, arguments.load or 0.0, lever)
    if arguments.mock:
        from hindrax_sim.conditions.world_table import sizes_of  # noqa: PLC0415  # no simulator on the vehicle
        from hindrax_sim.flights.weighing_flight import fly_weighing, mock_load  # noqa: PLC0415  # as above

        sizes_of(arguments.world, arguments.seed)
        world = f"{arguments.world},{mock_load(arguments.axis, arguments.load)}"
        print_stderr(f"world of the mock: {arguments.world} ({OTHER_WORLD}), seed {arguments.seed}")
        with working(f"holding {arguments.axis} in lock-step against each load"):
            flight = fly_weighing(vehicle, axis, world, arguments.seed, shares)
        if flight.aborted:
            raise HindraxError(flight.aborted)
        return holds_of(flight.events, axis, [LoadSpan(*one) for one in flight.spans])
    if not arguments.load or (arguments.axis == "yaw" and not arguments.lever):
        raise UsageError(f"{arguments.axis}: wanted --load N{' and --lever M' if arguments.axis == 'yaw' else ''}")
    return _guided(arguments, vehicle, axis, [share * arguments.load * lever for share in shares])


def _lever_m(arguments: argparse.Namespace) -> float:
    """Distance between the two lines that turn the vehicle; UsageError for another one than the mock's."""
    if not arguments.mock:
        return arguments.lever or 0.0
    from hindrax_sim.conditions.hull import APART_m  # noqa: PLC0415  # no simulator on the vehicle

    if arguments.lever not in (None, APART_m):
        raise UsageError(f"weigh yaw: found --lever {arguments.lever:g}, wanted {APART_m:g} in mock; leave it out")
    return APART_m


def check_load(vehicle: Vehicle, axis: str, weight_N: float, lever_m: float) -> None:
    """Refuse a load that would pull the vehicle away.

    Parameters
    ----------
    vehicle
        Whose thrusters hold against it.
    axis
        That it acts on, by name.
    weight_N, lever_m : [N], [m]
        Load, and its lever where the axis is yaw, else 1.

    Raises
    ------
    UsageError
        Names the largest force or moment of the thrusters.
    """
    load, most, unit = weight_N * lever_m, largest_wrench(vehicle)[axis], "N m" if axis == "yaw" else "N"
    if load >= most:
        raise UsageError(
            f"weigh {axis}: found a load of {load:g} {unit}, wanted less than the {most:.1f} {unit} that its "
            "thrusters give; take a smaller weight"
        )


def _guided(arguments: argparse.Namespace, vehicle: Vehicle, axis: int, loads: Sequence[float]) -> list[Hold]:
    ask = partial(ask_for_load, arguments.axis, arguments.load)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes.orders import require_armed  # noqa: PLC0415  # rclpy reads the environment of the stack
        from hindrax_operator.weighing import weigh_on  # noqa: PLC0415  # as above

        require_armed(operator)
        return weigh_on(operator, vehicle, axis, loads, ready=entered, ask=ask, report=print_stderr)


def ask_for_load(axis: str, weight_N: float, load: float, say: Callable[[str], None] | None = None) -> None:
    """Tell a person what to hang on the vehicle.

    Parameters
    ----------
    axis
        That is weighed.
    weight_N : [N]
        Of the load in the water.
    load : [N, N m]
        With the axis; negative: the other way round, 0: nothing.
    say
        Told the same, for who is not at the terminal.
    """
    forget_what_was_typed()
    what = "nothing but its tether" if load == 0.0 else f"{weight_N:g} N: {ACTS[axis][load < 0.0]}"
    sentence = f"on the vehicle: {what}. Let it go gently"
    print_stderr(f"{sentence}, then press Enter")
    if say is not None:
        say(sentence)


def require_tty() -> None:
    """UsageError where nobody can answer: steps of a person would hang for ever."""
    if not sys.stdin.isatty():
        raise UsageError("--session: found no terminal for the steps of a person, wanted one, --yes or --mock")


def forget_what_was_typed() -> None:
    """An Enter from before the question is no answer: the load does not hang yet."""
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def entered() -> bool:
    """Whether a line was entered, without waiting: heartbeats must continue; HindraxError at the end of the input."""
    return entered_line() is not None


def entered_line() -> str | None:
    """The line that was entered, None: none yet; HindraxError at the end of the input."""
    if not select.select([sys.stdin], [], [], 0.0)[0]:
        return None
    line = sys.stdin.readline()
    if not line:
        raise HindraxError("the input has ended, wanted Enter for each step; `weigh --bag --hold` evaluates a record")
    return line.strip()


def _from_bag(arguments: argparse.Namespace, vehicle: Vehicle, axis: int) -> list[Hold]:
    from hindrax_analysis.records.own_bag import bag_events  # noqa: PLC0415  # it loads rclpy, on a stack after its graph is known

    events = list(bag_events(arguments.bag, vehicle))
    if not events:
        raise UsageError(f"{arguments.bag}: holds no navigation and no allocation of this stack")
    start = events[0].stamp
    spans = []
    for text in arguments.hold:
        try:
            load, begin_s, end_s = map(float, text.split(":"))
        except ValueError:
            raise UsageError(f"--hold {text}: wanted LOAD:FROM:TO, such as 15:80:110") from None
        if not (math.isfinite(load) and 0.0 <= begin_s < end_s < math.inf):
            raise UsageError(f"--hold {text}: wanted a load, and seconds from 0 on, the first before the last")
        spans.append(LoadSpan(after(start, begin_s), after(start, end_s), load))
    return holds_of(events, axis, spans)


def _keep(arguments: argparse.Namespace, vehicle: Vehicle, found: Weighing) -> str:
    gains = {key: float(f"{value:.5g}") for key, value in asdict(found.gain).items() if value is not None}
    where = f"thrust_gain.{found.axis} of {arguments.vehicle}"
    if vehicle.thrust_gain:
        return keep(arguments, ("thrust_gain", found.axis), gains, where)
    return keep(arguments, ("thrust_gain",), {found.axis: gains}, where)


def show(found: Weighing, kept: str) -> None:
    """Print the gain each way, what its deviation is made of, and where it is kept."""
    gain = found.gain
    ways = (("positive", gain.positive), ("negative", gain.negative))
    rows: list[tuple[str, object, str]] = [(way, Value(value, gain.sigma), "-") for way, value in ways if value]
    unit = "N m" if AXES.index(found.axis) >= 3 else "N"
    rows += [
        ("std of half the difference of both ways", f"{gain.sigma_difference:.2g}", "-"),
        ("weighed up to", gain.load, unit),
    ]
    print_values(f"Thrust of {found.axis} relative to its curves, losses included", rows)
    budget = sorted(found.contributions.items(), key=lambda one: -one[1])
    print_table("Its uncertainty", ["influence"], ["std [%]"], [(name, f"{100.0 * part:.2f}") for name, part in budget])
    if found.misfit > 3.0 and not found.refused:
        print_stderr(
            f"warning: the holds contradict each other by {found.misfit:.1f} deviations; check line and pulley"
        )
    print_fitted(kept)
