"""The command line tool `hindrax`: finds the command, runs it, turns what went wrong into one sentence."""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import importlib
import importlib.util
import os
import pkgutil
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import NoReturn, Protocol

from hindrax_bringup import commands
from hindrax_core.errors import HindraxError, UsageError

GROUPS = (
    ("the main job", ("pool-test", "report", "export")),
    (
        "run and drive the vehicle",
        ("up", "monitor", "web", "arm", "disarm", "stop", "hold", "wrench", "joystick", "lights", "thruster"),
    ),
    ("the machine and its devices", ("doctor", "health", "mock", "dvl", "imu", "depth", "ping", "deploy")),
    ("recorded data", ("bag", "identify", "replay")),
    ("bench experiments", ("bollard", "towing", "free-decay", "forced", "pendulum", "step", "estimate")),
    ("explained and proven", ("allocate", "papers", "montecarlo", "bench")),
    ("for changing the code", ("test", "reference")),
)
"""What belongs together in the overview; a command that is in no group comes last."""


class Command(Protocol):
    """What a module under `commands` offers."""

    NAME: str
    HELP: str
    EXAMPLE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the options."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Do the work and return the exit code."""


class Parser(argparse.ArgumentParser):
    """What is wrong is said in one sentence, with the word that was perhaps meant; the whole usage is in the help."""

    def error(self, message: str) -> NoReturn:
        """Say it and end with 2."""
        stray = re.fullmatch(r"unrecognized arguments: (.*)", message)
        if stray:
            word = stray[1].split()[0]
            message = f"no option {word!r}{meant(word, self._option_string_actions)}"
        self.exit(UsageError.exit_code, f"{self.prog}: {message}; ./{self.prog} --help shows how\n")


def meant(word: str, known: Iterable[str]) -> str:
    """Question after the known word that is nearest to an unknown one; empty when none is near."""
    near = difflib.get_close_matches(word.replace("_", "-"), list(known), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def module_names() -> list[str]:
    """Names of all command modules, in the order in which help lists them."""
    return sorted(module.name for module in pkgutil.iter_modules(commands.__path__) if not module.name.startswith("_"))


def load(module_name: str) -> ModuleType:
    """Import one command module; only the command that is wanted pays for its imports."""
    return importlib.import_module(f"{commands.__name__}.{module_name}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    try:
        code = _main(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except KeyboardInterrupt:  # a command stops by itself; this is for what it imports
        print("hindrax: stopped by Ctrl-C", file=sys.stderr)
        return 1
    except BrokenPipeError:  # who reads has seen enough; what is left must not be flushed into the same pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def _main(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print_overview()
        return 0 if words else 2
    known = {name.replace("_", "-"): name for name in module_names()}
    if words[0] not in known:
        print(f"hindrax: no command {words[0]!r}{meant(words[0], known)}; ./hindrax --help lists all", file=sys.stderr)
        return UsageError.exit_code
    return run_command(load(known[words[0]]), words[1:])


def parser_of(command: ModuleType) -> argparse.ArgumentParser:
    """Make the parser of one command, with its help and its example."""
    parser = Parser(
        prog=f"hindrax {command.NAME}",
        description=command.HELP,
        epilog=f"example:\n  {command.EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_arguments(parser)
    return parser


def run_command(command: ModuleType, words: list[str]) -> int:
    """Parse the words of one command and run it; HindraxError becomes one sentence and its exit code."""
    parser = parser_of(command)
    if getattr(command, "PASSES_ON", False) and words[:1] not in (["-h"], ["--help"]):
        words = ["--", *words]  # argparse would look at the first one
    try:
        return int(command.run(parser.parse_args(words)))
    except HindraxError as error:
        print(f"hindrax {command.NAME}: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"hindrax {command.NAME}: stopped by Ctrl-C", file=sys.stderr)
        return 1


def print_overview() -> None:
    """Print every command with its one line of help."""
    print("usage: ./hindrax COMMAND [OPTIONS]      (./hindrax COMMAND --help shows an example)")
    for title, names in grouped():
        print(f"\n{title}")
        for name in names:
            print(f"  {name:12} {declared(name.replace('-', '_'))['HELP']}")
    print("\n./hindrax setup sets the machine up early, or repairs it; every other command does so when it must")


def grouped() -> list[tuple[str, list[str]]]:
    """Names of the commands that there are, group by group."""
    left = [name.replace("_", "-") for name in module_names()]
    found = [(title, [name for name in names if name in left]) for title, names in GROUPS]
    placed = {name for _, names in found for name in names}
    found.append(("more", [name for name in left if name not in placed]))
    return [(title, names) for title, names in found if names]


def declared(module_name: str) -> dict[str, str]:
    """Texts that a command module declares, read without importing it: help must not wait for numpy."""
    found = importlib.util.find_spec(f"{commands.__name__}.{module_name}")
    assert found is not None
    assert found.origin is not None
    tree = ast.parse(Path(found.origin).read_text(encoding="utf-8"))
    texts = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id.isupper():
            with contextlib.suppress(ValueError):
                texts[node.targets[0].id] = str(ast.literal_eval(node.value))
    return texts


if __name__ == "__main__":
    sys.exit(main())
