"""Message definitions as rosbag2 embeds them: the text of a type, then each type it depends on, once.

The schema that is embedded in a bag shows which version of our interfaces wrote it. Messages of earlier ones are
migrated, so that old bags stay readable. When a message changes: add a step here, and a bag of the new version to
`test/replay/schemas` (see `test/replay/make_schema_bags.py`); a test opens each of them.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache

from hindrax_core.messages.definition import SEPARATOR, fields_of

Lookup = Callable[[str, str], str]
"""(package, name) -> text of the .msg file."""


@cache
def definition(type_name: str, lookup: Lookup) -> str:
    """Full text of a type given as `package/msg/Type`: encoding `ros2msg` of the MCAP registry."""
    package, _, name = type_name.split("/")
    parts: dict[tuple[str, str], str] = {}
    waiting = [(package, name)]
    while waiting:
        one = waiting.pop(0)
        if one not in parts:
            text = lookup(*one)
            parts[one] = f"{SEPARATOR}\nMSG: {one[0]}/{one[1]}\n{text}" if parts else text
            kinds = (field.kind for field in fields_of(one[0], text))
            waiting.extend((owner, name) for owner, slash, name in (kind.partition("/") for kind in kinds) if slash)
    return "\n".join(part.rstrip("\n") for part in parts.values()) + "\n"


@dataclass(frozen=True, slots=True)
class SchemaChange:
    """Change of one message type in one version of the interfaces."""

    version: int
    type: str
    added: Mapping[str, object] = field(default_factory=dict)
    """New fields, with the value that says that it is not known."""
    turned: Mapping[str, tuple[str, Callable[[object], object]]] = field(default_factory=dict)
    """Fields of another kind since: the kind they had before, and how they become today's."""

    def apply(self, message: object) -> None:
        """Migrate a decoded message to the newer form."""
        for name, value in self.added.items():
            setattr(message, name, value)
        for name, (_, turn) in self.turned.items():
            setattr(message, name, turn(getattr(message, name)))

    def wanted(self, fields: Mapping[str, str]) -> bool:
        """Whether a message with these fields (name to type) has the older form."""
        lacking = any(name not in fields for name in self.added)
        return lacking or any(fields.get(name) == kind for name, (kind, _) in self.turned.items())


def _floats(values: object) -> list[float]:
    assert isinstance(values, Iterable)
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
    SchemaChange(5, "hindrax_msgs/msg/ManeuverStatus", added={"error_code": 0}),
)
"""In the order of their versions."""
VERSION = max(step.version for step in STEPS)
"""Of the interfaces of today."""


def steps_of(type_name: str, text: str) -> tuple[SchemaChange, ...]:
    """Steps from an embedded definition to the current one, in their order; none for foreign types."""
    steps = [step for step in STEPS if step.type == type_name]
    if not steps:
        return ()
    kinds = {field.name: field.kind for field in fields_of(type_name, text.partition(SEPARATOR)[0])}
    return tuple(step for step in steps if step.wanted(kinds))
