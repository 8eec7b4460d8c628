"""`hindrax health`: whether every stack here is well. A service asks often, so nothing slow is imported here."""

import argparse
import time

from hindrax_bringup.liveness import stacks_well
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_cli.command import command
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted


@command("./hindrax health || ./hindrax doctor")
def health(_arguments: argparse.Namespace) -> int:
    """One line about every stack on this machine; exit 1 while one is starting or unwell (`doctor` shows why)."""
    try:
        well, sentence = stacks_well(runtime_folder(), time.monotonic())
    except OSError as error:
        raise HindraxError(f"no stack of this user can be up here: {error}") from error
    if not well:
        raise HindraxError(sentence)
    print_fitted(sentence)
    return 0
