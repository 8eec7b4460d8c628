"""ROS parameter files, read without ROS as ROS reads them: for the tool, and for the dead man who does without ROS."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from hindrax_core.errors import UsageError
from hindrax_core.text.yaml_text import read_yaml

FRAME_PREFIX = "frame_prefix"
"""Parameter of every node that names frames."""


def parameter_blocks(file: str) -> Iterator[tuple[str, dict[str, object] | None]]:
    """Read a ROS parameter file, block by block; of two blocks the later wins.

    Parameters
    ----------
    file
        Its name.

    Yields
    ------
    tuple[str, dict[str, object] | None]
        Pattern of the nodes, and their parameters: those in nested blocks have names with dots. None for what is no
        block of parameters.

    Raises
    ------
    UsageError
        When it cannot be read.
    """
    try:
        found = read_yaml(Path(file).read_text(encoding="utf-8"), f"parameter file {file}")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"parameter file {file}: cannot be read ({' '.join(str(error).split())})") from error
    for pattern, block in found.items() if isinstance(found, dict) else [("", found)]:
        values = block.get("ros__parameters") if isinstance(block, dict) else None
        yield str(pattern), dict(_flat(values)) if isinstance(values, dict) else None


def names_node(pattern: str, node: str) -> bool:
    """Whether the name of a block means a node; `**` stands for any path, `*` for any word."""
    words = re.escape("/" + pattern.lstrip("/")).replace(r"\*\*", ".*").replace(r"\*", "[^/]*")
    return re.fullmatch(words.replace("/.*/", "/(?:.*/)?"), node) is not None


def _flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
