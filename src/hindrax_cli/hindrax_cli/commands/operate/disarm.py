"""`hindrax disarm`: thrusters neutral, and commands ignored until the next arming."""

from __future__ import annotations

import argparse

from hindrax_core.text.screen_text import print_fitted
from hindrax_operator.connection import add_stack, operator_of

NAME = "disarm"
HELP = "disarm the thrusters at once"
EXAMPLE = "./hindrax disarm"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack."""
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Request disarming and wait until the thrusters report it."""
    with operator_of(arguments) as operator:
        operator.arm(arm=False)
        print_fitted(f"disarmed ({operator.thrusters.output})")
    return 0
