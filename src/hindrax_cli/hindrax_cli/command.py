"""The commands of the tool: their modules, and the declaration of a command.

Exit codes: 0 done, 1 the work failed (HindraxError), 2 wrong use (UsageError), 130 ended by Ctrl-C.
A file that cannot be read as what it should be, or a place where nobody can write, is wrong use; a full disk is not.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Run = Callable[[argparse.Namespace], int]
Declare = Callable[[argparse.ArgumentParser], object]
"""Adds options to a parser."""
GROUPS = {
    "the main job": {"pool.pool_flight": "pool-test", "pool.report_export": "report export", "pool.tune": "tune"},
    "operate the vehicle": {
        "operate.up_stop": "up stop",
        "operate.health": "health",
        "operate.status": "status",
        "operate.view": "monitor web",
        "operate.manual_control": "arm disarm hold recentre wrench lights",
        "operate.joystick": "joystick",
        "operate.thruster": "thruster",
        "operate.commission": "commission",
    },
    "the machine and its devices": {
        "machine.doctor": "doctor",
        "machine.vehicle": "vehicle",
        "machine.mock": "mock",
        "machine.dvl": "dvl",
        "machine.calibration": "imu depth",
        "machine.ping": "ping",
        "machine.output": "oscillator esc",
        "machine.deploy": "deploy",
    },
    "recorded data": {
        "data.bag": "bag",
        "data.identify": "identify",
        "data.predict": "predict",
        "data.replay": "replay",
    },
    "bench experiments": {
        "experiment.blocks": "bollard estimate",
        "experiment.drag": "towing step",
        "experiment.oscillation": "free-decay forced pendulum",
        "experiment.weigh": "weigh",
    },
    "analysis and verification": {
        "explain.allocate": "allocate",
        "explain.papers": "papers",
        "explain.benchmark": "benchmark",
        "explain.trials": "montecarlo faults bench",
    },
    "for shell and developers": {"explain.developer": "completion test reference"},
}
"""Title in the overview -> module -> its commands, each a function of its name."""
MODULES = {
    name: f"hindrax_cli.commands.{module}"
    for group in GROUPS.values()
    for module, names in group.items()
    for name in names.split()
}


@dataclass(frozen=True)
class ToolCommand:
    """A command: function, options and example; `passes_on`: all its arguments go to another program.

    Each line of the example can be pasted; a line that begins with # is a comment.
    """

    run: Run
    example: str
    arguments: tuple[Declare, ...]
    passes_on: bool

    @property
    def name(self) -> str:
        """Name on the command line."""
        return self.run.__name__.replace("_", "-")


def command(example: str, *arguments: Declare, passes_on: bool = False) -> Callable[[Run], ToolCommand]:
    """Make a function a command: its docstring is the help.

    Parameters
    ----------
    example
        Lines for the end of the help.
    *arguments
        Declare its options, in this order.
    passes_on
        Whether all its arguments go to another program.

    Returns
    -------
    Callable[[Run], ToolCommand]
        Decorator.
    """
    return lambda run: ToolCommand(run, example, arguments, passes_on)


def option(*names: str, **how: Any) -> Callable[[argparse._ActionsContainer], object]:
    """One option or argument of a command, as argparse takes it."""
    return lambda parser: parser.add_argument(*names, **how)


def add_words(parser: argparse.ArgumentParser, words: Mapping[str, ToolCommand]) -> None:
    """Subcommands, each with its own arguments; the chosen one is `arguments.word`."""
    below = parser.add_subparsers(dest="word", required=True, metavar="SUBCOMMAND")
    for name, one in words.items():
        about = one.run.__doc__
        style, epilog = parser.formatter_class, example_text(one)
        made = below.add_parser(name, help=about, description=about, epilog=epilog, formatter_class=style)
        for declare in one.arguments:
            declare(made)


def example_text(command: ToolCommand) -> str:
    """End of the help of a command."""
    return "\n".join(["example:", *(f"  {line}" for line in command.example.splitlines())])


def help_text(docstring: str | None) -> str:
    """Help of a command, from the docstring of its function."""
    return (docstring or "")[:1].lower() + (docstring or "")[1:].removesuffix(".")
