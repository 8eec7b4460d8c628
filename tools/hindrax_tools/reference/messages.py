"""Page of our own messages, services and actions, from their definitions."""

from __future__ import annotations

from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_tools.reference.markdown import code, head, table

ABOUT = """Interfaces of `hindrax_msgs`. Where a standard message serves, it is used instead (see
[topics](topics.md)). Every field says its unit; `-` has none."""
FOLDERS = {"msg": ("",), "srv": ("request", "response"), "action": ("goal", "result", "feedback")}


def page() -> str:
    """Return the page."""
    root = clone_root() / "src" / "hindrax_msgs"
    files = [file for folder in FOLDERS for file in sorted((root / folder).iterdir())]
    return head("Messages, services, actions", ABOUT) + "".join(map(_interface, files))


def _interface(file: Path) -> str:
    about, parts = _read(file)
    tables = [
        (f"\n{title}:\n" if title else "") + "\n" + table(("type", "field", "unit", "meaning"), part)
        for title, part in zip(FOLDERS[file.parent.name], parts, strict=True)
    ]
    return f"\n## hindrax_msgs/{file.parent.name}/{file.stem}\n\n{about}\n" + "".join(tables)


def _read(file: Path) -> tuple[str, list[list[tuple[str, ...]]]]:
    """Comment at the top of a definition, and the fields of each of its parts."""
    about: list[str] = []
    parts: list[list[tuple[str, ...]]] = [[]]
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            about.append(line.removeprefix("#").strip())
        elif line.startswith("---"):
            parts.append([])
        elif line.strip():
            parts[-1].append(_field(line))
    return " ".join(about), parts


def _field(line: str) -> tuple[str, ...]:
    """Type, name, unit and meaning of one line; constants have no unit."""
    declaration, _, comment = line.partition("#")
    kind, _, name = declaration.strip().partition(" ")
    meaning, unit = comment.strip(), ""
    if meaning.endswith("]"):
        meaning, _, unit = meaning[:-1].rpartition("[")
    return code(kind), code(name.strip()), unit, meaning.strip()
