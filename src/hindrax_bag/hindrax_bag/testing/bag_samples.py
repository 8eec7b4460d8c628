"""Small bags for the tests, made without any ROS installation."""

import contextlib
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mcap.exceptions import EndOfFile
from mcap.reader import McapReader
from mcap.records import Chunk, Statistics
from mcap.stream_reader import StreamReader
from mcap.summary import Summary

from hindrax_bag.metadata import Channel
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import LATCHED, SENSOR

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos

DEFINITIONS = {
    ("demo_msgs", "Level"): "std_msgs/Header header\nfloat64 level   # [m]\n",
    ("demo_msgs", "Word"): "string text\n",
    ("std_msgs", "Header"): "builtin_interfaces/Time stamp\nstring frame_id\n",
    ("builtin_interfaces", "Time"): "int32 sec\nuint32 nanosec\n",
}
LEVEL = Channel("/demo/level", "demo_msgs/msg/Level", (SENSOR,), "RIHS01_" + "ab" * 32)
WORD = Channel("/demo/word", "demo_msgs/msg/Word", (LATCHED,))


def lookup(package: str, name: str) -> str:
    return DEFINITIONS[(package, name)]


def level(stamp: int, value: float) -> bytes:
    """CDR of demo_msgs/Level with the frame `tank`, by hand."""
    seconds, nanoseconds = divmod(stamp, NS_PER_S)
    return b"\x00\x01\x00\x00" + struct.pack("<iII5s7xd", seconds, nanoseconds, 5, b"tank\x00", value)


def word(text: str) -> bytes:
    data = text.encode() + b"\x00"
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data)) + data


def writer(folder: Path, limits: BagLimits | None = None) -> BagWriter:
    made = BagWriter(folder, lookup, limits=limits or BagLimits(keep_free_MB=0.0))
    made.open()
    return made


def small_bag(folder: Path, count: int = 300, per_flush: int = 20) -> Path:
    """Write a bag of `count` levels at 100 Hz and a word, a chunk every `per_flush` messages; returns its only file."""
    bag = writer(folder)
    bag.describe("hindrax", {"notes": "sample"})
    bag.attach("vehicle.yaml", "application/yaml", b"name: sample\n", 1)
    bag.write(WORD, word("hello"), NS_PER_S, NS_PER_S)
    for index in range(count):
        sent = NS_PER_S + index * 10_000_000
        bag.write(LEVEL, level(sent, index * 0.5), sent + 1_000_000, sent)
        if index % per_flush == per_flush - 1:
            bag.flush()
    bag.close()
    return bag.path


def chunk_ends(path: Path) -> list[int]:
    """Where the chunks of a file end, which may be cut off after them [bytes]."""
    ends: list[int] = []
    with path.open("rb") as stream, contextlib.suppress(EndOfFile):
        for record in StreamReader(stream, emit_chunks=True).records:
            ends += [stream.tell()] if isinstance(record, Chunk) else []
    return ends


def summary_of(reader: McapReader) -> tuple[Summary, Statistics]:
    """Summary at the end of a file, and the counts in it."""
    found = reader.get_summary()
    assert found is not None
    assert found.statistics is not None
    return found, found.statistics


def offered_qualities(connection: "Connection") -> "Sequence[Qos]":
    """What the publishers of a connection offered."""
    from rosbags.interfaces import ConnectionExtRosbag2  # noqa: PLC0415  # only tests have it

    assert isinstance(connection.ext, ConnectionExtRosbag2)
    return connection.ext.offered_qos_profiles
