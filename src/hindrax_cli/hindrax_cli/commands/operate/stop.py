"""`hindrax stop`: neutral, disarmed, nothing flies, whatever was going on."""

from __future__ import annotations

import argparse
import sys
import time

from hindrax_bringup.liveness import PERIOD_S, beats
from hindrax_bringup.processes import THRUSTERS
from hindrax_bringup.stack_lock import StackLock, choose, runtime_folder, stacks, vehicle_stack
from hindrax_cli.argument_types import add_parameters, add_vehicle
from hindrax_cli.output_settings import output_settings
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_drivers.nodes.deadman import write_neutral
from hindrax_operator.connection import add_stack, joined

NAME = "stop"
HELP = "neutral, disarm, and cancel whatever flies, in every stack that runs here; or neutral where no stack is left"
EXAMPLE = "./hindrax stop"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack; here all of them by default, because nobody should have to look up a number first."""
    add_stack(parser)
    parser.add_argument(
        "--output",
        action="store_true",
        help="after a stack was killed: put neutral on the thruster output of --vehicle, without any stack",
    )
    add_vehicle(parser)
    add_parameters(parser)


def run(arguments: argparse.Namespace) -> int:
    """Stop each; go on with the next when one cannot be reached."""
    if arguments.output:
        return neutral_on_output(arguments)
    from hindrax_operator.nodes.orders import stop  # noqa: PLC0415  # rclpy is loaded only where it is needed

    found = stacks()
    wanted = [choose(found, arguments.stack)] if arguments.stack is not None or not found else found
    failed = []
    for one in wanted:
        title = one.title if one else "the ROS graph of this terminal"
        try:
            with joined(one, sim_time=arguments.sim_time) as operator:
                wrong = stop(operator)
        except HindraxError as error:
            wrong = [str(error)]
        failed += [f"{title}: {sentence}" for sentence in (*wrong, *([on_the_wire(one)] if wrong else []))]
        if not wrong:
            print_fitted(f"stopped and disarmed: {title}")
    for sentence in failed:
        print_fitted(f"hindrax stop: {sentence}", sys.stderr)
    return 1 if failed else 0


def neutral_on_output(arguments: argparse.Namespace) -> int:
    """Write neutral as the dead man would; refused while a stack has the output in hand."""
    if (found := vehicle_stack()) is not None:
        raise UsageError(f"--output: {found.title} runs, and its dead man has the output; `./hindrax stop` stops it")
    settings = output_settings(arguments)
    if write_neutral(settings):
        raise HindraxError(f"{settings.port}: neutral could not be written; cut the power")
    return 0


def on_the_wire(stack: StackLock | None) -> str:
    """Return what can be said of the pulses of a stack that did not obey."""
    found = {} if stack is None else beats(runtime_folder(), stack.pid, time.monotonic())
    if THRUSTERS.name not in found:
        return "nothing here tells whether its thrusters turn; if they do, cut the power"
    if found[THRUSTERS.name] > 2.0 * PERIOD_S:
        return "its dead man does not beat, so its thrusters may go on with their last pulses; cut the power"
    return "its dead man lives: half a second after the last command they are neutral; if they turn, cut the power"
