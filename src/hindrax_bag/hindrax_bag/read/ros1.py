"""Messages of ROS 1, in a `.bag` or in an MCAP file, as those of ROS 2: the definition and the CDR bytes.

ROS 1 writes fields without alignment and its header has one field more, so the bytes are converted, by `rosbags`. It
is optional: who has no record of ROS 1 needs none of it.
"""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hindrax_core.errors import UsageError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

INSTALL = "install rosbags, or convert it where you have that: rosbags-convert --src {} --dst NEW"
ENCODING = "ros1"
"""Encoding of such messages in a channel of MCAP; that of their definition is `ros1msg`."""


class Ros1Type(NamedTuple):
    """A type of ROS 1 in the form of ROS 2: its name, its definition, and the conversion of a message to CDR."""

    name: str
    definition: str
    convert: Callable[[bytes], bytes]


class Ros1Message(NamedTuple):
    """A message of a `.bag`: topic, type, time of receipt [ns], and its bytes as CDR."""

    topic: str
    form: Ros1Type
    received: int
    data: bytes


def ros1_type(file: Path, name: str, definition: str) -> Ros1Type:
    """Type of a ROS 1 message, as ROS 2 has it.

    Parameters
    ----------
    file
        Where it was found, for the error.
    name
        Name in ROS 1, such as nav_msgs/Odometry.
    definition
        Its text.

    Returns
    -------
    Ros1Type
        Name and definition of today, and the way from the bytes of ROS 1 to CDR.

    Raises
    ------
    UsageError
        Without `rosbags`, or when the definition is none.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise UsageError(f"{file}: holds messages of ROS 1; {INSTALL.format(file.name)}") from error
    modern = name if "/msg/" in name else "/msg/".join(name.rsplit("/", 1))
    store: Typestore = get_typestore(Stores.ROS2_JAZZY)
    try:
        # A type that ROS 2 knows keeps its form of today, so that the rest of the tool sees one Odometry, not two.
        found = {one: tree for one, tree in get_types_from_msg(definition, modern).items() if one not in store.types}
        store.register(found)
        text = store.generate_msgdef(modern, ros_version=2)[0]
    except Exception as error:  # rosbags raises parser errors of many kinds for a damaged text
        raise UsageError(f"{file}: the definition of {name} cannot be read ({error})") from error
    return Ros1Type(modern, text, lambda data: bytes(store.ros1_to_cdr(data, modern)))


def ros1_bag(file: Path) -> Iterator[Ros1Message]:
    """Messages of a `.bag` file in the order of their times; UsageError when it cannot be read."""
    try:
        from rosbags.rosbag1 import Reader, ReaderError  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise UsageError(f"{file}: is a bag of ROS 1; {INSTALL.format(file.name)}") from error
    forms: dict[str, Ros1Type] = {}
    try:
        with Reader(file) as bag:
            for connection, received, data in bag.messages():
                text = connection.msgdef.data
                key = connection.msgtype + hashlib.sha256(text.encode()).hexdigest()
                if key not in forms:
                    forms[key] = ros1_type(file, connection.msgtype, text)
                form = forms[key]
                yield Ros1Message(connection.topic, form, received, form.convert(bytes(data)))
    except ReaderError as error:
        raise UsageError(
            f"{file}: cannot be read as a bag of ROS 1 ({error}); repair it where ROS 1 is: rosbag reindex {file.name}"
        ) from error
