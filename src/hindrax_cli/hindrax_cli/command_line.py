"""The command line tool `hindrax`: finds the command, runs it, and turns an error into one line."""

from __future__ import annotations

import argparse
import ast
import errno
import importlib
import importlib.util
import itertools
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from hindrax_bag import software_version
from hindrax_cli.command import GROUPS, MODULES, ToolCommand, example_text, help_text
from hindrax_cli.interrupt import interruptible, sentence
from hindrax_core.errors import INTERRUPTED, HindraxError, UsageError, cause
from hindrax_core.text.nearest import did_you_mean
from hindrax_core.text.screen_text import (
    as_called,
    fitted,
    fitted_description,
    mute,
    print_fitted,
    print_stderr,
    print_whole,
    screen_width,
)

NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
MAY_BE_EMPTY = ("--remote",)
"""Options for which nothing is an answer: no folder below the one that the host names."""
LONGEST_WORD = 24
"""Of what there is to choose from, in the usage of a command."""


def long_choices(action: argparse.Action) -> str:
    """Choices that are too long for the option's column; empty where they fit."""
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

    def _split_lines(self, text: str, width: int) -> list[str]:
        """Between words only: an option stays whole."""
        return fitted(" ".join(text.split()), width, 0).split("\n")

    def _fill_text(self, text: str, width: int, _indent: str) -> str:
        return fitted_description(text.splitlines(), width)


class Parser(argparse.ArgumentParser):
    """Invalid arguments give a one-line error with the nearest known word; the usage is in the help."""

    def format_help(self) -> str:
        """With the name by which this installation is called, given last: examples are known by that of a clone."""
        return as_called(super().format_help())

    def _get_value(self, action: argparse.Action, arg_string: str) -> object:
        """NaN is no number of any argument: it passes every comparison with a limit, or none."""
        value: object = super()._get_value(action, arg_string)
        if isinstance(value, float) and math.isnan(value):
            raise argparse.ArgumentError(action, f"found {arg_string}, wanted a finite number")
        return value

    def error(self, message: str) -> NoReturn:
        """Print the error and exit with 2."""
        stray = re.fullmatch(r"unrecognized arguments: (.*)", message)
        if stray:
            word = stray[1].split()[0]
            message = f"no option {word!r}{did_you_mean(word, self._option_string_actions)}"
        unknown = re.fullmatch(r"(argument .*: invalid choice: '(.*)') \(choose from (.*)\)", message)
        if unknown:
            known = [word.strip("' ") for word in unknown[3].split(",")]
            message = f"{unknown[1]}{did_you_mean(unknown[2], known)}, choose from {', '.join(known)}"
        unread = re.fullmatch(r"argument (.*): invalid (\w+) value: (.*)", message)
        if unread:
            wanted = "a whole number" if unread[2] == "int" else "a number"
            point = " with a decimal point" if "," in unread[3] else ""
            message = f"argument {unread[1]}: found {unread[3]}, wanted {wanted}{point}"
        print_stderr(f"{self.prog}: {message}; ./{self.prog} --help shows how")
        self.exit(UsageError.exit_code)


NEEDS_ROS = "needs ROS 2 and a clone of hindrax; this installation analyzes records (docs/how-to/without-ros.md)"


def is_here(name: str) -> bool:
    """Whether a command is installed; the wheel has none that needs ROS."""
    try:
        return importlib.util.find_spec(MODULES[name]) is not None
    except ModuleNotFoundError:  # not even the folder
        return False


