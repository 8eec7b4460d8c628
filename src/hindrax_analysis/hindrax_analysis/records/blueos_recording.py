"""Recordings of BlueOS, which are MCAP files with MAVLink as JSON, as messages like those that pymavlink reads.

BlueOS (since 1.5) writes one for each of its own starts, with MAVLink while the vehicle is armed. Sources:
bluerobotics/blueos-recorder, `service.rs`; bluerobotics/mavlink-server, `drivers/zenoh/json.rs`, which publishes what
serde makes of the messages of rust-mavlink.

    {"header": {"system_id": 1, "component_id": 1, "sequence": 7},
     "message": {"type": "EKF_STATUS_REPORT", "flags": "EKF_ATTITUDE | EKF_VELOCITY_HORIZ", "compass_variance": 0.1}}

A set of flags is a text, {"bits": n} in older versions; a text is one, or its bytes; a number that is none is NaN or
null. Topic ROUTER has every message, and each has a topic of its kind as well; the topics of single fields are left.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from mcap.records import Channel

from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.read.mcap_records import Damage, records
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S

ENDING = ".mcap"
ROUTER = "mavlink/out"
OF_A_KIND = re.compile(r"mavlink/\d+/\d+/[A-Z0-9_]+")
FLAGS = {"EKF_VELOCITY_HORIZ": 1 << 1, "EKF_VELOCITY_VERT": 1 << 2, "EKF_CONST_POS_MODE": 1 << 7}
"""Values of the flags that are used (EKF_STATUS_FLAGS of the dialect ardupilotmega)."""

TIMES = ("time_boot_ms", "time_usec")
"""Fields without a number in which no other field has a time."""
NO_MESSAGE = (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)
"""What reading one raises that is none."""


class JsonMessage:
    """One message with the methods and attributes of pymavlink's."""

    def __init__(self, system: int, received_s: float, fields: Mapping[str, object]) -> None:
        self._system, self._timestamp, self._fields = system, received_s, fields

    def get_type(self) -> str:
        """Name of its kind."""
        return str(self._fields["type"])

    def get_srcSystem(self) -> int:  # pymavlink's own name of it
        """Number of the system that sent it."""
        return self._system

    def __getattr__(self, name: str) -> object:
        """Value of a field; AttributeError where the kind has none of the name."""
        try:
            return self._fields[name]
        except KeyError:
            raise AttributeError(name) from None


def recordings(path: Path) -> list[Path]:
    """Find recordings of BlueOS.

    Parameters
    ----------
    path
        A file or a folder of any content.

    Returns
    -------
    list[Path]
        The files that hold MAVLink, in order; none of a ROS bag.
    """
    if not path.is_dir() and path.suffix.lower() != ENDING:
        return []
    try:
        return [file for file in bag_files(path) if file.suffix.lower() == ENDING and _topics(file)]
    except UsageError:
        return []


def read_messages(file: Path, damage: Damage) -> Iterator[JsonMessage]:
    """Read the messages of a recording, unfinished ones as well.

    Parameters
    ----------
    file
        An MCAP file.
    damage
        Receives a report of what was left out.

    Yields
    ------
    JsonMessage
        In the order of their receipt.

    Raises
    ------
    UsageError
        When the file is no MCAP.
    """
    for one in messages(file, _topics(file), damage=damage):
        try:
            content = json.loads(one.data)
            fields = content["message"]
            system = int(content["header"]["system_id"])
            kind = fields["type"]
            fields |= {name: float(fields[name]) for name in TIMES if fields.get(name) is not None}
        except NO_MESSAGE as error:
            note = f"{file.name}: a message of {one.topic} is no MAVLink ({type(error).__name__}) and left out"
            damage.skip(note, one.received, one.received)
            continue
        if kind == "EKF_STATUS_REPORT":
            fields["flags"] = _flags(fields.get("flags"))
        elif kind == "PARAM_VALUE":
            fields["param_id"] = _text(fields.get("param_id"))
        yield JsonMessage(system, one.received / NS_PER_S, fields)


def _topics(file: Path) -> list[str]:
    """Topics that have each message once; none in a file without MAVLink."""
    # A finished file names its topics at its end, another one has to be read: to its first message of the router, or of
    # ROS, whose topics begin so and BlueOS' do not.
    found = {record.topic for record in records(file, chunks=False) if isinstance(record, Channel)}
    if not found:
        for one in messages(file):
            found.add(one.topic)
            if one.topic == ROUTER or one.topic.startswith("/"):
                break
    return [ROUTER] if ROUTER in found else sorted(topic for topic in found if OF_A_KIND.fullmatch(topic))


def _flags(value: object) -> int | None:
    """Number of a set of flags; None where it is not known."""
    if isinstance(value, Mapping):
        value = value.get("bits", value.get("type"))
    if isinstance(value, str):
        return sum(FLAGS.get(name.strip(), 0) for name in value.split("|"))
    return value if isinstance(value, int) else None


def _text(value: object) -> str:
    """Text of characters or their numbers, up to the first zero."""
    if isinstance(value, list):
        value = "".join(chr(one) if isinstance(one, int) else str(one) for one in value)
    return str(value).partition("\0")[0]
