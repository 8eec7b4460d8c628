"""Bags that rosbag2 compressed, and bags of ROS 1: read like others, and copied into bags that others can read."""

import builtins
import re
import sqlite3
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from hindrax_bag.read import compression
from hindrax_bag.read.bag_reader import DamagedMessageError, attachments, messages
from hindrax_bag.read.mcap_records import Damage
from hindrax_bag.read.message_columns import extract, series
from hindrax_bag.read.recovery import recover
from hindrax_bag.read.survey import find_bags, survey
from hindrax_bag.testing.bag_samples import small_bag
from hindrax_core.errors import HindraxError, UsageError

WRENCH = "geometry_msgs/msg/WrenchStamped"
COUNT = 40
MODES = {"message": CompressionMode.MESSAGE, "storage": CompressionMode.STORAGE, "file": CompressionMode.FILE}
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)


def wrench(store: Any, index: int) -> Any:
    """A wrench of `index` newtons forward, sent after `index` tenths of a second."""
    kinds = store.types
    stamp = kinds["builtin_interfaces/msg/Time"](sec=index // 10, nanosec=index % 10 * 100_000_000)
    sequence = {"seq": index} if store is ROS1 else {}
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link", **sequence)
    vector = kinds["geometry_msgs/msg/Vector3"]
    content = kinds["geometry_msgs/msg/Wrench"](force=vector(float(index), 0.0, -1.0), torque=vector(0.0, 0.5, 0.0))
    return kinds[WRENCH](header=header, wrench=content)


def rosbag2(folder: Path, storage: StoragePlugin, mode: str) -> Path:
    """Let rosbags, which is not ours, write a bag."""
    made = Ros2Writer(folder, version=9, storage_plugin=storage)
    made.set_compression(MODES[mode], CompressionFormat.ZSTD)
    with made as bag:
        topic = bag.add_connection("/wrench", WRENCH, typestore=ROS2)
        for index in range(COUNT):
            bag.write(topic, (index + 1) * 100_000_000, ROS2.serialize_cdr(wrench(ROS2, index), WRENCH))
    return folder


def ros1_bag(file: Path) -> Path:
    with Ros1Writer(file) as bag:
        topic = bag.add_connection("/wrench", WRENCH, typestore=ROS1)
        for index in range(COUNT):
            bag.write(topic, (index + 1) * 100_000_000, ROS1.serialize_ros1(wrench(ROS1, index), WRENCH))
    return file


def ros1_mcap(file: Path) -> Path:
    """As the converter of MCAP writes a bag of ROS 1: its messages and their definition as they were."""
    with file.open("wb") as stream:
        made = Writer(stream)
        made.start("ros1")
        text = ROS1.generate_msgdef(WRENCH)[0].encode()
        schema = made.register_schema("geometry_msgs/WrenchStamped", "ros1msg", text)
        channel = made.register_channel("/wrench", "ros1", schema)
        for index in range(COUNT):
            data = bytes(ROS1.serialize_ros1(wrench(ROS1, index), WRENCH))
            made.add_message(channel, (index + 1) * 100_000_000, data, (index + 1) * 100_000_000)
        made.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    return file


def require_wrenches(bag: Path) -> None:
    """The wrenches of `wrench`, by our reader."""
    found = list(messages(bag))
    assert [one.received for one in found] == [(index + 1) * 100_000_000 for index in range(COUNT)]
    assert {one.type for one in found} == {WRENCH}
    for index, one in enumerate(found):
        content = one.decoded()
        assert content.header.stamp.sec * 10 + content.header.stamp.nanosec // 100_000_000 == index
        assert content.header.frame_id == "base_link"
        assert (content.wrench.force.x, content.wrench.force.z, content.wrench.torque.y) == (index, -1.0, 0.5)


def require_wrenches_for_others(bag: Path) -> None:
    """The same by rosbags."""
    with AnyReader([bag]) as reader:
        found: list[Any] = [reader.deserialize(data, one.msgtype) for one, _, data in reader.messages()]
        forces = [one.wrench.force.x for one in found]
    assert np.array_equal(forces, np.arange(COUNT))


@pytest.mark.parametrize("storage", list(StoragePlugin), ids=lambda one: one.name.lower())
@pytest.mark.parametrize("mode", ["message", "file"])
def test_compressed_bags_are_read_and_copied_for_others(tmp_path: Path, storage: StoragePlugin, mode: str) -> None:
    bag = rosbag2(tmp_path / "bag", storage, mode)
    require_wrenches(bag)
    made = recover(bag, tmp_path / "copy")
    assert (made.messages, made.notes, made.unreadable) == (COUNT, (), ())
    require_wrenches(made.output)
    require_wrenches_for_others(made.output)
    assert survey(bag).topics["/wrench"].count == COUNT


@pytest.mark.parametrize("mode", ["message", "file"])
def test_a_compressed_file_is_read_without_the_metadata_beside_it(tmp_path: Path, mode: str) -> None:
    (file,) = (one for one in rosbag2(tmp_path / "bag", StoragePlugin.MCAP, mode).iterdir() if one.suffix != ".yaml")
    require_wrenches(file.rename(tmp_path / file.name))


def test_bags_that_are_compressed_as_files_are_listed(tmp_path: Path) -> None:
    rosbag2(tmp_path / "bag", StoragePlugin.MCAP, "file")
    (found,) = find_bags(tmp_path)
    assert (found.messages, found.finished, found.note) == (COUNT, True, "")


@pytest.mark.parametrize("make", [ros1_bag, ros1_mcap], ids=["bag", "mcap"])
def test_records_of_ros_1_are_read_and_copied_for_others(tmp_path: Path, make: Any) -> None:
    file = make(tmp_path / ("old.bag" if make is ros1_bag else "old.mcap"))
    require_wrenches(file)
    made = recover(file, tmp_path / "copy")
    require_wrenches(made.output)
    require_wrenches_for_others(made.output)


@pytest.mark.parametrize("make", [ros1_bag, ros1_mcap], ids=["bag", "mcap"])
def test_without_rosbags_a_record_of_ros_1_names_what_to_install(
    tmp_path: Path, make: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = make(tmp_path / ("old.bag" if make is ros1_bag else "old.mcap"))
    real = builtins.__import__

    def blocked(name: str, *rest: Any) -> Any:
        if name.startswith("rosbags"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", blocked)
    with pytest.raises(UsageError, match=r"ROS 1; install rosbags, or .*: rosbags-convert --src old\.(bag|mcap)"):
        list(messages(file))


def test_lz4_messages_are_read_too(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "message")
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        for number, data in database.execute("SELECT id, data FROM messages").fetchall():
            packed = lz4.frame.compress(compression.unpacked(data))
            database.execute("UPDATE messages SET data = ? WHERE id = ?", (packed, number))
    require_wrenches(bag)


def test_a_damaged_message_costs_itself_and_is_named(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "message")
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE messages SET data = substr(data, 1, 20) WHERE id = 7")
    damage = Damage()
    assert len(list(messages(bag, damage=damage))) == COUNT - 1
    assert damage.notes == [f"{file.name}: a message of /wrench is damaged (ValueError) and left out"]
    assert len(list(messages(bag))) == COUNT - 1


def test_what_is_whole_and_cannot_be_decoded_is_left_out_and_named(tmp_path: Path) -> None:
    """A flipped bit in a length, or zeros of a bad disk: each was a traceback of the decoder."""
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "message")
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        rows = database.execute("SELECT id, data FROM messages").fetchall()
        for number, data in rows[5:8]:
            whole = bytearray(compression.unpacked(data))
            whole[12:16] = b"\xff\xff\x00\x00"  # length of the name of the frame
            database.execute("UPDATE messages SET data = ? WHERE id = ?", (lz4.frame.compress(bytes(whole)), number))
    damage = Damage()
    tables = extract(bag, tmp_path / "csv", None, damage=damage)
    (sentence,) = damage.sentences
    assert re.fullmatch(r"a message of /wrench is damaged \(\w+\) and left out \(3 times\)", sentence)
    assert tables["/wrench"][1] == COUNT - 3
    assert len(series(bag, ["/wrench:wrench.force.x"])[0].values) == COUNT - 3


@pytest.mark.parametrize("spoiled", [b"\x87", b"float99 "])
def test_a_definition_that_cannot_be_read_costs_its_topic(spoiled: bytes, tmp_path: Path) -> None:
    """In a chunk without a checksum nothing else shows it: it was a traceback of the decoder."""
    text = ROS2.generate_msgdef(WRENCH, ros_version=2)[0].encode()
    file = tmp_path / "bag.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, enable_crcs=False)
        writer.start()
        schema = writer.register_schema(WRENCH, "ros2msg", text.replace(b"float64 ", spoiled, 1))
        topic = writer.register_channel("/wrench", "cdr", schema)
        for index in range(3):
            writer.add_message(topic, index, bytes(ROS2.serialize_cdr(wrench(ROS2, index), WRENCH)), index)
        writer.finish()  # type: ignore[no-untyped-call]
    for message in messages(file):
        with pytest.raises(DamagedMessageError, match=r"the definition of .*WrenchStamped, of /wrench, cannot be read"):
            message.decoded()


def test_a_damaged_text_of_a_database_is_one_sentence(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "message")
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE topics SET type = CAST(x'87' AS TEXT)")
    with pytest.raises(UsageError, match=re.escape(f"{file}: cannot be read as a sqlite3 bag")):
        list(messages(bag))


def test_a_message_that_grows_without_end_is_damaged(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = lz4.frame.compress(bytes(5000))
    monkeypatch.setattr(compression, "MOST_B", 4999)
    with pytest.raises(ValueError, match="more than 4999 bytes"):
        compression.unpacked(packed)


def test_a_compressed_database_that_is_cut_off_has_its_own_name(tmp_path: Path) -> None:
    """Not that of the temporary file that it was unpacked to."""
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "file")
    (file,) = bag.glob("*.zstd")
    whole = zstandard.ZstdDecompressor().stream_reader(file.read_bytes()).read()
    file.write_bytes(zstandard.compress(whole[: len(whole) // 2]))
    with pytest.raises(UsageError, match=re.escape(f"{file}: cannot be read as a sqlite3 bag")):
        list(messages(bag))


def test_a_damaged_compressed_file_is_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "bag_0.mcap.zstd"
    file.write_bytes(compression.ZSTD + b"\xff" * 50)
    with pytest.raises(UsageError, match=r"bag_0\.mcap\.zstd: cannot be unpacked"):
        list(messages(file))


def test_a_compressed_file_that_finds_no_room_names_the_folder_to_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = rosbag2(tmp_path / "bag", StoragePlugin.MCAP, "file")
    real = Path.open

    def full(self: Path, mode: str = "r", *rest: Any) -> Any:
        return real(Path("/dev/full"), mode, 0) if mode == "wb" else real(self, mode, *rest)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(HindraxError, match=r"no room to unpack it in .*; name a folder with room: export TMPDIR="):
        list(messages(bag))


def test_attachments_of_a_bag_that_was_compressed_by_hand(tmp_path: Path) -> None:
    file = small_bag(tmp_path / "bag")
    packed = file.with_name(f"{file.name}.lz4")
    packed.write_bytes(lz4.frame.compress(file.read_bytes()))
    file.unlink()
    assert attachments(tmp_path / "bag") == {"vehicle.yaml": b"name: sample\n"}


def test_topics_that_nobody_can_decode_are_named_in_the_copy(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, "message")
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE messages SET data = x'00010000'")
    made = recover(bag, tmp_path / "copy")
    assert made.unreadable == ("/wrench",)
    assert f"/wrench: its messages are not of {WRENCH}" in made.notes[0]


def test_what_does_not_read_back_is_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = small_bag(tmp_path / "bag")
    monkeypatch.setattr("hindrax_bag.write.bag_writer.BagFile.write", lambda *_: None)
    with pytest.raises(HindraxError, match="301 messages were written, 0 can be read back; check the disk"):
        recover(bag, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
