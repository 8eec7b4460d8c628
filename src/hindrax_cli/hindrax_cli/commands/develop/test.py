"""`hindrax test`: style, types, rooms and all tests on all cores; with arguments, pytest alone."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hindrax_bringup.clone import VEHICLE_SETUP, WHOLE_SETUP, clone_root, is_vehicle_setup
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_whole

NAME = "test"
HELP = "all checks and tests, on all cores; with arguments only pytest, with those"
EXAMPLE = "./hindrax test test/golden -k dvl75"
PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Everything goes to pytest."""
    parser.add_argument("arguments", nargs=argparse.REMAINDER, metavar="PYTEST ARGS", help="as pytest takes them")


PYTEST = [sys.executable, "-m", "pytest"]
WORKERS = len(os.sched_getaffinity(0)) + 1
"""One more than there are cores: tests with real processes wait half of their time."""
ALL = [*PYTEST, "-n", str(WORKERS), "--durations", "10"]
QUICK = (
    ("style", [sys.executable, "-m", "ruff", "check", "--quiet"]),
    ("format", [sys.executable, "-m", "ruff", "format", "--check", "--quiet"]),
    ("rooms", [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"]),
)
TYPES = [sys.executable, "-m", "mypy"]


def run(arguments: argparse.Namespace) -> int:
    """Run the checks and the tests, all to their end; 1 if any failed."""
    root = clone_root()
    if is_vehicle_setup():
        raise UsageError(f"{VEHICLE_SETUP}, without pytest; {WHOLE_SETUP}")
    words = arguments.arguments[1:] if arguments.arguments[:1] == ["--"] else arguments.arguments
    if words:
        return 0 if good("tests", [*PYTEST, *words], root) else 1
    passed = [good(name, command, root) for name, command in QUICK]
    with tempfile.TemporaryFile("w+") as said:
        print_fitted("== types: checked beside the tests")
        types = subprocess.Popen(TYPES, cwd=root, stdin=subprocess.DEVNULL, stdout=said, stderr=said)  # noqa: S603  # our own command
        passed.append(good("tests", ALL, root))
        passed.append(code_of(types) == 0)
        said.seek(0)
        print_whole(f"{said.read()}== types: {'good' if passed[-1] else 'FAILED'}")
    return 0 if all(passed) else 1


def good(name: str, command: list[str], root: Path) -> bool:
    """Run one check to its end, and say how it went."""
    begin = time.monotonic()
    print_fitted(f"== {name}")
    code = code_of(subprocess.Popen(command, cwd=root, stdin=subprocess.DEVNULL))  # noqa: S603  # our own commands
    print_fitted(f"== {name}: {'good' if code == 0 else 'FAILED'} ({time.monotonic() - begin:.0f} s)")
    return code == 0


def code_of(process: subprocess.Popen[bytes]) -> int:
    """Wait; what Ctrl-C interrupts is left the time to end what it has started."""
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.wait()
        raise
