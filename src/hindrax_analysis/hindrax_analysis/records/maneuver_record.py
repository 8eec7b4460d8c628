"""What the maneuver of a bag came to: what was flown, and by what it was aborted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hindrax_bag.read.bag_reader import messages
from hindrax_core.signals import BLOCKED
from hindrax_core.topics import MANEUVER, resolved

FLOWN = ("transient", "plateau", "coast", "excite")
"""Phases that excite a motion; the others only lead there."""
JOINED_S = 1.0
"""Longest time between two messages of one flight; the pilot publishes at 10 Hz."""


@dataclass(frozen=True, slots=True)
class ManeuverRecord:
    """End of the last maneuver, `guard: sentence`, empty when it was not aborted.

    Of each motion the time of its excitation, and that of thrust without motion, as against a wall [s].
    """

    aborted: str = ""
    flown_s: Mapping[str, float] = field(default_factory=dict)
    blocked_s: Mapping[str, float] = field(default_factory=dict)


def maneuver_record(bag: Path) -> ManeuverRecord:
    """Read the maneuvers of a bag of ours; empty where it holds none."""
    return record_of(one.decoded() for one in messages(bag, {resolved(MANEUVER)}))


def record_of(statuses: Iterable[Any]) -> ManeuverRecord:
    """Fold ManeuverStatus messages, in their order."""
    aborted, before_s = "", 0.0
    before: tuple[dict[str, float], str] | None = None
    flown_s: dict[str, float] = {}
    blocked_s: dict[str, float] = {}
    for told in statuses:
        at_s = told.header.stamp.sec + 1e-9 * told.header.stamp.nanosec
        if before and 0.0 < at_s - before_s < JOINED_S:
            times_s, motion = before
            times_s[motion] = times_s.get(motion, 0.0) + at_s - before_s
        counts = blocked_s if told.phase == BLOCKED else flown_s if told.phase in FLOWN else None
        before, before_s = (None if counts is None else (counts, str(told.motion))), at_s
        aborted = str(told.aborted)
    return ManeuverRecord(aborted, flown_s, blocked_s)
