"""Identification events from a bag of this stack, by the feed of the live identifier."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from hindrax_bag.read.bag_reader import messages
from hindrax_core.events import Stamped
from hindrax_core.signals import IdentEvent
from hindrax_core.topics import resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.nodes.measurement_messages import LISTENERS
from hindrax_ident.records.feed import Feed
from hindrax_ident.tuning import Tuning

LATEST_S = 30.0
"""Largest delay of a message against its neighbors in a bag. At nine times real time, a process that pauses briefly is
seconds late; its thruster commands must not be dropped."""


def bag_events(bag: str | Path, vehicle: Vehicle, tuning: Tuning | None = None) -> Iterator[Stamped[IdentEvent]]:
    """Events of a bag, in the order of their stamps."""
    by_topic = {resolved(topic): listen for topic, listen in LISTENERS.items()}
    measurements = (by_topic[one.topic](one.decoded()) for one in messages(bag, by_topic))
    return Feed(vehicle, replace(tuning or Tuning(), reorder_s=LATEST_S)).all(measurements)
