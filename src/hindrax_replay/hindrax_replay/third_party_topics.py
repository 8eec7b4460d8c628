"""Bags that this stack has not recorded, for a replay: which of their topics stand for which of ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from hindrax_analysis.records.third_party_bag import topics_of
from hindrax_bag.read.bag_reader import messages
from hindrax_core.errors import UsageError
from hindrax_core.topics import ALTITUDE, DVL_DETAIL, IMU, MAGNETIC, ODOMETRY, PRESSURE, TOPICS, resolved

BY_TYPE = {topic.type: resolved(topic) for topic in (IMU, MAGNETIC, PRESSURE, ALTITUDE, DVL_DETAIL, ODOMETRY)}
"""Our inputs and outputs of the navigator by type, for third-party topics."""
TYPES = {resolved(topic): topic.type for topic in TOPICS}


def names_of(bag: Path, remaps: Sequence[str]) -> dict[str, str]:
    """Our topic by the bag's topic: from `THEIRS:=OURS`, else by type in a bag that holds none of our topics.

    UsageError for a remap that does not fit, for a type that several topics have, and when nothing is left to replay.
    """
    if not remaps and any(message.topic in TYPES for message in messages(bag)):
        return {}
    topics = topics_of(bag)
    if remaps:
        return dict(_remap(word, topics, bag) for word in remaps)
    found: dict[str, str] = {}
    for theirs, kind in topics.items():
        ours = BY_TYPE.get(kind)
        if ours is None:
            continue
        if ours in found.values():
            raise UsageError(f"{bag}: several topics are of type {kind}; name the one with --remap THEIRS:={ours}")
        found[theirs] = ours
    if resolved(IMU) not in found.values():
        raise UsageError(
            f"{bag}: found no topic of type {IMU.type}, which the navigator rests on; it holds {_list(topics)}"
        )
    return found


def _remap(word: str, topics: Mapping[str, str], bag: Path) -> tuple[str, str]:
    theirs, arrow, ours = word.partition(":=")
    if not arrow or ours not in TYPES:
        raise UsageError(f"--remap {word}: wanted THEIRS:=OURS, ours being a topic such as {resolved(PRESSURE)}")
    if topics.get(theirs) != TYPES[ours]:
        found = topics.get(theirs, "no such topic")
        raise UsageError(f"--remap {word}: found {found}, wanted {TYPES[ours]}; {bag} holds {_list(topics)}")
    return theirs, ours


def _list(topics: Mapping[str, str]) -> str:
    return ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items())) or "nothing"
