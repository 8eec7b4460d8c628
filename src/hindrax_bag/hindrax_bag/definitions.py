"""Message definitions as rosbag2 embeds them: the text of a type, then each type it depends on, once.

The schema that is embedded in a bag shows which version of our interfaces wrote it. Messages of earlier ones are
migrated, so that old bags stay readable. When a message changes: add a step here, and a bag of the new version to
`test/replay/schemas` (see `test/replay/make_schema_bags.py`); a test opens each of them.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

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
        found = _FIELD.match(line.partition("#")[0])
        if found is not None and found[1] not in BUILTIN:
            owner, _, name = found[1].rpartition("/")
            yield (owner.removesuffix("/msg") or package, name)


def field_kinds(text: str) -> dict[str, str]:
    """Type by name of the fields of a definition, for arrays that of their elements; without constants."""
    own = text.partition(SEPARATOR[:40])[0]
    found = (_FIELD.match(line.partition("#")[0]) for line in own.splitlines())
    return {one[2]: one[1] for one in found if one is not None and not one[3]}


@dataclass(frozen=True, slots=True)
class SchemaChange:
    """Change of one message type in one version of the interfaces."""

    version: int
    type: str
    added: Mapping[str, Any] = field(default_factory=dict)
    """New fields, with the value that says that it is not known."""
    turned: Mapping[str, tuple[str, Callable[[Any], Any]]] = field(default_factory=dict)
    """Fields of another kind since: the kind they had before, and how they become today's."""

    def apply(self, message: Any) -> None:
        """Migrate a decoded message to the newer form."""
        for name, value in self.added.items():
            setattr(message, name, value)
        for name, (_, turn) in self.turned.items():
            setattr(message, name, turn(getattr(message, name)))

    def wanted(self, fields: Mapping[str, str]) -> bool:
        """Whether a message with these fields (name to type) has the older form."""
        lacking = any(name not in fields for name in self.added)
        return lacking or any(fields.get(name) == kind for name, (kind, _) in self.turned.items())


def _floats(values: Any) -> list[float]:
    return [float(value) for value in values]


_SIGMAS_AND_RATES = (
    *(f"{motion}_velocity_sigma" for motion in ("surge", "sway", "heave")),
    *(f"{turn}_rate" for turn in ("roll", "pitch", "yaw")),
)
_FRACTIONS = {"pulses": ("uint16", _floats)}
STEPS: tuple[SchemaChange, ...] = (
    SchemaChange(2, "hindrax_msgs/msg/NavigationStatus", added=dict.fromkeys(_SIGMAS_AND_RATES, math.nan)),
    SchemaChange(3, "hindrax_msgs/msg/AllocationStatus", turned=_FRACTIONS),
    SchemaChange(3, "hindrax_msgs/msg/ThrusterState", turned=_FRACTIONS),
    SchemaChange(3, "hindrax_msgs/msg/ThrusterCommand", turned=_FRACTIONS | {"lights": ("uint16", _floats)}),
    SchemaChange(4, "hindrax_msgs/msg/ThrusterState", added={"armings": 0}),
)
"""In the order of their versions."""
VERSION = max(step.version for step in STEPS)
"""Of the interfaces of today."""


def steps_of(type_name: str, text: str) -> tuple[SchemaChange, ...]:
    """Steps from an embedded definition to the current one, in their order; none for foreign types."""
    steps = [step for step in STEPS if step.type == type_name]
    if not steps:
        return ()
    kinds = field_kinds(text)
    return tuple(step for step in steps if step.wanted(kinds))
