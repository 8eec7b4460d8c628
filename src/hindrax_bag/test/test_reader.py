"""Third-party bags, damaged bags, and files that are no bag."""

import sqlite3
import struct
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.records import Channel, Schema

from hindrax_bag.definitions import definition
from hindrax_bag.metadata import NAME, Contents, metadata_text
from hindrax_bag.read.bag_reader import DamagedMessageError, MessageDecoder, attachments, bag_files, messages
from hindrax_bag.read.mcap_records import Damage
from hindrax_bag.read.recovery import recover
from hindrax_bag.testing.bag_samples import LEVEL, level, lookup, small_bag, writer
from hindrax_bag.write.limits import BagLimits
from hindrax_core.errors import UsageError


def sqlite_bag(folder: Path, *, with_definitions: bool) -> Path:
    """A bag as rosbag2's sqlite3 storage lays it out (schema versions 3 and 4)."""
    folder.mkdir()
    path = folder / "other_0.db3"
    base = sqlite3.connect(path)
    base.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL)"
    )
    base.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL)"
    )
    base.execute("INSERT INTO topics VALUES(1, '/demo/level', 'demo_msgs/msg/Level', 'cdr', '', '')")
    base.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)",
        [(index * 100, level(index, index * 2.0)) for index in range(5, 0, -1)],
    )
    if with_definitions:
        base.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,"
            " encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)"
        )
        text = definition(LEVEL.type, lookup)
        base.execute("INSERT INTO message_definitions VALUES(1, ?, 'ros2msg', ?, '')", (LEVEL.type, text))
    base.commit()
    base.close()
    return path


def test_sqlite_bag(tmp_path: Path) -> None:
    sqlite_bag(tmp_path / "other", with_definitions=True)
    found = list(messages(tmp_path / "other"))
    assert [one.decoded().level for one in found] == [2.0, 4.0, 6.0, 8.0, 10.0]
    assert found[0].received == 100
    assert found[0].type == LEVEL.type


def test_a_recovered_sqlite_bag_is_mcap_with_the_same_messages(tmp_path: Path) -> None:
    made = recover(sqlite_bag(tmp_path / "other", with_definitions=True), tmp_path / "out")
    assert [file.name for file in bag_files(made.output)] == ["out_0.mcap"]
    found = list(messages(made.output))
    assert [(one.received, one.sent, one.decoded().level) for one in found] == [
        (index * 100, index * 100, index * 2.0) for index in range(1, 6)
    ]
    assert {(one.topic, one.type) for one in found} == {(LEVEL.topic, LEVEL.type)}


def test_standard_types_are_known_where_the_bag_has_no_definitions(tmp_path: Path) -> None:
    """Bags of before Iron, as of every Humble vehicle."""
    path = sqlite_bag(tmp_path / "other", with_definitions=False)
    vector = struct.pack("<4s3d", b"\0\1\0\0", 1.0, 2.0, 3.0)
    with closing(sqlite3.connect(path)) as base:
        base.execute("UPDATE topics SET type = 'geometry_msgs/msg/Vector3'")
        base.execute("UPDATE messages SET data = ?", (vector,))
        base.commit()
    found = [one.decoded() for one in messages(path)]
    assert [(one.x, one.y, one.z) for one in found] == 5 * [(1.0, 2.0, 3.0)]


def test_sqlite_bag_of_an_unknown_type_names_the_remedy(tmp_path: Path) -> None:
    path = sqlite_bag(tmp_path / "other", with_definitions=False)
    with pytest.raises(UsageError, match=r"demo_msgs/msg/Level is not in the bag.* ros2 bag convert"):
        list(messages(path))


def test_a_file_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    for name in ("x.mcap", "x.db3"):
        (tmp_path / name).write_bytes(b"nothing like a bag, but long enough to look")
        with pytest.raises(UsageError, match=name):
            list(messages(tmp_path / name))
    with pytest.raises(UsageError, match="an empty folder"):
        bag_files(_folder(tmp_path / "empty"))
    with pytest.raises(UsageError, match="does not exist"):
        bag_files(tmp_path / "none")


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ([], "found an empty folder"),
        (["notes.txt"], "found a folder with notes.txt, wanted"),
        (["notes.txt", "a.png"], "found a folder with a.png and others, wanted"),
    ],
)
def test_a_folder_without_a_bag_is_reported_by_what_is_in_it(tmp_path: Path, names: list[str], found: str) -> None:
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(UsageError, match=found):
        bag_files(tmp_path)


def test_the_folder_of_a_run_stands_for_the_bag_in_it(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=1)
    assert bag_files(tmp_path) == bag_files(tmp_path / "bag") == bag_files(path) == [path]


