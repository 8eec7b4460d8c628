"""Page of the commands, from their own parsers."""

import argparse
from collections.abc import Iterator

from hindrax_cli import command_line
from hindrax_cli.command import GROUPS, MODULES
from hindrax_tools.reference.markdown import code, head, table

ABOUT = """`./hindrax COMMAND` from the root of the clone sets the machine up when needed and runs the tool; inside
the environment the same tool is `hindrax`. Exit codes: 0 done; 1 the work failed, the reason is one sentence on
stderr; 2 invalid arguments; 130 Ctrl-C, also for commands that run until Ctrl-C. `--json` prints one JSON document
on stdout and nothing else there; progress and logs go to stderr. Help, `--version` and completion answer before
anything is set up.

`./hindrax setup` only sets the machine up (`setup --check` lists what is missing); the other commands:"""


def page() -> str:
    """Return the page."""
    parsers = [command_line.parser_of(command_line.load(name)) for name in sorted(MODULES)]
    rows = [
        row
        for title, group in GROUPS.items()
        for row in [(f"**{title}**", ""), *map(_row, " ".join(group.values()).split())]
    ]
    return head("Commands", ABOUT) + "\n" + table(("command", "does"), rows) + "".join(map(_command, parsers))


def _row(name: str) -> tuple[str, str]:
    return f"[{name}](#{name})", command_line.declared(name)


def _name(parser: argparse.ArgumentParser) -> str:
    return parser.prog.removeprefix("hindrax ")


def _command(parser: argparse.ArgumentParser, level: str = "##") -> str:
    about, _, more = (parser.description or "").partition("\n")
    text = f"\n{level} {_name(parser)}\n\n{about}\n" + (f"\n```\n{more.strip()}\n```\n" if more.strip() else "")
    words = "".join(_command(one, "###") for one in words_of(parser))
    examples = (parser.epilog or "").removeprefix("example:").strip().splitlines()
    listed = "\n".join(["```sh", *(line.strip() for line in examples), "```"])
    return f"{text}\n{listed}\n\n{_options(parser)}{words}"


def words_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Parsers of the subcommands of a command."""
    for action in parser._actions:  # noqa: SLF001  # argparse has no public way to read a parser
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001  # as above
            yield from action.choices.values()


def _options(parser: argparse.ArgumentParser) -> str:
    rows = [
        (code(_form(action)), (action.help or "").replace("%%", "%"))
        for action in parser._actions  # noqa: SLF001  # argparse has no public way to read a parser
        if not isinstance(action, argparse._HelpAction | argparse._SubParsersAction)  # noqa: SLF001  # as above
        and action.help != argparse.SUPPRESS
    ]
    return table(("option", "meaning"), rows) if rows else ""


def _form(action: argparse.Action) -> str:
    """How an option is written."""
    word = action.metavar or ("|".join(map(str, action.choices)) if action.choices else (action.dest or "").upper())
    if isinstance(word, tuple):
        value = " ".join(word)
    elif action.nargs in ("+", "*", argparse.REMAINDER):
        value = f"{word} ..."
    else:
        value = "" if action.nargs == 0 else word
    return " ".join([*action.option_strings[-1:], value]).strip()
