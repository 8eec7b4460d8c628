"""Orders to a vehicle whose stack is up: `arm`, `disarm`, `hold`, `recentre`, `wrench`, `lights`."""

import argparse
import math
from collections.abc import Iterable, Sequence
from typing import Protocol

from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_cli.argument_types import positive
from hindrax_cli.command import command, option
from hindrax_cli.interrupt import hung_up_alike
from hindrax_control.hold.holds import HOLDS, STATION
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec6
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import WRENCH_SYMBOLS, WRENCH_UNITS, load_vehicle
from hindrax_operator.connection import add_stack, meant_stack, operator_of
from hindrax_operator.snapshot import ANGLES, left_out

ARMING_S = 60.0
OFF = "off"
PLACE_HELP = "meters from the south and the west wall, degrees from the length; default: start, estimated heading"
MEANINGS = (
    "forward [N]",
    "to starboard [N]",
    "down [N]",
    "roll, starboard down [N m]",
    "pitch, bow up [N m]",
    "yaw, to starboard [N m]",
)


@command("./hindrax arm", add_stack)
def arm(arguments: argparse.Namespace) -> int:
    """Arm the thrusters, after the ESCs' time at neutral."""
    with operator_of(arguments) as operator, hung_up_alike():
        operator.wait_for_thrusters()
        print_fitted("arming; keep hands off the thrusters")
        operator.arm(seconds=ARMING_S)
        print_fitted(f"armed ({operator.output}); `./hindrax stop` ends it at any time")
    return 0


@command("./hindrax disarm", add_stack)
def disarm(arguments: argparse.Namespace) -> int:
    """Disarm the thrusters at once."""
    with operator_of(arguments, moves=False) as operator:
        operator.arm(arm=False)
        print_fitted(f"disarmed ({operator.output})")
    return 0


@command(
    "./hindrax hold depth\n./hindrax hold heading 90\n./hindrax hold pitch -10\n./hindrax hold all off",
    option(
        "axis",
        choices=(*HOLDS, "all"),
        help="depth and altitude replace each other; station: the place in the pool, by the DVL",
    ),
    option("value", nargs="?", metavar="VALUE", help="degrees or meters; `off` releases; default: the current value"),
    add_stack,
)
def hold(arguments: argparse.Namespace) -> int:
    """Hold an axis at its current or a given value, or release it."""
    axes, value, engaged = held(arguments.axis, arguments.value)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes import orders  # noqa: PLC0415  # rclpy reads the environment of the stack

        found = orders.hold(operator, axes, value, engaged=engaged)
        without = left_out(operator) if engaged else ()
    for axis in axes:
        print_fitted(f"holding {axis} at {shown(axis, found[axis])}" if engaged else f"released {axis}")
    warn_of(without)
    return 0


def held(axis: str, text: str | None) -> tuple[tuple[str, ...], float, bool]:
    """Axes, value [rad or m] (NaN: where the vehicle is) and whether to engage. UsageError for anything else."""
    if text == OFF:
        return (HOLDS if axis == "all" else (axis,)), math.nan, False
    if axis == "all":
        raise UsageError("hold all: only `off` applies to all; name one axis to hold it")
    if text is None:
        return (axis,), math.nan, True
    if axis == STATION:
        raise UsageError(f"hold station: found {text!r}, wanted `off` or nothing: it holds the current position")
    unit = "a number of degrees" if axis in ANGLES else "a number of meters"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(f"hold {axis}: found {text!r}, wanted {unit}, `off`, or nothing (where the vehicle is)")
    return (axis,), math.radians(value) if axis in ANGLES else value, True


def shown(axis: str, value: float) -> str:
    """Setpoint as text; headings from 0 to 360."""
    if axis == STATION:
        return "this place"
    if axis not in ANGLES:
        return f"{value:.2f} m"
    degrees = math.degrees(value)
    return f"{degrees % 360.0:.1f} deg" if axis == "heading" else f"{degrees:+.1f} deg"


@command(
    "./hindrax recentre\n./hindrax recentre 5 3\n./hindrax recentre 5 3 90",
    option("place", nargs="*", metavar="X Y [DEG]", help=PLACE_HELP),
    add_stack,
)
def recentre(arguments: argparse.Namespace) -> int:
    """Set the position in the pool; dead reckoning continues from there."""
    x_m, y_m, turned_rad = place_of(arguments.place)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes import orders  # noqa: PLC0415  # rclpy reads the environment of the stack

        orders.recentre(operator, x_m, y_m, turned_rad)
    print_fitted(f"the vehicle is {place_text(x_m, y_m)}")
    return 0


def place_text(x_m: float, y_m: float) -> str:
    """The place as text."""
    return "at its start" if math.isnan(x_m) else f"{x_m:.2f} m from the south wall, {y_m:.2f} m from the west wall"


