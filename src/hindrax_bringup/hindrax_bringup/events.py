"""Identification events out of a bag of ours: the same feed and the same sorter as the live identifier."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hindrax_bag.reader import messages
from hindrax_core.events import Stamped
from hindrax_core.state import IdentEvent
from hindrax_core.topics import resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.feed import Feed, Measurement, Sorter
from hindrax_ident.nodes.listen import LISTENERS

LATEST_S = 30.0
"""How much later than its neighbors a message may stand in a bag. Nothing hurries, and at nine times real time a
process that stops for a moment is seconds late: what it did to the thrusters meanwhile must not be left out."""


def bag_events(bag: str | Path, vehicle: Vehicle) -> Iterator[Stamped[IdentEvent]]:
    """Events of a bag, in the order of their stamps."""
    feed = Feed(vehicle)
    for measurement in bag_measurements(bag):
        yield from feed.step(measurement)


def bag_measurements(bag: str | Path) -> Iterator[Stamped[Measurement]]:
    """Measurements of a bag, in the order of their stamps."""
    by_topic = {resolved(topic): listen for topic, listen in LISTENERS.items()}
    sorter = Sorter(LATEST_S)
    for message in messages(bag, by_topic):
        yield from sorter.push(by_topic[message.topic](message.decoded()))
    yield from sorter.rest()
