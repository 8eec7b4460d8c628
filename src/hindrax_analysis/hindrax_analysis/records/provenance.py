"""Provenance of a record: its date, whether it is of the mock vehicle, and what is true of that."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from mcap.records import Message, Metadata

from hindrax_bag.metadata import DESCRIPTION
from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.read.mcap_records import records
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of

FIRST_YEAR = 2000
"""The mock's clock starts in 1970: before this year, the date is that of the file."""


def date_of(bag: Path) -> str:
    """Time of the first message of a bag, ISO 8601 in UTC; that of its file with the mock's clock."""
    for message in messages(bag):
        recorded = datetime.fromtimestamp(message.received // 1_000_000_000, UTC)
        if recorded.year < FIRST_YEAR:
            recorded = datetime.fromtimestamp(bag_files(bag)[0].stat().st_mtime, UTC)
        return recorded.strftime("%Y-%m-%dT%H:%M:%SZ")
    return ""


def _told(bag: Path) -> Mapping[str, str]:
    """What the recorder says of a bag of this stack; empty for third-party bags."""
    for file in bag_files(bag):
        if file.suffix == ".db3":
            return {}
        for record in _until_first_message(file):
            if isinstance(record, Metadata) and record.name == DESCRIPTION:
                return dict(record.metadata)
    return {}


def _until_first_message(file: Path) -> Iterator[object]:
    for record in records(file):
        if isinstance(record, Message):
            return
        yield record


def is_mock(bag: Path) -> bool:
    """Whether a bag of this stack was recorded on the mock vehicle."""
    return "in mock" in _told(bag).get("notes", "")


def truth_in(bag: Path, vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """True coefficients of the hull that the mock flew, by motion; without any in the bag, of the vehicle file."""
    found: dict[str, dict[str, float]] = json.loads(_told(bag).get("truth") or "{}")
    return found or truth_of(vehicle)
