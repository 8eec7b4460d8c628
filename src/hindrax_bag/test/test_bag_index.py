"""Files of a bag: their order, whether they are whole, what their channels are."""

from pathlib import Path

import pytest
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from mcap.writer import IndexType, Writer

from hindrax_bag.metadata import Contents, channel_of, contents_of, is_whole, parts
from hindrax_bag.read.bag_reader import bag_files
from hindrax_core.topics import IMU, Quality, resolved

MAGIC = b"\x89MCAP0\r\n"


@pytest.mark.parametrize(("data", "whole"), [(b"", False), (MAGIC[:5], False), (MAGIC, True), (b"x" + MAGIC, True)])
def test_a_whole_file_ends_with_the_magic_bytes(tmp_path: Path, data: bytes, whole: bool) -> None:
    (tmp_path / "bag_0.mcap").write_bytes(data)
    assert is_whole(tmp_path / "bag_0.mcap") is whole


def test_files_are_in_the_order_of_their_numbers_and_one_without_comes_first(tmp_path: Path) -> None:
    names = ["old.mcap", "bag_1.mcap", "bag_2.mcap", "bag_10.mcap"]
    for name in reversed(names):
        (tmp_path / name).write_bytes(b"")
    assert parts(tmp_path) == bag_files(tmp_path) == [tmp_path / name for name in names]


def test_a_channel_that_shows_nothing_has_no_type_and_the_quality_of_our_table() -> None:
    record = ChannelRecord(id=1, topic="/somebody/else", message_encoding="cdr", metadata={}, schema_id=0)
    found = channel_of(record, None)
    assert (found.type, found.offered, found.type_hash) == ("", (Quality(),), "")
    ours = ChannelRecord(id=2, topic=resolved(IMU), message_encoding="cdr", metadata={}, schema_id=1)
    found = channel_of(ours, Schema(id=1, name="sensor_msgs/msg/Imu", encoding="ros2msg", data=b""))
    assert (found.type, found.offered) == ("sensor_msgs/msg/Imu", (IMU.quality,))


@pytest.mark.parametrize("summary", [True, False])
def test_a_whole_file_that_counts_nothing_holds_nothing(summary: bool, tmp_path: Path) -> None:
    file = tmp_path / "bag_0.mcap"
    with file.open("wb") as stream:
        writer = Writer(
            stream,
            index_types=IndexType.NONE,
            repeat_channels=summary,
            repeat_schemas=summary,
            use_chunking=False,
            use_statistics=False,
            use_summary_offsets=False,
        )
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        writer.add_message(writer.register_channel("/a", "cdr", schema), 1, b"", 1)
        writer.finish()  # type: ignore[no-untyped-call]
    assert is_whole(file)
    assert contents_of(file) == Contents("bag_0.mcap")
