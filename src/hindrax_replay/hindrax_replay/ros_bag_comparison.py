"""Two bags of the same run: one recorded, and one that the same processes made over its wires."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from pathlib import Path
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport, Rule, flat
from hindrax_bag.read.bag_reader import messages
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import ALLOCATION, ESTIMATE, NAVIGATION, RAW_FRAMES, TOPICS, resolved
from hindrax_replay.wire_stage import COMPARED

SAME_NS = NS_PER_S // 2
"""Largest distance of two messages of a device with the same values."""
NEAR_NS = NS_PER_S // 40
"""Largest distance of two computed messages that are compared: half a tick, and its rounding."""
SETTLING_NS = 3 * NS_PER_S
"""At the start nodes discover their devices and each other at different times."""
ALLOCATION_NAME = resolved(ALLOCATION)
COMPUTED = {resolved(topic) for topic in (NAVIGATION, ALLOCATION, ESTIMATE)}
_NAMES = RAW_FRAMES.keys()
DEVICES = {resolved(topic) for topic in TOPICS if topic.name.partition("/")[0] in _NAMES} & COMPARED
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
Row = tuple[int, dict[str, Any]]
"""Stamp [ns] and values by name; the stamp is also among them, as `stamp_s`."""


def compare_bags(recorded: Path, replayed: Path, ledger: ComparisonReport) -> None:
    """Compare the messages of devices, navigator, allocator and identifier in the span that both bags cover."""
    there, here = _rows(recorded), _rows(replayed)
    for topic in sorted(there):
        rule = ledger.rules.of(topic)
        if topic not in here:
            ledger.unmatched(topic, there[topic][0][0], "recorded, not replayed", "messages", "none at all")
        elif (topic in DEVICES and not rule.sampled) or topic == ALLOCATION_NAME:
            _by_values(topic, rule, there[topic], here[topic], ledger)
        else:
            _by_time(topic, there[topic], here[topic], ledger)


def _rows(bag: Path) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = defaultdict(list)
    for message in messages(bag, COMPUTED | DEVICES):
        values = dict(flat(message.decoded()))
        seconds, nanoseconds = (values.pop(name) for name in STAMP)
        stamp = seconds * NS_PER_S + nanoseconds
        values["stamp_s"] = stamp / NS_PER_S
        found[message.topic].append((stamp, values))
    return found


def _within(rows: list[Row], first: int, last: int) -> list[Row]:
    return [row for row in rows if first <= row[0] <= last]


def _by_values(topic: str, rule: Rule, there: list[Row], here: list[Row], ledger: ComparisonReport) -> None:
    """Pair messages whose exact fields are equal: the same bytes came through, a little sooner or later."""
    exact = [name for name in there[0][1] if rule.is_sharp(name)]
    waiting: dict[tuple[Any, ...], list[Row]] = defaultdict(list)
    for row in here:
        waiting[_key(row, exact)].append(row)
    for stamp, values in _within(there, here[0][0] + SETTLING_NS, here[-1][0] - SAME_NS):
        same = waiting[_key((stamp, values), exact)]
        nearest = min(same, key=lambda row: abs(row[0] - stamp), default=None)
        if nearest is not None and abs(nearest[0] - stamp) <= SAME_NS:
            same.remove(nearest)
            ledger.compare_values(topic, stamp, values, nearest[1])
        else:
            ledger.unmatched(topic, stamp, "recorded, not replayed", _values_text(values, exact), "none")


def _key(row: Row, names: list[str]) -> tuple[Any, ...]:
    return tuple(repr(row[1].get(name)) for name in names)


def _values_text(values: dict[str, Any], names: list[str]) -> str:
    shown = [f"{name}={values[name]}" for name in names if isinstance(values[name], float)]
    return ", ".join(shown[:3]) or "a message"


def _by_time(topic: str, there: list[Row], here: list[Row], ledger: ComparisonReport) -> None:
    """Compare messages that are nearest in time."""
    stamps = [stamp for stamp, _ in here]
    for stamp, values in _within(there, stamps[0] + SETTLING_NS, stamps[-1] - SAME_NS):
        at = bisect_left(stamps, stamp)
        near = min(here[max(0, at - 1) : at + 1], key=lambda row: abs(row[0] - stamp))
        if abs(near[0] - stamp) <= NEAR_NS:
            ledger.compare_values(topic, stamp, values, near[1])
        else:
            ledger.unmatched(topic, stamp, "recorded, not replayed", "a message", "none")
