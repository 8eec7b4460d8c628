"""What `./hindrax` answers before it is set up: version, help and completion. Python 3.9 and its library suffice."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from hindrax_cli import command_line as cli
from hindrax_cli import command_page
from hindrax_core.text.screen_text import print_whole, screen_width


def main(root: Path, words: Sequence[str]) -> int:
    """Answer and return the exit code; the help of a command comes from its page, as its parser needs libraries."""
    asked = [word for word in words if word not in ("-h", "--help")]
    if not asked or len(asked) == len(words):
        return cli.main(words)
    text = command_page.help_of(command_page.page_of(root), asked, screen_width(sys.stdout))
    if text is None:
        return cli.main(words)
    print_whole(text, end="")
    return 0
