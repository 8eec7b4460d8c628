"""`hindrax health`: whether the stacks on this machine are up and well, for containers and scripts."""

from __future__ import annotations

import argparse
import time

from hindrax_bringup.liveness import stacks_well
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted

NAME = "health"
HELP = "one line about every stack on this machine; exit 1 unless all are up and well (`doctor` finds out why)"
EXAMPLE = "./hindrax health || ./hindrax doctor"


def add_arguments(_parser: argparse.ArgumentParser) -> None:
    """Nothing to choose."""


def run(_arguments: argparse.Namespace) -> int:
    """Read what the tools that look after the stacks, and their processes, say every second."""
    try:
        well, sentence = stacks_well(runtime_folder(), time.monotonic())
    except OSError as error:
        raise HindraxError(f"no stack of this user can be up here: {error}") from error
    if not well:
        raise HindraxError(sentence)
    print_fitted(sentence)
    return 0
