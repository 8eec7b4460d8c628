"""Provenance of a record: its date, and whether it is of the mock vehicle."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from mcap.records import Message, Metadata

from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.read.mcap_records import records

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


def notes_of(bag: Path) -> str:
    """Notes of the recorder in a bag of this stack; empty for third-party bags."""
    for file in bag_files(bag):
        if file.suffix == ".db3":
            return ""
        for record in _until_first_message(file):
            if isinstance(record, Metadata) and record.name == "hindrax":
                return str(record.metadata.get("notes", ""))
    return ""


def _until_first_message(file: Path) -> Iterator[object]:
    for record in records(file):
        if isinstance(record, Message):
            return
        yield record


def is_mock(bag: Path) -> bool:
    """Whether a bag of this stack was recorded on the mock vehicle."""
    return "in mock" in notes_of(bag)
