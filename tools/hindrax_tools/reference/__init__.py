"""The reference in `docs/reference`, generated from the code."""

from collections.abc import Callable, Mapping
from pathlib import Path

from hindrax_tools.reference import commands, devices, graph, parameters

PAGES: Mapping[str, Callable[[], str]] = {
    "commands.md": commands.page,
    "devices.md": devices.page,
    "messages.md": graph.messages_page,
    "nodes.md": graph.nodes_page,
    "parameters.md": parameters.page,
    "topics.md": graph.topics_page,
    "vehicle-file.md": parameters.vehicle_page,
    "worlds.md": devices.worlds_page,
}
COMMAND = "./hindrax reference --write"


def stale(folder: Path) -> dict[str, str]:
    """Text by name of the pages in a folder that are missing or differ from the code."""
    made = {name: page() for name, page in PAGES.items()}
    there = {file.name: file.read_text(encoding="utf-8") for file in folder.glob("*.md")}
    return {name: text for name, text in made.items() if there.get(name) != text}


def write(folder: Path) -> list[str]:
    """Write the pages that are stale; returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    changed = stale(folder)
    for name, text in changed.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(changed)
