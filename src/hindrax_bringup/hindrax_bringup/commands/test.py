"""`hindrax test`: style, types, rooms and all tests; with arguments, pytest alone."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from hindrax_bringup.root import clone_root

NAME = "test"
HELP = "all tests; with arguments only pytest, with those"
EXAMPLE = "./hindrax test test/golden -k dvl75"
PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Everything goes to pytest."""
    parser.add_argument("arguments", nargs=argparse.REMAINDER, metavar="PYTEST ARGS", help="as pytest takes them")


def checks() -> list[tuple[str, list[str]]]:
    """What is checked besides pytest: name and command."""
    run = [sys.executable, "-m"]
    return [
        ("style", [*run, "ruff", "check", "--quiet"]),
        ("format", [*run, "ruff", "format", "--check", "--quiet"]),
        ("rooms", [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"]),
        ("types", [*run, "mypy"]),
    ]


def run(arguments: argparse.Namespace) -> int:
    """Run the checks, then pytest, all to their end; 1 if any failed."""
    root = clone_root()
    failed = []
    words = arguments.arguments[1:] if arguments.arguments[:1] == ["--"] else arguments.arguments
    steps = [] if words else checks()
    for name, command in [*steps, ("tests", [sys.executable, "-m", "pytest", *words])]:
        begin = time.monotonic()
        print(f"== {name}", flush=True)
        code = subprocess.run(command, cwd=root, check=False, stdin=subprocess.DEVNULL).returncode  # noqa: S603  # our own commands
        print(f"== {name}: {'good' if code == 0 else 'FAILED'} ({time.monotonic() - begin:.0f} s)", flush=True)
        if code:
            failed.append(name)
    return 1 if failed else 0
