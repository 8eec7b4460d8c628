"""What the maneuver of a bag came to: what was flown, and by what it was aborted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hindrax_bag.read.bag_reader import messages
from hindrax_core.topics import MANEUVER, resolved

FLOWN = ("transient", "plateau", "excite")
"""Phases that excite a motion; the others only lead there."""
JOINED_S = 1.0
"""Longest time between two messages of one flight; the pilot publishes at 10 Hz."""


@dataclass(frozen=True, slots=True)
class ManeuverRecord:
    """End of the last maneuver, `guard: sentence`, empty when it was not aborted; excitation of each motion [s]."""

    aborted: str = ""
    flown_s: Mapping[str, float] = field(default_factory=dict)


def maneuver_record(bag: Path) -> ManeuverRecord:
    """Read the maneuvers of a bag of ours; empty where it holds none."""
    return record_of(one.decoded() for one in messages(bag, {resolved(MANEUVER)}))


def record_of(statuses: Iterable[Any]) -> ManeuverRecord:
    """Fold ManeuverStatus messages, in their order."""
    aborted, before, before_s = "", "", 0.0
    flown_s: dict[str, float] = {}
    for told in statuses:
        at_s = told.header.stamp.sec + 1e-9 * told.header.stamp.nanosec
        if before and 0.0 < at_s - before_s < JOINED_S:
            flown_s[before] = flown_s.get(before, 0.0) + at_s - before_s
        before, before_s = (str(told.motion) if told.phase in FLOWN else ""), at_s
        aborted = str(told.aborted)
    return ManeuverRecord(aborted, flown_s)
