"""Bags back as messages: finished or not, one file or a folder, decoded by the schema that is embedded in them.

Nothing here needs a ROS installation or our generated messages, so bags of other vehicles and of older versions of this
stack open too: MCAP, and the older sqlite3 format of rosbag2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Attachment, Channel, Message, Schema
from mcap_ros2.decoder import DecoderFactory

from hindrax_bag import cdr, sqlite_file
from hindrax_bag.definitions import Lookup, share_lookup
from hindrax_bag.mcap_records import Damage, records
from hindrax_bag.migrations import added_by, steps_of
from hindrax_core.errors import UsageError

PATTERNS = ("*.mcap", "*.db3")
RUN_BAG = "bag"
"""Where the bag lies in the folder of a run."""
COMPRESSED = (".zstd", ".zst", ".lz4")


class Form:
    """How the bytes of a channel are read. The code is made when it is first asked for: many want only bytes."""

    def __init__(self, topic: str, encoding: str, schema: Schema | None) -> None:
        self._topic, self._encoding, self._schema = topic, encoding, schema
        self._text = schema.data.decode("utf-8", "replace") if schema else ""
        self.type = schema.name if schema else ""
        self._steps = steps_of(self.type, self._text)
        self.old = bool(self._steps)
        """The type has changed since: `decode` brings messages to today's form, their bytes are not those of today."""
        self.decode: cdr.Decode = self._first_decode
        self.same: cdr.Match = self._first_same

    def _first_decode(self, data: bytes) -> Any:
        self.decode = self._decoder()
        return self.decode(data)

    def _first_same(self, data: bytes, message: Any) -> bool:
        try:
            self.same = cdr.matcher(self.type, self._text)
        except cdr.SchemaError:
            self.same = _look_closer
        return self.same(data, message)

    def _decoder(self) -> cdr.Decode:
        """Decode by the schema of the bag and bring what comes to today's form."""
        general: cdr.Decode | None = DecoderFactory().decoder_for(self._encoding, self._schema)
        if general is None:
            raise UsageError(f"topic {self._topic}: encoding {self._encoding!r} cannot be decoded, wanted cdr")
        steps = self._steps
        try:
            fast = cdr.decoder(self.type, self._text, added_by(steps))
        except cdr.SchemaError:
            return general

        def decode(data: bytes) -> Any:
            if data[:2] != cdr.LITTLE_ENDIAN:
                return general(data)
            message = fast(data)
            for step in steps:
                step.apply(message)
            return message

        return decode


def _look_closer(_data: bytes, _message: Any) -> bool:
    return False


class BagMessage(NamedTuple):
    """One message as recorded: CDR bytes, time of receipt and of sending [ns], and how they are read.

    A tuple, because it is made for every message of every bag, and a frozen dataclass takes four times as long.
    """

    topic: str
    type: str
    data: bytes
    received: int
    sent: int
    form: Form

    def decoded(self) -> Any:
        """The message as an object with the fields of its type."""
        return self.form.decode(self.data)


def bag_files(path: str | Path) -> list[Path]:
    """Files of a bag given as a file or as a folder, in order; UsageError when there is none.

    The folder of a run stands for the bag in it.
    """
    place = Path(path)
    if place.is_file():
        return [place]
    for folder in (place, place / RUN_BAG):
        for pattern in PATTERNS:
            files = sorted(folder.glob(pattern), key=_part_number)
            if files:
                return files
    raise UsageError(f"{place}: {_found(place)}, wanted a bag: a folder with .mcap or .db3 files, or such a file")


def _found(place: Path) -> str:
    if not place.is_dir():
        return "does not exist"
    names = sorted(file.name for file in place.iterdir())
    packed = [name for name in names if name.endswith(COMPRESSED)]
    if packed:
        return f"found only {packed[0]}, which is compressed as a whole (unpack it)"
    return f"found a folder with {names[0]}{' and others' * (len(names) > 1)}" if names else "found an empty folder"


def _part_number(path: Path) -> tuple[int, str]:
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isdigit() else 0, path.name)


def messages(
    path: str | Path,
    topics: Collection[str] | None = None,
    *,
    damage: Damage | None = None,
    lookup: Lookup = share_lookup,
) -> Iterator[BagMessage]:
    """Messages of a bag in the order in which they were written, of these topics or of all.

    An unfinished file is read up to its last whole record, and damaged chunks are left out; `damage` is told. `lookup`
    finds definitions of types for sqlite3 bags that do not bring them. UsageError when a file is no bag at all.
    """
    for file in bag_files(path):
        if file.suffix == ".db3":
            yield from _sqlite_messages(file, topics, lookup)
        else:
            yield from _mcap_messages(file, topics, damage)


def _mcap_messages(file: Path, topics: Collection[str] | None, damage: Damage | None) -> Iterator[BagMessage]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[str, Form] | None] = {}
    for record in records(file, damage):
        if isinstance(record, Message):
            channel = channels.get(record.channel_id)
            if channel is not None:
                topic, form = channel
                yield BagMessage(topic, form.type, record.data, record.log_time, record.publish_time, form)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            topic = record.topic
            wanted = topics is None or topic in topics
            form = Form(topic, record.message_encoding, schemas.get(record.schema_id))
            channels[record.id] = (topic, form) if wanted else None


def _sqlite_messages(file: Path, topics: Collection[str] | None, lookup: Lookup) -> Iterator[BagMessage]:
    forms: dict[str, Form] = {}
    for topic, schema, encoding, data, stamp in sqlite_file.rows(file, topics, lookup):
        if topic not in forms:
            forms[topic] = Form(topic, encoding, schema)
        yield BagMessage(topic, schema.name, data, stamp, stamp, forms[topic])


def attachments(path: str | Path) -> dict[str, bytes]:
    """Files inside a bag by name, the first of each name; unfinished bags and sqlite3 bags (which have none) too."""
    found: dict[str, bytes] = {}
    for file in bag_files(path):
        if file.suffix != ".db3":
            for record in records(file, chunks=False):
                if isinstance(record, Attachment):
                    found.setdefault(record.name, record.data)
    return found
