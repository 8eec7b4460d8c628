"""`hindrax arm`: let the thrusters turn."""

from __future__ import annotations

import argparse

from hindrax_core.text.screen_text import print_fitted
from hindrax_operator.connection import add_stack, operator_of

NAME = "arm"
HELP = "arm the thrusters: neutral for the ESCs' time first, then they obey"
EXAMPLE = "./hindrax arm"
ARMING_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack."""
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Request arming and wait until the thrusters report it."""
    with operator_of(arguments) as operator:
        operator.wait_for_thrusters()
        print_fitted("arming; keep hands off the thrusters")
        operator.arm(seconds=ARMING_S)
        print_fitted(f"armed ({operator.thrusters.output}); `./hindrax stop` ends it at any time")
    return 0
