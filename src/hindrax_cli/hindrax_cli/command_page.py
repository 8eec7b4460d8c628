"""Help and completion from the page of the commands in docs/reference, which a test keeps equal to the parsers.

Needs nothing but the standard library of Python 3.9: it answers, and the version too, before hindrax is set up.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import starmap
from pathlib import Path

from hindrax_cli import command_line
from hindrax_core.text.screen_text import UNBOUNDED, fitted, fitted_description, print_whole, screen_width

WIDTH = 24
"""Of the column of the options, as argparse sets it."""
SHELLS = ("bash", "zsh", "fish")
SECTION = re.compile(r"^##+ ", re.MULTILINE)
FURNITURE = ("| ---", "| option", "```")
NAMED = re.compile(r"^\| `(\w+)` \|", re.MULTILINE)
"""First cell of a row of a reference page."""
SIMULATORS = ["mujoco", "gz", "stonefish"]
ROW = re.compile(r"^\| `(?P<form>[^`]+)` \| (?P<meaning>.*) \|$")

BASH = """# Completion of hindrax for bash; keep it as ~/.local/share/bash-completion/completions/hindrax
_hindrax() {
  local known="${COMP_WORDS[1]}${COMP_WORDS[2]:+ ${COMP_WORDS[2]}}" words
  if [ "$COMP_CWORD" -eq 1 ]; then
    words='@COMMANDS@'
  else
    case "${COMP_WORDS[COMP_CWORD-1]}" in
@VALUES@
    *)
    case $known in