def test_a_part_that_metadata_has_and_the_folder_lacks_is_named(tmp_path: Path) -> None:
    """Half of a flight was missing, without a word."""
    file = small_bag(tmp_path / "bag", count=5)
    beside = file.parent / NAME
    beside.write_text(metadata_text([Contents(file.name), Contents("bag_1.mcap")]), encoding="utf-8")
    damage = Damage()
    assert list(messages(file.parent, damage=damage))
    assert damage.notes == ["bag_1.mcap: is missing, by metadata.yaml; copy it beside the others"]
    for text in (metadata_text([Contents("before_it_was_renamed.mcap")]), "", "rosbag2_bagfile_information: 1", "{"):
        beside.write_text(text, encoding="utf-8")
        whole = Damage()
        assert list(messages(file.parent, damage=whole))
        assert not whole.notes


def test_topics_are_chosen_by_name(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=3)
    sqlite_bag(tmp_path / "other", with_definitions=True)
    for bag, count in ((tmp_path / "bag", 3), (tmp_path / "other", 5)):
        assert [one.topic for one in messages(bag, [LEVEL.topic])] == [LEVEL.topic] * count
        assert list(messages(bag, ["/nowhere"])) == []


def test_topics_of_a_vehicle_elsewhere_are_named_as_at_home(tmp_path: Path) -> None:
    for name, of, topic in (("a", "hindrax", "/hindrax/level"), ("b", "somebody", "/rov1/level")):
        bag = writer(tmp_path / name)
        bag.describe(of, {"namespace": "/rov1"})
        bag.write(replace(LEVEL, topic="/rov1/level"), level(1, 2.0), 1, 1)
        bag.close()
        assert [one.topic for one in messages(tmp_path / name)] == [topic]


def test_files_inside_a_bag_are_found_by_name_the_first_of_each(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_MB=0.0001, keep_free_MB=0.0))
    for number in (1, 2):
        bag.attach("vehicle.yaml", "application/yaml", b"%d" % number, 1)
    bag.attach("parameters.yaml", "application/yaml", b"3", 1)
    bag.write(LEVEL, level(1, 2.0), 1, 1)
    bag.flush()
    bag.close()
    assert attachments(tmp_path / "bag") == {"vehicle.yaml": b"1", "parameters.yaml": b"3"}
    assert attachments(sqlite_bag(tmp_path / "other", with_definitions=True)) == {}


def _channel(encoding: str) -> Channel:
    return Channel(1, "/demo", encoding, {}, 1)


def test_a_message_of_an_earlier_version_is_brought_to_today_s_form_and_one_of_today_stays() -> None:
    for text, old, armings in ((b"bool armed\n", True, 0), (b"bool armed\nuint8 armings\n", False, 7)):
        form = MessageDecoder(_channel("cdr"), Schema(1, text, "ros2msg", "hindrax_msgs/msg/ThrusterState"))
        assert (form.old, form.definition) == (old, text.decode())
        for _ in range(2):
            message = form.decode(b"\x00\x01\x00\x00\x01\x07")
            assert (message.armed, message.armings) == (True, armings)


def test_a_channel_without_a_schema_has_no_type() -> None:
    form = MessageDecoder(_channel("cdr"), None)
    assert (form.type, form.definition, form.old) == ("", "", False)


def test_an_encoding_that_nobody_knows_is_named() -> None:
    form = MessageDecoder(_channel("json"), Schema(1, b"", "jsonschema", "Demo"))
    assert (form.type, form.definition, form.old) == ("Demo", "", False)
    with pytest.raises(UsageError, match="topic /demo: encoding 'json' cannot be decoded, wanted cdr"):
        form.decode(b"{}")


def test_a_tail_of_zeros_as_some_file_systems_leave_it(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=100)
    data = path.read_bytes()
    path.write_bytes(data[:2500] + bytes(4096))
    damage = Damage()
    assert len(list(messages(path, damage=damage))) > 20
    assert damage.unfinished


@pytest.mark.parametrize("length", [2**33, 2**62, 2**64 - 1])
def test_lengths_that_no_file_has_cost_no_memory_and_no_more_than_their_record(tmp_path: Path, length: int) -> None:
    path = small_bag(tmp_path / "bag", count=100)
    data = path.read_bytes()
    second = data.index(b"zstd", data.index(b"zstd") + 1)
    of_record, of_content = second - 40, second + 4
    for place, wanted in ((of_content, 81), (of_record, 21)):
        path.write_bytes(data[:place] + length.to_bytes(8, "little") + data[place + 8 :])
        damage = Damage()
        tracemalloc.start()
        found = len(list(messages(path, damage=damage)))
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert (found >= wanted, len(damage.notes) <= 1) == (True, True)
        assert damage.unfinished == (place == of_record)
        assert most < 10_000_000


def test_elements_that_no_message_has_cost_no_memory() -> None:
    text = b"string[] names\nfloat64[] values\nInner[] inners\n" + b"=" * 80 + b"\nMSG: demo_msgs/Inner\nuint8 one\n"
    form = MessageDecoder(_channel("cdr"), Schema(1, text, "ros2msg", "demo_msgs/msg/Many"))
    for count in range(3):
        tracemalloc.start()
        with pytest.raises(DamagedMessageError):
            form.decode(b"\x00\x01\x00\x00" + bytes(4 * count) + b"\xff\xff\xff\x7f" * 9)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
        tracemalloc.stop()
