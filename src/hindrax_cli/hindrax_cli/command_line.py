"""The command line tool `hindrax`: finds the command, runs it, and turns an error into one line."""

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
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from hindrax_bag import software_version
from hindrax_cli import commands
from hindrax_core.errors import INTERRUPTED, HindraxError, UsageError
from hindrax_core.text.screen_text import fitted, fitted_description, print_fitted, print_whole, screen_width

GROUPS = {
    "pool": ("the main job", ("pool-test", "report", "export")),
    "operate": (
        "run and drive the vehicle",
        (
            *("up", "status", "monitor", "web", "arm", "disarm", "stop", "hold", "recentre", "wrench", "joystick"),
            *("lights", "thruster"),
        ),
    ),
    "machine": (
        "the machine and its devices",
        ("doctor", "health", "vehicle", "mock", "dvl", "imu", "depth", "ping", "oscillator", "esc", "deploy"),
    ),
    "data": ("recorded data", ("bag", "identify", "predict", "replay")),
    "experiment": (
        "bench experiments",
        ("bollard", "towing", "free-decay", "forced", "pendulum", "step", "estimate"),
    ),
    "explain": ("explained and proven", ("allocate", "papers", "montecarlo", "faults", "bench")),
    "develop": ("for the shell and the code", ("completion", "test", "reference")),
}
"""Folder under `commands` -> title in the overview, and the order of its commands there; a new one comes last."""
LONGEST_WORD = 24
"""Of what there is to choose from, in the usage of a command."""
WHOLE = ("int", "seed")
"""Argument types that are whole numbers."""


def long_choices(action: argparse.Action) -> str:
    """What there is to choose from where it would make a long word; empty where it does not."""
    if action.metavar is not None or action.choices is None:
        return ""
    found = ", ".join(map(str, action.choices))
    return found if len(found) > LONGEST_WORD else ""


class HelpText(argparse.RawDescriptionHelpFormatter):
    """Fits descriptions to the screen."""

    def _metavar_formatter(self, action: argparse.Action, default_metavar: str) -> Callable[[int], tuple[str, ...]]:
        """A long list of choices has no place in a line of the usage: it goes with the meaning."""
        if not long_choices(action):
            return super()._metavar_formatter(action, default_metavar)
        return lambda count: (default_metavar,) * count

    def _expand_help(self, action: argparse.Action) -> str:
        found = long_choices(action)
        return f"{super()._expand_help(action)}; one of {found}" if found else super()._expand_help(action)

    def _fill_text(self, text: str, width: int, _indent: str) -> str:
        return fitted_description(text.splitlines(), width)


class Parser(argparse.ArgumentParser):
    """Invalid arguments give a one-line error with the nearest known word; the usage is in the help."""

    def error(self, message: str) -> NoReturn:
        """Print the error and exit with 2."""
        stray = re.fullmatch(r"unrecognized arguments: (.*)", message)
        if stray:
            word = stray[1].split()[0]
            message = f"no option {word!r}{meant(word, self._option_string_actions)}"
        unread = re.fullmatch(r"argument (.*): invalid (\w+) value: (.*)", message)
        if unread:
            wanted = "a whole number" if unread[2] in WHOLE else "a number"
            message = f"argument {unread[1]}: found {unread[3]}, wanted {wanted}"
        print_fitted(f"{self.prog}: {message}; ./{self.prog} --help shows how", sys.stderr)
        self.exit(UsageError.exit_code)


def meant(word: str, known: Iterable[str]) -> str:
    """Question after the known word that is nearest to an unknown one; empty when none is near."""
    near = difflib.get_close_matches(word.replace("_", "-"), list(known), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def modules() -> dict[str, str]:
    """Name of each command module (`pool_test`) -> its dotted path, sorted by name."""
    found = {
        module.name: f"{commands.__name__}.{folder}.{module.name}"
        for root in commands.__path__
        for folder in GROUPS
        for module in pkgutil.iter_modules([str(Path(root) / folder)])
    }
    return dict(sorted(found.items()))


def module_names() -> list[str]:
    """Names of all command modules, sorted."""
    return list(modules())


def load(module_name: str) -> ModuleType:
    """Import one command module; only the command that is wanted pays for its imports."""
    return importlib.import_module(modules()[module_name])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    try:
        code = _main(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except KeyboardInterrupt:  # a command stops by itself; this is for what it imports
        print_fitted("hindrax: stopped by Ctrl-C", sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe; do not flush the rest into it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def _main(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print_overview()
        return 0 if words else 2
    if words[0] == "--version":
        print_fitted(software_version())
        return 0
    known = {name.replace("_", "-"): name for name in module_names()}
    if words[0] not in known:
        print_fitted(
            f"hindrax: no command {words[0]!r}{meant(words[0], known)}; ./hindrax --help lists all", sys.stderr
        )
        return UsageError.exit_code
    return run_command(load(known[words[0]]), words[1:])


def parser_of(command: ModuleType) -> argparse.ArgumentParser:
    """Make the parser of one command, with its help and its example."""
    parser = Parser(
        prog=f"hindrax {command.NAME}",
        description=command.HELP,
        epilog=f"example:\n  {command.EXAMPLE}",
        formatter_class=HelpText,
    )
    command.add_arguments(parser)
    return parser


def run_command(command: ModuleType, words: list[str]) -> int:
    """Parse the arguments of one command and run it; a HindraxError becomes one line and its exit code."""
    parser = parser_of(command)
    if getattr(command, "PASSES_ON", False) and words[:1] not in (["-h"], ["--help"]):
        words = ["--", *words]  # argparse would look at the first one
    try:
        return int(command.run(parser.parse_args(words)))
    except HindraxError as error:
        why = str(error).removeprefix(f"{command.NAME}: ")
        print_fitted(f"hindrax {command.NAME}: {why}", sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print_fitted(f"hindrax {command.NAME}: stopped by Ctrl-C", sys.stderr)
        return INTERRUPTED


def print_overview() -> None:
    """Print every command with its one line of help."""
    print_fitted("usage: ./hindrax COMMAND [OPTIONS]   (./hindrax COMMAND --help shows an example)")
    width = screen_width(sys.stdout)
    for title, names in grouped():
        print_fitted(f"\n{title}")
        for name in names:
            print_whole(fitted(f"  {name:12} {declared(name.replace('-', '_'))['HELP']}", width, hang=15))
    print_fitted("\nWhich software this is: ./hindrax --version")
    print_fitted("To set the machine up early, or to repair it: ./hindrax setup; other commands do so when they must")


def grouped() -> list[tuple[str, list[str]]]:
    """Names of the commands that there are, group by group."""
    folders = {name.replace("_", "-"): path.split(".")[-2] for name, path in modules().items()}
    return [
        (title, sorted((name for name in folders if folders[name] == folder), key=(*first, *folders).index))
        for folder, (title, first) in GROUPS.items()
    ]


def declared(module_name: str) -> dict[str, str]:
    """Texts that a command module declares, read without importing it: help must not wait for numpy."""
    found = importlib.util.find_spec(modules()[module_name])
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
