"""Migrate messages of earlier versions of our interfaces to the current one, so that old bags stay readable.

The schema that is embedded in a bag tells which version wrote it. When a message changes: add a step here, and a bag
of the new version to `test/replay/schemas` (see `test/replay/make_schema_bags.py`); a test opens each of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hindrax_bag.definitions import field_kinds

Turn = Callable[[Any], Any]


@dataclass(frozen=True, slots=True)
class Step:
    """Change of one message type in one version of the interfaces."""

    version: int
    type: str
    added: Mapping[str, Any] = field(default_factory=dict)
    """New fields, with the value that says that it is not known."""
    turned: Mapping[str, tuple[str, Turn]] = field(default_factory=dict)
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
STEPS: tuple[Step, ...] = (
    Step(2, "hindrax_msgs/msg/NavigationStatus", added=dict.fromkeys(_SIGMAS_AND_RATES, math.nan)),
    Step(3, "hindrax_msgs/msg/AllocationStatus", turned=_FRACTIONS),
    Step(3, "hindrax_msgs/msg/ThrusterState", turned=_FRACTIONS),
    Step(3, "hindrax_msgs/msg/ThrusterCommand", turned=_FRACTIONS | {"lights": ("uint16", _floats)}),
    Step(4, "hindrax_msgs/msg/ThrusterState", added={"armings": 0}),
)
"""In the order of their versions."""
VERSION = max(step.version for step in STEPS)
"""Of the interfaces of today."""


def steps_of(type_name: str, text: str) -> tuple[Step, ...]:
    """Steps from an embedded definition to the current one, in their order; none for foreign types."""
    steps = [step for step in STEPS if step.type == type_name]
    if not steps:
        return ()
    kinds = field_kinds(text)
    return tuple(step for step in steps if step.wanted(kinds))
