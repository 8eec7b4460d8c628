"""The pages of the documentation as a test reads them: commands, links, paths, blocks."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
TUTORIAL = ROOT / "docs" / "tutorial.md"


@dataclass(frozen=True, slots=True)
class Command:
    """One line of a shell block, and the heading that it stands under."""

    page: Path
    heading: str
    line: str

    @property
    def words(self) -> list[str]:
        """What follows `./hindrax`; remarks and what comes after another command are left out."""
        first = re.split(r"\|\||&&|  +\(", self.line)[0]
        return shlex.split(first, comments=True)[1:]


def commands_of(page: Path) -> list[Command]:
    found: list[Command] = []
    heading, fence = "", ""
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("#") and not fence:
            heading = line.lstrip("# ")
        if line.strip().startswith("```"):
            fence = "" if fence else line.strip()
        elif fence == "```sh" or line.startswith("    ./hindrax"):
            words = line.strip().removeprefix("$ ").removeprefix("sudo ")
            found += [Command(page, heading, words)] if words.startswith("./hindrax ") else []
    return found


def links_of(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", text) + re.findall(r'src="([^"]+)"', text)


def paths_of(page: Path) -> list[str]:
    """Paths in the clone that a page names."""
    return re.findall(r"`((?:src|test|docs|docker|firmware|setup)/[\w./-]+)`", page.read_text(encoding="utf-8"))


def block_of(page: Path, name: str) -> str:
    """The fenced block that follows the name of a file."""
    found = re.search(rf"`{re.escape(name)}`\n\n```\w+\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert found, f"{page}: no block after {name}"
    return found[1]
