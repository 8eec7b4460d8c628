"""The reference in `docs/reference`, generated from the code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from hindrax_tools.reference import commands, devices, messages, nodes, parameters, topics, vehicle, worlds

PAGES: Mapping[str, Callable[[], str]] = {
    "commands.md": commands.page,
    "devices.md": devices.page,
    "messages.md": messages.page,
    "nodes.md": nodes.page,
    "parameters.md": parameters.page,
    "topics.md": topics.page,
    "vehicle-file.md": vehicle.page,
    "worlds.md": worlds.page,
}
COMMAND = "./hindrax reference --write"


def stale(folder: Path) -> list[str]:
    """Names of the pages in a folder that are missing or differ from the code."""
    return [name for name, page in PAGES.items() if _text(folder / name) != page()]


def write(folder: Path) -> list[str]:
    """Write the pages that are stale; returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {name: page() for name, page in PAGES.items()}
    changed = [name for name, text in made.items() if _text(folder / name) != text]
    for name in changed:
        (folder / name).write_text(made[name], encoding="utf-8")
    return changed


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8") if file.is_file() else ""
