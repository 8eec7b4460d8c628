"""The thruster output as its node would have it, for commands that write to it without a stack."""

from __future__ import annotations

import argparse

from hindrax_cli.argument_types import tuning_of
from hindrax_core.topics import namespace_arguments
from hindrax_drivers.nodes.thruster_settings import NODE, Settings, read_settings


def output_settings(arguments: argparse.Namespace) -> Settings:
    """Vehicle, port and guard of the output by the words of a command, read as its node reads them."""
    tuning, own = tuning_of(arguments), f"{NODE}."
    words = ["-p", f"vehicle:={arguments.vehicle}", *namespace_arguments(tuning.namespace, own_clock=False)]
    words += ["--params-file", tuning.file] if tuning.file else []
    for text in tuning.settings:
        words += ["-p", text.removeprefix(own)] if text.startswith(own) else []
    return read_settings(words)
