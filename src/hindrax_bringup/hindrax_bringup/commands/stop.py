"""`hindrax stop`: neutral, disarmed, nothing flies, whatever was going on."""

from __future__ import annotations

import argparse
import sys

from hindrax_bringup.commands._operator import add_stack, joined
from hindrax_bringup.presence import choose, stacks
from hindrax_core.errors import HindraxError

NAME = "stop"
HELP = "neutral, disarm, and cancel whatever flies, in every stack that runs here"
EXAMPLE = "./hindrax stop"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack; here all of them by default, because nobody should have to look up a number first."""
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Stop each; go on with the next when one cannot be reached."""
    from hindrax_bringup.nodes.orders import stop  # noqa: PLC0415  # rclpy is loaded only where it is needed

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
        failed += [f"{title}: {sentence}" for sentence in wrong]
        if not wrong:
            print(f"stopped and disarmed: {title}")
    for sentence in failed:
        print(f"hindrax stop: {sentence}", file=sys.stderr)
    if failed:
        print("the thrusters go neutral by themselves half a second after the last command;", file=sys.stderr)
        print("if they turn on, cut the power", file=sys.stderr)
    return 1 if failed else 0