@CASES@
    esac
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -o default -F _hindrax hindrax
"""
ZSH = """# Completion of hindrax for zsh; source it in ~/.zshrc
# A shell without completion of its own gets it here, and no file in the home.
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit -i -D; }
autoload -Uz bashcompinit && bashcompinit
"""
FISH = "# Completion of hindrax for fish; keep it as ~/.config/fish/completions/hindrax.fish"


def main(root: Path, words: Sequence[str]) -> int:
    """Answer and return the exit code; the help of a command comes from its page, as its parser needs libraries."""
    asked = [word for word in words if word not in ("-h", "--help")]
    text = help_of(page_of(root), asked, screen_width(sys.stdout)) if 0 < len(asked) < len(words) else None
    if text is None:
        return command_line.main(words)
    print_whole(text, end="")
    return 0


def page_of(root: Path) -> str:
    """Read the page."""
    return (root / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")


def sections(page: str) -> dict[str, str]:
    """Text by command, and by subcommand (`bag info`)."""
    return {name: text for name, _, text in (part.partition("\n") for part in SECTION.split(page)[1:])}


def help_of(page: str, words: list[str], width: int = UNBOUNDED) -> str | None:
    """Return the help of a command or subcommand, for a screen.

    Parameters
    ----------
    page
        Text of docs/reference/commands.md.
    words
        Command and subcommand; further ones do not count.
    width
        Columns of the screen.

    Returns
    -------
    str | None
        None when there is no such command.
    """
    found = sections(page)
    name = next((name for name in (" ".join(words[:2]), *words[:1]) if name in found), None)
    if name is None:
        return None
    below = [_entry(one, found[one], width) for one in found if one.startswith(f"{name} ")]
    lines = [line for line in found[name].strip().splitlines() if not line.startswith(FURNITURE)]
    prose = itertools.takewhile(lambda line: not ROW.match(line), lines)
    text = [fitted_description(prose, width), *(_row(row, width) for row in map(ROW.match, lines) if row)]
    more = [f"\nsubcommands, each with its own --help:\n{chr(10).join(below)}"] if below else []
    return "\n".join([f"usage: ./hindrax {name} {'SUBCOMMAND ' if below else ''}[OPTIONS]\n", *text, *more]) + "\n"


def _entry(name: str, text: str, width: int) -> str:
    """A subcommand in the list of them, with the first line of its help."""
    return fitted(f"  {name.partition(' ')[2]:<{WIDTH}}  {text.strip().partition(chr(10))[0]}", width, WIDTH + 4)


def _row(row: re.Match[str], width: int) -> str:
    form, meaning = _plain(row["form"]), _plain(row["meaning"])
    text = f"  {form:<{WIDTH}}  {meaning}" if len(form) <= WIDTH else f"  {form}\n{'':{WIDTH + 4}}{meaning}"
    return fitted(text, width, WIDTH + 4)


def _plain(text: str) -> str:
    return text.replace("\\|", "|")


def words_of(page: str) -> Mapping[str, list[str]]:
    """What may follow each command or subcommand: options, choices, subcommands."""
    found = sections(page)
    known = {}
    for name, text in found.items():
        rows = [row["form"] for row in map(ROW.match, text.splitlines()) if row]
        below = [one.partition(" ")[2] for one in found if one.startswith(f"{name} ")]
        known[name] = [*below, *(word for form in rows for word in _offered(form)), "--help"]
    return known


def _offered(form: str) -> list[str]:
    """Words of an option or an argument that are typed as they stand: itself, and what there is to choose from."""
    words = _plain(form).replace(" ...", "").split()
    return [one for word in words for one in word.split("|") if re.fullmatch(r"[-a-z][-a-z0-9_]*", one)]


def values_of(root: Path) -> Mapping[str, list[str]]:
    """What options of a clone may be given, beside the choices of their own page: vehicles, worlds, faults."""
    reference = root / "docs" / "reference"
    worlds = (reference / "worlds.md").read_text(encoding="utf-8")
    faults = sections((reference / "devices.md").read_text(encoding="utf-8"))["Faults"]
    return {
        "--vehicle": sorted(file.stem for file in (root / "src" / "hindrax_bringup" / "vehicles").glob("*.yaml")),
        "--world": ["ideal", "pool", *NAMED.findall(worlds)],
        "--fault": NAMED.findall(faults),
        "--simulator": SIMULATORS,
    }


def completion(page: str, shell: str, values: Mapping[str, Sequence[str]]) -> str:
    """Return the script by which a shell completes commands, subcommands, options and values of these.

    Parameters
    ----------
    page
        Text of docs/reference/commands.md.
    shell
        fish or zsh; else bash.
    values
        Of options, as of `values_of`; names of vehicles follow `vehicle check` and `vehicle show` too.

    Returns
    -------
    str
        To be evaluated by that shell.
    """
    known = dict(words_of(page), setup=["--check", "--vehicle", "--all", "--help"])
    for name in ("vehicle check", "vehicle show"):
        known[name] = [*values.get("--vehicle", ()), *known.get(name, ())]
    commands = [*(name for name in known if " " not in name), "help", "--help", "--version"]
    if shell == "fish":
        lines = (_fish_command(name, known) for name in known)
        named = (f"complete -c hindrax -l {name[2:]} -r -a '{' '.join(words)}'" for name, words in values.items())
        return "\n".join([FISH, _fish("__fish_use_subcommand", commands, files=False), *named, *lines, ""])
    # Patterns of subcommands come before those of commands, which match them too.
    narrow_first = sorted(known.items(), key=lambda one: " " not in one[0])
    cases = "\n".join(starmap(_case, narrow_first))
    bash = BASH.replace("@COMMANDS@", " ".join(commands)).replace("@CASES@", cases)
    bash = bash.replace("@VALUES@", "\n".join(starmap(_case, values.items())))
    return ZSH + bash.partition("\n")[2] if shell == "zsh" else bash


def _case(name: str, words: list[str]) -> str:
    pattern = f"'{name}'" if " " in name or name.startswith("-") else f"'{name}' | '{name} '*"
    return f"      {pattern}) words='{' '.join(words)}' ;;"


def _fish_command(name: str, known: Mapping[str, list[str]]) -> str:
    """A command offers only its subcommands until one is typed; otherwise files as well."""
    condition = "; and ".join(f"__fish_seen_subcommand_from {word}" for word in name.split())
    below = [one.partition(" ")[2] for one in known if one.startswith(f"{name} ")]
    alone = f"; and not __fish_seen_subcommand_from {' '.join(below)}" if below else ""
    return _fish(f"{condition}{alone}", known[name], files=not below)


def _fish(condition: str, words: list[str], *, files: bool = True) -> str:
    return f"complete -c hindrax {'' if files else '-f '}-n '{condition}' -a '{' '.join(words)}'"
