"""Read bags as messages: complete or not, one file or a folder, decoded by their embedded schema.

Nothing here needs a ROS installation or our generated messages, so bags of other vehicles and of older versions of this
stack open too: MCAP, the older sqlite3 format of rosbag2, either of them compressed, and bags of ROS 1 (`ros1`).
"""

import sqlite3
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap_ros2.decoder import DecoderFactory

from hindrax_bag.definitions import steps_of
from hindrax_bag.metadata import COMPRESSED, DESCRIPTION, NAME, missing_parts, part_number
from hindrax_bag.read.compression import unpacked, unpacked_file
from hindrax_bag.read.mcap_records import BROKEN, Damage, records
from hindrax_bag.read.ros1 import ENCODING, ros1_bag, ros1_type
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.messages.contents import Contents, ContentT_co, Read, bytes_reader, of_message
from hindrax_core.messages.definition import parsed
from hindrax_core.topics import NAMESPACE, in_default_namespace
from hindrax_core.vehicle import Vehicle, vehicle_from_text

KINDS = (".mcap", ".db3", ".bag")
PATTERNS = tuple(f"*{kind}{packed}" for packed in ("", *COMPRESSED) for kind in KINDS)
RUN_BAG = "bag"
"""Place of the bag in the folder of a run."""
VEHICLE_FILE = "vehicle.yaml"
"""Its name in the folder of a run, and inside a bag."""
EVERY = 10_000
"""Messages between two reports of how far the reading of a bag is."""
Decode = Callable[[bytes], Any]
Unpack = Callable[[bytes], bytes]
_STAMP = struct.Struct("<iI")
CDR_HEAD, LITTLE_ENDIAN = 4, b"\x00\x01"


class DamagedMessageError(HindraxError):
    """The bytes of one message are not of its type: others of its topic may be."""


class MessageDecoder:
    """Decoder of the bytes of a channel, made on first use: many callers need only bytes."""

    def __init__(self, channel: Channel, schema: Schema | None) -> None:
        self.channel, self.schema = channel, schema
        self.type = schema.name if schema else ""
        self.definition = schema.data.decode("utf-8", "replace") if schema else ""
        self._steps = steps_of(self.type, self.definition)
        self.old = bool(self._steps)
        """The type has changed since: `decode` brings messages to today's form, their bytes are not those of today."""
        self.decode: Decode = self._first_decode

    def reader(self, contents: Contents[ContentT_co]) -> Read[ContentT_co]:
        """Make the reader of what the messages hold: in place, unless they have to be migrated."""
        if self.old:
            return lambda data: of_message(self.decode(data), contents)
        return bytes_reader(parsed(self.type, self.definition), contents)

    def _first_decode(self, data: bytes) -> object:
        """Decode by the schema of the bag and migrate the message to the current form."""
        encoding = self.channel.message_encoding
        try:
            made: Decode | None = DecoderFactory().decoder_for(encoding, self.schema)
        except Exception as error:  # the parser of mcap_ros2 raises plain ones
            why = f"the definition of {self.type}, of {self.channel.topic}, cannot be read ({type(error).__name__})"

            def refuse(_data: bytes) -> NoReturn:
                raise DamagedMessageError(why)

            self.decode = refuse
            raise DamagedMessageError(why) from error
        if made is None:
            raise UsageError(f"topic {self.channel.topic}: encoding {encoding!r} cannot be decoded, wanted cdr")

        def decode(data: bytes) -> object:
            try:
                message = made(data)
            except BROKEN as error:
                raise DamagedMessageError(_damaged_message(self.channel.topic, error)) from error
            for step in self._steps:
                step.apply(message)
            return message

        self.decode = decode
        return decode(data)


