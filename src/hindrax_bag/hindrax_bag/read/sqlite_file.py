"""Third-party bags in the older format of rosbag2: sqlite3, tables `topics` and `messages`."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path

from mcap.records import Schema

from hindrax_bag.definitions import Lookup, definition
from hindrax_core.errors import UsageError

Row = tuple[str, Schema, str, bytes, int]
"""Topic, schema, encoding of the message, data, time of receipt [ns]."""


def rows(file: Path, topics: Collection[str] | None, lookup: Lookup) -> Iterator[Row]:
    """Messages of a .db3 file in the order of their times; UsageError when it is no bag or is damaged."""
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as database:
            yield from _rows(file, database, topics, lookup)
    except sqlite3.DatabaseError as error:
        raise UsageError(f"{file}: cannot be read as a sqlite3 bag ({error}); copy it anew, or name another") from error


def _rows(file: Path, database: sqlite3.Connection, topics: Collection[str] | None, lookup: Lookup) -> Iterator[Row]:
    texts = _definitions(database)
    channels: dict[int, tuple[str, Schema, str]] = {}
    for number, name, kind, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
        if topics is None or name in topics:
            channels[number] = (name, _schema(file, number, kind, texts, lookup), encoding)
    query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
    for number, stamp, data in database.execute(query):
        if number in channels:
            yield (*channels[number], bytes(data), int(stamp))


def _definitions(database: sqlite3.Connection) -> dict[str, str]:
    """Definitions by type, if the bag contains them (rosbag2 since Iron)."""
    found = database.execute("SELECT name FROM sqlite_master WHERE type='table' AND name='message_definitions'")
    if found.fetchone() is None:
        return {}
    query = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding='ros2msg'"
    return {str(kind): str(text) for kind, text in database.execute(query) if text}


def _schema(file: Path, number: int, kind: str, texts: dict[str, str], lookup: Lookup) -> Schema:
    text = texts.get(kind)
    if text is None:
        try:
            text = definition(kind, lookup)
        except (LookupError, OSError, ImportError, ValueError) as error:
            raise UsageError(
                f"{file}: the definition of {kind} is neither in the bag nor installed; install its package"
            ) from error
    return Schema(id=number, name=kind, encoding="ros2msg", data=text.encode())