def load(name: str) -> ToolCommand:
    """Import one command; only the one that is wanted pays for its imports. UsageError where it is not installed."""
    if not is_here(name):
        raise UsageError(NEEDS_ROS)
    found: ToolCommand = getattr(importlib.import_module(MODULES[name]), name.replace("-", "_"))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    try:
        code = _main(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except KeyboardInterrupt:  # a command stops by itself; this is for what it imports
        print_stderr(sentence())
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe
        mute(sys.stdout)
        return 0
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        mute(sys.stdout)
        where = error.filename or "output"
        print_stderr(f"hindrax: {where}: cannot be written ({cause(error)}); make room and run again")
        return HindraxError.exit_code
    finally:
        try:
            sys.stderr.flush()
        except OSError:  # a full disk took the last sentence; the exit code tells
            mute(sys.stderr)
    return code


def _is_nowhere() -> bool:
    """Whether the folder of the shell was removed, without which no relative path means anything."""
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def _go_elsewhere(command: str) -> None:
    """Let a stop go on from where every folder can be found; UsageError for every other command."""
    if command != "stop":
        raise UsageError("the folder of this shell was removed; cd into another one")
    os.chdir("/")


def _main(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print_overview()
        return 0 if words else 2
    if words[0] == "--version":
        print_fitted(software_version())
        return 0
    if words[0] not in MODULES:
        known = did_you_mean(words[0], MODULES)
        print_stderr(f"hindrax: no command {words[0]!r}{known}; ./hindrax --help lists all")
        return UsageError.exit_code
    try:
        if _is_nowhere():
            _go_elsewhere(words[0])
        found = load(words[0])
    except UsageError as error:
        print_stderr(f"hindrax {words[0]}: {error}")
        return error.exit_code
    return run_command(found, words[1:])


def parser_of(command: ToolCommand) -> argparse.ArgumentParser:
    """Make the parser of one command, with its help and its example."""
    parser = Parser(
        prog=f"hindrax {command.name}",
        description=help_text(command.run.__doc__),
        epilog=example_text(command),
        formatter_class=HelpText,
    )
    for declare in command.arguments:
        declare(parser)
    return parser


def run_command(command: ToolCommand, words: list[str]) -> int:
    """Parse the arguments of a command and run it; HindraxError and UsageError become one line and an exit code."""
    parser = parser_of(command)
    if command.passes_on and words[:1] not in (["-h"], ["--help"]):
        words = ["--", *words]  # argparse would look at the first one
    try:
        with interruptible():
            arguments = parser.parse_args(words)
            pairs = itertools.pairwise(words)
            empty = [name for name, value in pairs if name[:1] == "-" and not value and name not in MAY_BE_EMPTY]
            if empty and not command.passes_on:
                raise UsageError(f"{empty[0]}: found nothing, wanted a value; is a variable of the shell unset?")
            arguments.typed = [command.name, *words]
            return command.run(arguments)
    except HindraxError as error:
        why = str(error).removeprefix(f"{command.name}: ")
        print_stderr(f"hindrax {command.name}: {why}")
        return error.exit_code
    except KeyboardInterrupt:
        print_stderr(sentence(f"hindrax {command.name}"))
        return INTERRUPTED


def print_overview() -> None:
    """Print every command with its one line of help."""
    print_fitted("usage: ./hindrax COMMAND [OPTIONS]   (./hindrax COMMAND --help shows an example)")
    width = screen_width(sys.stdout)
    for title, group in GROUPS.items():
        names = [name for name in " ".join(group.values()).split() if is_here(name)]
        if names:
            print_fitted(f"\n{title}")
        for name in names:
            print_whole(fitted(f"  {name:12} {declared(name)}", width, hang=15))
    print_fitted("\nVersion: ./hindrax --version")
    lacking = [name for name in MODULES if not is_here(name)]
    if lacking:
        print_fitted(f"With ROS 2 and a clone of hindrax also: {', '.join(lacking)}")
        return
    print_fitted("To set the machine up early, or to repair it: ./hindrax setup; other commands do so when needed")


def declared(name: str) -> str:
    """Help of a command, read without importing it: the overview must not wait for numpy."""
    found = importlib.util.find_spec(MODULES[name])
    assert found is not None
    assert found.origin is not None
    tree = ast.parse(Path(found.origin).read_text(encoding="utf-8"))
    return next(
        help_text(ast.get_docstring(node))
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name == name.replace("-", "_")
    )