class BagMessage(NamedTuple):
    """One recorded message: CDR bytes, time of receipt and of sending [ns], and their decoder.

    A tuple, because it is made for every message of every bag, and a frozen dataclass takes four times as long.
    """

    topic: str
    type: str
    data: bytes
    received: int
    sent: int
    form: MessageDecoder

    @property
    def is_old(self) -> bool:
        """Whether the type has changed since: its bytes are not those of today."""
        return self.form.old

    def decoded(self) -> Any:
        """The message as an object with the fields of its type; DamagedMessageError where its bytes are none of it."""
        return self.form.decode(self.data)


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag by its name: a folder, or a file of one of the kinds, compressed or not."""
    return path.is_dir() or any(path.match(pattern) for pattern in PATTERNS)


def bag_files(path: str | Path) -> list[Path]:
    """Files of a bag, in order.

    Parameters
    ----------
    path
        A file; a folder with files; or the folder of a run, which stands for the bag in it.

    Returns
    -------
    list[Path]
        At least one.

    Raises
    ------
    UsageError
        When there is none.
    """
    place = Path(path)
    if place.is_file():
        return [place]
    for folder in (place, place / RUN_BAG):
        for pattern in PATTERNS:
            files = sorted(folder.glob(pattern), key=part_number)
            if files:
                return files
    raise UsageError(f"{place}: {_found(place)}, wanted a bag: a folder with .mcap, .db3 or .bag files, or such a file")


def _found(place: Path) -> str:
    if not place.is_dir():
        return "does not exist"
    names = sorted(file.name for file in place.iterdir())
    return f"found a folder with {names[0]}{' and others' * (len(names) > 1)}" if names else "found an empty folder"


def messages(
    path: str | Path, topics: Collection[str] | None = None, *, damage: Damage | None = None
) -> Iterator[BagMessage]:
    """Messages of a bag in the order in which they were written.

    An unfinished file is read up to its last whole record, and damaged chunks are left out.

    Parameters
    ----------
    path
        As `bag_files` takes it.
    topics
        Names of those wanted, by default all. Topics of a vehicle of ours are named as in the default namespace,
        whichever it had.
    damage
        Receives a report of what was left out.

    Yields
    ------
    BagMessage
        Topic, stamps, definition and bytes.

    Raises
    ------
    UsageError
        When a file is no bag at all; at the first message, not at the call.
    """
    noted = Damage() if damage is None else damage
    files = bag_files(path)
    if not Path(path).is_file():
        noted.notes += [f"{one}: is missing, by {NAME}; copy it beside the others" for one in missing_parts(files)]
    for file in files:
        with unpacked_file(file) as place:
            if place.suffix == ".db3":
                yield from _sqlite_messages(file, place, topics, noted)
            elif place.suffix == ".bag":
                yield from _ros1_messages(place, topics)
            else:
                yield from _mcap_messages(place, topics, noted)


def _mcap_messages(file: Path, topics: Collection[str] | None, damage: Damage) -> Iterator[BagMessage]:
    schemas: dict[int, Schema] = {}
    namespace = NAMESPACE
    channels: dict[int, tuple[str, MessageDecoder, Unpack] | None] = {}
    for record in records(file, damage):
        if isinstance(record, Message):
            channel = channels.get(record.channel_id)
            if channel is not None:
                topic, form, unpack = channel
                try:
                    data = unpack(record.data)
                except BROKEN as error:
                    damage.skip(f"{file.name}: {_damaged_message(topic, error)}", record.log_time, record.log_time)
                    continue
                yield BagMessage(topic, form.type, data, record.log_time, record.publish_time, form)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Metadata):
            namespace = record.metadata.get("namespace", NAMESPACE) if record.name == DESCRIPTION else namespace
        elif isinstance(record, Channel):
            topic = in_default_namespace(record.topic, namespace)
            wanted = topics is None or topic in topics
            channels[record.id] = (topic, *_form(file, record, schemas.get(record.schema_id))) if wanted else None


def _form(file: Path, channel: Channel, schema: Schema | None) -> tuple[MessageDecoder, Unpack]:
    """Decoder of a channel, and what makes CDR of its bytes."""
    if channel.message_encoding != ENCODING or schema is None:
        return MessageDecoder(channel, schema), unpacked
    old = ros1_type(file, schema.name, schema.data.decode("utf-8", "replace"))
    return _modern_form(channel.id, channel.topic, "cdr", old.name, old.definition), old.convert


def _modern_form(number: int, topic: str, encoding: str, kind: str, definition: str) -> MessageDecoder:
    """Decoder of a topic that no channel of MCAP declares."""
    schema = Schema(id=number, name=kind, encoding="ros2msg", data=definition.encode())
    return MessageDecoder(Channel(number, topic, encoding, {}, number), schema)


def _damaged_message(topic: str, error: Exception) -> str:
    return f"a message of {topic} is damaged ({type(error).__name__}) and left out"


def _ros1_messages(file: Path, topics: Collection[str] | None) -> Iterator[BagMessage]:
    """Messages of a bag of ROS 1, as CDR."""
    forms: dict[tuple[str, str], MessageDecoder] = {}
    for message in ros1_bag(file):
        if topics is None or message.topic in topics:
            key = message.topic, message.form.definition
            if key not in forms:
                forms[key] = _modern_form(len(forms), message.topic, "cdr", message.form.name, message.form.definition)
            yield BagMessage(
                message.topic, message.form.name, message.data, message.received, message.received, forms[key]
            )


def _sqlite_messages(file: Path, place: Path, topics: Collection[str] | None, damage: Damage) -> Iterator[BagMessage]:
    """Messages of a .db3 file, unpacked at `place`: tables `topics` and `messages`, in the order of their times."""
    forms: dict[int, tuple[str, MessageDecoder]] = {}
    try:
        with closing(sqlite3.connect(f"{place.resolve().as_uri()}?mode=ro", uri=True)) as database:
            texts = _definitions(database)
            query = "SELECT id, name, type, serialization_format FROM topics"
            for number, topic, kind, encoding in database.execute(query):
                if topics is None or topic in topics:
                    text = texts[kind] if kind in texts else _standard_definition(file, kind)
                    forms[number] = (topic, _modern_form(number, topic, encoding, kind, text))
            query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
            for number, stamp, packed in database.execute(query):
                if number in forms:
                    topic, form = forms[number]
                    try:
                        data = unpacked(bytes(packed))
                    except BROKEN as error:
                        damage.skip(f"{file.name}: {_damaged_message(topic, error)}", int(stamp), int(stamp))
                        continue
                    yield BagMessage(topic, form.type, data, int(stamp), int(stamp), form)
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # the latter in a text of a damaged page
        raise UsageError(
            f"{file}: cannot be read as a sqlite3 bag ({error}); copy it again, or name another"
        ) from error


def _definitions(database: sqlite3.Connection) -> dict[str, str]:
    """Definitions by type, if the bag contains them (rosbag2 since Iron)."""
    found = database.execute("SELECT name FROM sqlite_master WHERE type='table' AND name='message_definitions'")
    if found.fetchone() is None:
        return {}
    query = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding='ros2msg'"
    return {str(kind): str(text) for kind, text in database.execute(query) if text}


def _standard_definition(file: Path, kind: str) -> str:
    """Definition of a type of the standard packages, for bags of before Iron, which hold none; else UsageError."""
    why = f"{file}: the definition of {kind} is not in the bag"
    try:
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415  # only such bags want it
    except ImportError as error:
        raise UsageError(f"{why}; install the standard definitions: pip install rosbags") from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    if kind not in store.types:
        remedy = "convert the bag to MCAP where its package is installed: ros2 bag convert"
        raise UsageError(f"{why}, and it is no standard type; {remedy}")
    return store.generate_msgdef(kind, ros_version=2)[0]


def attachments(path: str | Path) -> dict[str, bytes]:
    """Files inside a bag by name, the first of each name; unfinished bags and sqlite3 bags (which have none) too."""
    found: dict[str, bytes] = {}
    for record in beside_messages(path):
        if isinstance(record, Attachment):
            found.setdefault(record.name, record.data)
    return found


def beside_messages(path: str | Path) -> Iterator[object]:
    """Records of a bag that are not in its chunks: attachments, metadata. None of other kinds of bag."""
    for file in bag_files(path):
        if ".mcap" in file.suffixes or file.suffix not in (*KINDS, *COMPRESSED):
            with unpacked_file(file) as place:
                yield from records(place, chunks=False)


def attached_vehicle(bag: str | Path, inside: Mapping[str, bytes]) -> Vehicle:
    """Vehicle by the file among the attachments of a bag.

    Parameters
    ----------
    bag
        Its name, for the error.
    inside
        Attachments by name.

    Returns
    -------
    Vehicle
        As `load_vehicle` gives it.

    Raises
    ------
    UsageError
        When there is no vehicle file among them, or it is not valid.
    """
    text = inside.get(VEHICLE_FILE)
    if text is None:
        raise UsageError(f"{bag}: has no vehicle file inside; name one with --vehicle")
    return vehicle_from_text(text.decode("utf-8", "replace"), f"{VEHICLE_FILE} inside {bag}")


def stamp_of(data: bytes) -> int:
    """Time in the header of a little-endian CDR message whose first field is a std_msgs/Header [ns]."""
    seconds, nanoseconds = _STAMP.unpack_from(data, CDR_HEAD)
    return int(seconds) * NS_PER_S + int(nanoseconds)


def valid_stamp(data: bytes) -> int | None:
    """As `stamp_of`, for untrusted bytes; None if they hold no time since 1970."""
    if len(data) < CDR_HEAD + _STAMP.size or data[:2] != LITTLE_ENDIAN:
        return None
    seconds, nanoseconds = _STAMP.unpack_from(data, CDR_HEAD)
    return stamp_of(data) if seconds >= 0 and nanoseconds < NS_PER_S else None
