"""`hindrax completion`: what a shell needs to complete commands, their words and their options."""

from __future__ import annotations

import argparse

from hindrax_bringup.clone import clone_root
from hindrax_cli.command_page import SHELLS, completion, page_of
from hindrax_core.text.screen_text import print_whole

NAME = "completion"
HELP = "print the completion of commands and options for a shell; its first line says where to keep it"
EXAMPLE = "./hindrax completion bash"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which shell."""
    parser.add_argument("shell", choices=SHELLS, help="which shell")


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    print_whole(completion(page_of(clone_root()), arguments.shell), end="")
    return 0
