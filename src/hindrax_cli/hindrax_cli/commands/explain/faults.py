"""`hindrax faults`: every process and device dies, freezes and lies in mock; pulses and true pose are judged."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import make_table, print_table
from hindrax_bringup.clone import developer_module
from hindrax_cli.argument_types import add_json
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted

NAME = "faults"
HELP = "every process and device fails in mock: how long until neutral"
EXAMPLE = "./hindrax faults --only sensors --seeds 1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What fails, and how often."""
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", help="these processes and devices; any other word lists all"
    )
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="flights of each fault; default 3")
    parser.add_argument("--workers", type=int, default=0, metavar="N", help="processes; default: one per core")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Fly all, print the table; 1 when a cell violates what must never be."""
    table = developer_module("faults.table")
    only = tuple(arguments.only or table.WHO)
    if strange := [name for name in only if name not in table.WHO]:
        raise UsageError(f"--only: found {strange[0]!r}, wanted {', '.join(table.WHO)}")
    for option in ("seeds", "workers"):
        if (found := getattr(arguments, option)) < (least := int(option == "seeds")):
            raise UsageError(f"--{option}: found {found}, wanted {least} or more")
    cells = table.fly(only, range(1, arguments.seeds + 1), arguments.workers)
    violated = [f"{one.who} {one.what}, {one.mode}, seed {one.seed}: {why}" for one in cells for why in one.violated]
    if arguments.json:
        print_json({"cells": [asdict(one) for one in cells], "violated": violated})
        return int(bool(violated))
    title = f"Time to neutral, the longest of {arguments.seeds} seeds"
    shown = make_table(title, ("who", "what", *table.MODES), (), ("said",))
    for row in table.rows(cells):
        shown.add_row(*row)
    print_table(shown)
    for sentence in violated:
        print_fitted(f"violated: {sentence}")
    return int(bool(violated))
