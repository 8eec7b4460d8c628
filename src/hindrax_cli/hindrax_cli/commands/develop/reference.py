"""`hindrax reference`: the reference pages, from the code, and the figures of the explanation."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from hindrax_bringup.clone import clone_root, developer_module
from hindrax_bringup.network.security import policies
from hindrax_bringup.share_files import share_folder
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted

NAME = "reference"
HELP = "write the reference pages in docs/reference from the code, or check that they are up to date"
EXAMPLE = (
    "./hindrax reference --write\n"
    "  ./hindrax reference --fly      (sixteen pool tests in lock-step, then the figures of docs/explanation)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Check or write, or draw, and where."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="only say what is stale (the default); exit code 1 if any")
    what.add_argument("--write", action="store_true", help="write the pages that are stale, and the access policies")
    what.add_argument("--figures", action="store_true", help="draw the figures of the explanation again")
    what.add_argument("--fly", action="store_true", help="fly the runs behind the figures again, then draw them")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the pages, or of the figures")


def run(arguments: argparse.Namespace) -> int:
    """Write, draw, or look."""
    docs, reference = clone_root() / "docs", developer_module("reference")
    if arguments.figures or arguments.fly:
        return _draw(arguments.out or docs / "explanation" / "figures", again=arguments.fly)
    folder = arguments.out or docs / "reference"
    if arguments.write:
        for name in reference.write(folder):
            print_fitted(folder / name)
        if arguments.out is None:
            _write_policies(share_folder("security") / "policies.xml")
        return 0
    stale = reference.stale(folder)
    if stale:
        raise HindraxError(f"{folder}: stale are {', '.join(stale)}; `{reference.COMMAND}` writes them")
    print_fitted(f"{folder}: up to date", sys.stderr)
    return 0


def _write_policies(file: Path) -> None:
    """Write the access policies if they are stale, and tell it as of a page."""
    text = policies()
    if file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")
        print_fitted(file.resolve())


def _draw(folder: Path, *, again: bool) -> int:
    # Imported here: matplotlib takes long to load.
    figures = developer_module("reference.figures")
    if again:
        flown = []
        for flight in figures.FLIGHTS:
            print_fitted(f"flying {flight}", sys.stderr)
            flown.append(figures.flown(flight))
        kept = [flown[0], *({key: one[key] for key in one if key != "online"} for one in flown[1:])]
        (folder / figures.FLIGHTS_FILE).write_text(json.dumps(kept) + "\n", encoding="utf-8")
    for file in figures.draw(folder):
        print_fitted(file)
    return 0
