"""`hindrax monitor`: the live view in a terminal."""

from __future__ import annotations

import argparse
import sys

from hindrax_core.errors import UsageError
from hindrax_operator.connection import add_stack, presence_of

NAME = "monitor"
HELP = "live view in the terminal (also over ssh); keys to stop and disarm"
EXAMPLE = "./hindrax monitor"
JOIN_S = 15.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack."""
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Join the graph, show it until q."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):  # where textual hears keys, and where it draws
        raise UsageError("found no terminal to draw on, wanted one; over ssh use `ssh -t`")
    from hindrax_operator.monitor.app import Monitor  # noqa: PLC0415  # textual takes long to load
    from hindrax_operator.monitor.graph_link import GraphLink  # noqa: PLC0415  # as above

    link = GraphLink(presence_of(arguments), sim_time=arguments.sim_time, namespace=arguments.namespace)
    link.start()
    try:
        link.wait(JOIN_S)
        Monitor(link).run()
    finally:
        link.close()
    return 0
