"""Sentences on a screen: they break between words there, and stay whole in a pipe or a file.

Needs nothing but the standard library of Python 3.9: help uses it before hindrax is set up.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TextIO

UNBOUNDED = 100_000
COMMAND = re.compile(r"\./hindrax |^\s*ros2 ")
"""A line of a description with it is to be copied."""
ENTRY = re.compile(r" +\S+ {2,}(?=\S)")
"""Begin of an entry of a list: its name, and the column of its meaning."""
COPIED = re.compile(r"\s*(\./hindrax |export \w+=)")
"""Begin of a line to be copied."""
INSTALLED = Path(__file__).parents[2]
"""Folder of this package: of the wheel it is that of all its packages, among which none needs ROS."""
FROM_WHEEL = (INSTALLED / "hindrax_cli").is_dir() and not (INSTALLED / "hindrax_ros").is_dir()
NARROWEST = 20
"""Narrower than this is no width of a screen."""
_OBEYED = {code: "\ufffd" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\n\t"}
_wrapped = partial(wrap, break_long_words=False, break_on_hyphens=False, replace_whitespace=False)


def screen_width(stream: TextIO) -> int:
    """Characters a line of the screen that a stream goes to; UNBOUNDED where it goes to none."""
    try:
        width = os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError, AttributeError):
        return UNBOUNDED
    chosen = os.environ.get("COLUMNS", "")
    width = int(chosen) if chosen.isdecimal() else width
    return width if width >= NARROWEST else UNBOUNDED


def fitted(text: str, width: int, hang: int | None = None) -> str:
    """Break the lines that are too long between words.

    A word that is longer than the screen, such as a path, stays in one piece, and so does a line to be copied.

    Parameters
    ----------
    text
        Lines.
    width
        Of the screen [characters].
    hang
        Indent of what follows a break [characters]; None: 2 more than its line has.

    Returns
    -------
    str
        The same words, on more lines.
    """
    return "\n".join(_broken(line, width, hang) for line in text.split("\n"))


def fitted_description(lines: Iterable[str], width: int) -> str:
    """The same for a description: its paragraphs flow, entries of a list hang, and commands stay in one piece."""
    return "\n".join(_fitted_prose(line, width) for line in (lines if width >= UNBOUNDED else _paragraphs(lines)))


def _paragraphs(lines: Iterable[str]) -> Iterator[str]:
    """Join what continues a line: prose at the margin below prose at the margin that does not announce a list."""
    paragraph = ""
    for line in lines:
        if paragraph and _flows(line):
            paragraph += f" {line}"
        else:
            if paragraph:
                yield paragraph
            paragraph = line if _flows(line) else ""
            if not paragraph:
                yield line
        if paragraph.endswith(":"):
            yield paragraph
            paragraph = ""
    if paragraph:
        yield paragraph


def _flows(line: str) -> bool:
    return line[:1].strip() != "" and not COMMAND.search(line)


def _fitted_prose(line: str, width: int) -> str:
    if COMMAND.search(line):
        return line
    entry = ENTRY.match(line)
    hang = entry.end() if entry and entry.end() <= width // 2 else None
    return fitted(line, width, hang if line.startswith(" ") else 0)


def _broken(line: str, width: int, hang: int | None) -> str:
    if len(line) <= width or COPIED.match(line):
        return line
    begin = line[: -len(line.lstrip())]
    rest = " " * (len(begin) + 2 if hang is None else hang)
    return "\n".join(_wrapped(line.lstrip(), width, initial_indent=begin, subsequent_indent=rest))


def printable(text: str) -> str:
    """A text without what a screen obeys but breaks and tabs: names in it may come from another machine or a bag."""
    return text.translate(_OBEYED)


def as_called(text: str) -> str:
    """Text with the name by which this installation is called: `./hindrax` in a clone, `hindrax` from the wheel."""
    return text.replace("./hindrax", "hindrax") if FROM_WHEEL else text


def how_to_install(extra: str) -> str:
    """Remedy of a package that is missing: the extra of the wheel that holds it, and the set-up of a clone."""
    by_pip = f'pip install "hindrax[{extra}]"'
    return by_pip if FROM_WHEEL else f"`./hindrax setup --all` installs it, or {by_pip}"


def print_fitted(text: object, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print sentences, on a screen broken between words.

    Parameters
    ----------
    text
        What `str` makes of it.
    stream
        None: stdout.
    end
        Printed after it.
    """
    to = sys.stdout if stream is None else stream
    print_whole(fitted(printable(str(text)), screen_width(to)), to, end)


def print_stderr(sentence: object) -> None:
    """Print a sentence for the operator on stderr; stdout is for what scripts may want."""
    print_fitted(sentence, sys.stderr)


def print_whole(text: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print without wrapping: a document, a block to copy, a picture. The tool has the name of this installation.

    Output on stderr gets lost where nothing can be written, as on a full disk: it must not end a flight.

    Parameters
    ----------
    text
        As it will stand there.
    stream
        None: stdout.
    end
        Printed after it.
    """
    to = sys.stdout if stream is None else stream
    with contextlib.suppress(OSError) if to is sys.stderr else contextlib.nullcontext():
        print(as_called(text), end=end, file=to, flush=True)


def mute(stream: TextIO) -> None:
    """Have nothing written any more into what takes nothing.

    What is left in the buffer of a stream would fail once more at the end of the process: with a traceback, and 120 for
    its exit code.

    Parameters
    ----------
    stream
        Stdout or stderr.
    """
    with contextlib.suppress(OSError):  # a stream without a file has no end that fails
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