def place_of(words: Sequence[str], name: str = "place") -> tuple[float, float, float]:
    """x, y [m] and heading [rad], NaN where none is given. UsageError for anything else."""
    wanted = "nothing, or X Y [DEG]: meters from the south and the west wall, and degrees from the pool's length"
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = [math.nan]
    if len(numbers) not in (0, 2, 3) or not all(map(math.isfinite, numbers)):
        raise UsageError(f"{name}: found {' '.join(words)!r}, wanted {wanted}")
    x_m, y_m, degrees = (*numbers, *[math.nan] * (3 - len(numbers)))
    return x_m, y_m, math.radians(degrees)


@command(
    "./hindrax wrench 10 0 0 0 0 0 --for 2",
    *(option(symbol, type=float, help=meaning) for symbol, meaning in zip(WRENCH_SYMBOLS, MEANINGS, strict=True)),
    option("--for", dest="seconds", type=positive, default=2.0, metavar="S", help="how long [s]; default 2"),
    add_stack,
)
def wrench(arguments: argparse.Namespace) -> int:
    """Push with a wrench for a while, added to the holds; it ends with this command."""
    pushed = checked([getattr(arguments, symbol) for symbol in WRENCH_SYMBOLS])
    found = meant_stack(arguments)
    if found is not None:
        require_within(pushed, load_vehicle(found.vehicle).limits.wrench)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes.orders import apply_wrench, require_armed  # noqa: PLC0415  # as above

        require_armed(operator)
        print_fitted(f"pushing {wrench_text(pushed)} for {arguments.seconds:g} s; Ctrl-C ends it")
        print_fitted(outcome_text(apply_wrench(operator, pushed, arguments.seconds)))
        warn_of(left_out(operator))
    return 0


def warn_of(without: Sequence[str]) -> None:
    """Say which thrusters are disabled: what was ordered is served without them."""
    for sentence in without:
        print_stderr(f"without a thruster: {sentence}")


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
            wanted = f"wanted {-most:g} to {most:g} (limits of the vehicle file)"
            raise UsageError(f"wrench {symbol}: found {value:g}, {wanted}")


def wrench_text(wrench: Iterable[float]) -> str:
    """Return the axes that are not zero, with their units."""
    rows = zip(WRENCH_SYMBOLS, wrench, WRENCH_UNITS, strict=True)
    return ", ".join(f"{symbol} {value:+.1f} {unit}" for symbol, value, unit in rows if abs(value) >= 0.05) or "nothing"


class Allocated(Protocol):
    """An AllocationStatus message: wrenches [N, N m], and what was refused."""

    @property
    def achieved(self) -> Iterable[float]:
        """What the thrusters give."""
        ...

    @property
    def shortfall(self) -> Iterable[float]:
        """What they lack of what was wanted."""
        ...

    @property
    def refused(self) -> Sequence[str]:
        """A sentence for each refused part."""
        ...


def outcome_text(allocation: Allocated) -> str:
    """Return what the thrusters made of it at the end, holds included."""
    text = f"done; total force including holds: {wrench_text(allocation.achieved)}"
    lacking = wrench_text(allocation.shortfall)
    if lacking != "nothing":
        text += f"; lacking {lacking}"
    return text + (f"; refused: {'; '.join(allocation.refused)}" if allocation.refused else "")


@command(
    "./hindrax lights 0.5\n# the first only:\n./hindrax lights 1 0\n./hindrax lights off",
    option("levels", nargs="+", metavar="LEVEL", help="of all lamps, or of each; or `off`"),
    add_stack,
)
def lights(arguments: argparse.Namespace) -> int:
    """Set the brightness of the lamps, from 0 to 1; they go out when commands stop."""
    found = meant_stack(arguments)
    lamps = len(load_vehicle(found.vehicle if found else vehicle_file(usual_vehicle())).output.light_channels)
    levels = brightness(arguments.levels, lamps)
    with operator_of(arguments) as operator:
        from hindrax_operator.nodes.orders import set_lights  # noqa: PLC0415  # as above

        set_lights(operator, levels)
    print_fitted(f"lights at {', '.join(f'{level:g}' for level in levels)}")
    return 0


def brightness(words: list[str], lamps: int) -> list[float]:
    """Brightness of every lamp. UsageError for anything else."""
    try:
        levels = [0.0] if words == [OFF] else [float(word) for word in words]
    except ValueError:
        levels = []
    if len(levels) not in (1, lamps) or not all(0.0 <= level <= 1.0 for level in levels):
        raise UsageError(f"lights: found {' '.join(words)!r}, wanted one or {lamps} numbers from 0 to 1, or `off`")
    return levels * lamps if len(levels) == 1 else levels
