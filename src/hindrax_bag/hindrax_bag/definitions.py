"""Message definitions as rosbag2 embeds them: the text of a type, then each type it depends on, once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

SEPARATOR = "=" * 80
BUILTIN = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
_FIELD = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+([A-Za-z]\w*)\s*(=?)")

Lookup = Callable[[str, str], str]
"""(package, name) -> text of the .msg file."""


def share_lookup(package: str, name: str) -> str:
    """Find a definition in the installed packages of the ROS environment."""
    from ament_index_python.packages import get_package_share_directory  # noqa: PLC0415  # only where ROS is

    return (Path(get_package_share_directory(package)) / "msg" / f"{name}.msg").read_text(encoding="utf-8")


@cache
def definition(type_name: str, lookup: Lookup = share_lookup) -> str:
    """Full text of a type given as `package/msg/Type`: encoding `ros2msg` of the MCAP registry."""
    package, _, name = type_name.split("/")
    parts: dict[tuple[str, str], str] = {}
    waiting = [(package, name)]
    while waiting:
        one = waiting.pop(0)
        if one not in parts:
            text = lookup(*one)
            parts[one] = f"{SEPARATOR}\nMSG: {one[0]}/{one[1]}\n{text}" if parts else text
            waiting.extend(_dependencies(one[0], text))
    return "\n".join(part.rstrip("\n") for part in parts.values()) + "\n"


def _dependencies(package: str, text: str) -> Iterator[tuple[str, str]]:
    for line in text.splitlines():
        field = _FIELD.match(line.partition("#")[0])
        if field is None or field[1] in BUILTIN:
            continue
        owner, _, name = field[1].rpartition("/")
        yield (owner.removesuffix("/msg") or package, name)


def field_kinds(text: str) -> dict[str, str]:
    """Type by name of the fields of a definition, for arrays that of their elements; without constants."""
    own = text.partition(SEPARATOR[:40])[0]
    found = (_FIELD.match(line.partition("#")[0]) for line in own.splitlines())
    return {field[2]: field[1] for field in found if field is not None and not field[3]}
