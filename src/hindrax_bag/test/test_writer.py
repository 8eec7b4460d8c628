"""What is written is what rosbag2 would have written, and other people's readers agree."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from hindrax_bag.definitions import definition
from hindrax_bag.metadata import Channel, is_whole, qualities_of
from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.read.mcap_records import Damage
from hindrax_bag.read.recovery import recover
from hindrax_bag.testing.bag_samples import (
    LEVEL,
    WORD,
    level,
    lookup,
    offered_qualities,
    small_bag,
    summary_of,
    word,
    writer,
)
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import LATCHED, SENSOR, Quality


def test_definition_brings_every_dependency_once() -> None:
    text = definition("demo_msgs/msg/Level", lookup)
    assert text.count("MSG: std_msgs/Header\n") == 1
    assert text.count("MSG: builtin_interfaces/Time\n") == 1
    assert text.startswith("std_msgs/Header header")


def test_bytes_come_back_untouched(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=50)
    found = list(messages(tmp_path / "bag"))
    assert [one.data for one in found if one.topic == LEVEL.topic] == [
        level(NS_PER_S + index * 10_000_000, index * 0.5) for index in range(50)
    ]
    assert found[0].data == word("hello")
    assert found[7].received - found[7].sent == 1_000_000
    assert found[7].decoded().level == 3.0


def test_mcap_reader_finds_schema_quality_hash_and_what_was_put_inside(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=5)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary, _ = summary_of(reader)
        attachments = list(reader.iter_attachments())
        metadata = list(reader.iter_metadata())
        decoded = [one.decoded_message.level for one in reader.iter_decoded_messages(topics=[LEVEL.topic])]
        assert reader.get_header().profile == "ros2"
    channel = next(one for one in summary.channels.values() if one.topic == LEVEL.topic)
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("demo_msgs/msg/Level", "ros2msg", "cdr")
    assert channel.metadata["topic_type_hash"] == LEVEL.type_hash
    (quality,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
    assert (quality["depth"], quality["reliability"], quality["durability"]) == (SENSOR.depth, "reliable", "volatile")
    assert attachments[0].data == b"name: sample\n"
    assert metadata[0].metadata == {"notes": "sample"}
    assert decoded == [0.0, 0.5, 1.0, 1.5, 2.0]


def test_mcap_reader_verifies_every_checksum_and_finds_messages_by_their_index(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=3000, per_flush=1000)
    with path.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
        assert next(one for one in records if isinstance(one, DataEnd)).data_section_crc
        stream.seek(0)
        reader = make_reader(stream, validate_crcs=True)
        begin, end = NS_PER_S + 50 * 10_000_000, NS_PER_S + 1060 * 10_000_000
        found = [one for _, _, one in reader.iter_messages([LEVEL.topic], starting_at=begin, ending_before=end)]
        summary, statistics = summary_of(reader)
    assert [one.data for one in found] == [level(NS_PER_S + i * 10_000_000, i * 0.5) for i in range(50, 1060)]
    counts = statistics.channel_message_counts
    assert {summary.channels[number].topic: count for number, count in counts.items()} == {
        LEVEL.topic: 3000,
        WORD.topic: 1,
    }
    assert statistics.message_start_time == NS_PER_S
    assert statistics.message_end_time == NS_PER_S + 2999 * 10_000_000 + 1_000_000


def test_qualities_of_the_publishers_survive_a_recovery(tmp_path: Path) -> None:
    several = Channel("/demo/word", "demo_msgs/msg/Word", (LATCHED, Quality(reliable=False, depth=3, deadline_s=0.25)))
    bag = writer(tmp_path / "bag")
    bag.write(several, word("a"), 1, 1)
    bag.close()
    recover(tmp_path / "bag", tmp_path / "out")
    assert (tmp_path / "out" / "metadata.yaml").read_text().count("keep_last") == 2
    with Reader(tmp_path / "out") as reader:
        (one,) = reader.connections
        assert [quality.reliability.name for quality in offered_qualities(one)] == ["RELIABLE", "BEST_EFFORT"]
        assert [quality.depth for quality in offered_qualities(one)] == [1, 3]
        assert offered_qualities(one)[1].deadline.nsec == 250_000_000


@pytest.mark.parametrize("text", ["", "- 1", "7", "- {reliability: 1}", "{"])
def test_unknown_words_on_quality_are_passed_over(text: str) -> None:
    assert qualities_of(text) == ()


def test_numbers_of_older_bags_are_the_same_qualities() -> None:
    forever = "{sec: 2147483647, nsec: 4294967295}"
    text = f"- {{history: 3, depth: 0, reliability: 1, durability: 1, deadline: {forever}, lifespan: {forever}}}"
    assert qualities_of(text) == (Quality(latched=True),)
    assert qualities_of(text.replace("reliability: 1", "reliability: 2")) == (Quality(latched=True, reliable=False),)


def test_rosbags_reads_the_folder(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=50)
    with Reader(tmp_path / "bag") as reader:
        topics = {one.topic: one for one in reader.connections}
        assert reader.message_count == 51
        assert topics[LEVEL.topic].digest == LEVEL.type_hash
        assert offered_qualities(topics[WORD.topic])[0].durability.name == "TRANSIENT_LOCAL"
        data = [bytes(raw) for one, _, raw in reader.messages() if one.topic == LEVEL.topic]
    assert data[3] == level(NS_PER_S + 30_000_000, 1.5)


def test_a_bag_is_never_overwritten(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=1)
    with pytest.raises(HindraxError, match="exists already"):
        writer(tmp_path / "bag")


def test_a_bag_is_made_in_a_folder_that_may_be_there_or_not(tmp_path: Path) -> None:
    for folder in (tmp_path / "data" / "dive" / "bag", tmp_path / "empty" / "bag"):
        (tmp_path / "empty" / "bag").mkdir(parents=True, exist_ok=True)
        writer(folder).close()
        assert bag_files(folder) == [folder / "bag_0.mcap"]


def test_a_resumed_bag_goes_on_after_all_of_its_files_and_names_the_unfinished(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_s=1.9, keep_free_MB=0.0))
    _record(bag, 3)
    bag._give_up(OSError(28, "No space left on device"))
    bag.close()
    unfinished = tmp_path / "bag" / "bag_1.mcap"
    unfinished = unfinished.rename(unfinished.with_name("bag_10.mcap"))
    resumed = BagWriter(tmp_path / "bag", lookup)
    assert resumed.open(resume=True) == [unfinished]
    assert resumed.path.name == "bag_11.mcap"
    resumed.close()


def test_another_bag_in_the_folder_is_not_resumed(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=1).rename(tmp_path / "bag" / "other_0.mcap")
    with pytest.raises(HindraxError, match=r"holds another bag \(found other_0.mcap, wanted bag_0.mcap and the like"):
        BagWriter(tmp_path / "bag", lookup).open(resume=True)


def test_two_recorders_do_not_write_into_one_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def open_files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    bag, before = writer(tmp_path / "bag"), open_files()
    with pytest.raises(HindraxError, match="another recorder writes there"):
        BagWriter(tmp_path / "bag", lookup).open(resume=True)
    assert open_files() == before
    with bag.path.open("rb") as file, pytest.raises(BlockingIOError):
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    bag.close()
    closed: list[int] = []
    monkeypatch.setattr(os, "close", closed.append)
    bag.close()
    assert closed == [], "the lock is given back once"
    monkeypatch.undo()
    next_one = BagWriter(tmp_path / "bag", lookup)
    next_one.open(resume=True)
    next_one.close()


def test_what_was_flushed_is_on_disk_without_an_end(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag")
    for index in range(10):
        bag.write(LEVEL, level(index, 0.0), index + 1, index)
    bag.flush()
    bag.write(LEVEL, level(11, 0.0), 11, 11)
    assert len(list(messages(tmp_path / "bag"))) == 10


def _record(bag: BagWriter, seconds: int, per_s: int = 100) -> list[str]:
    decisions: list[str] = []
    for second in range(seconds):
        for index in range(per_s):
            stamp = (second + 1) * NS_PER_S + index * NS_PER_S // per_s
            bag.write(WORD, word(f"{stamp * 7919 % 1_000_003:09d}" * 20), stamp, stamp)
        decisions += bag.flush()
    return decisions


def test_split_by_time_leaves_files_that_each_open_alone(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_s=1.9, keep_free_MB=0.0))
    bag.describe("hindrax", {"notes": "split"})
    decisions = _record(bag, 6)
    bag.close()
    files = bag_files(tmp_path / "bag")
    assert len(files) == 4
    assert decisions == [f"bag_{n}.mcap is full; recording continues in bag_{n + 1}.mcap" for n in range(3)]
    assert [len(list(messages(file))) for file in files] == [200, 200, 200, 0]
    for file in files:
        with file.open("rb") as stream:
            assert next(iter(make_reader(stream).iter_metadata())).metadata == {"notes": "split"}
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 600
        assert len(list(reader.messages())) == 600


def test_unless_given_a_file_ends_after_a_quarter_of_an_hour_with_the_index_that_it_kept_in_memory() -> None:
    assert not BagLimits().split_due(1, 899.0)
    assert BagLimits().split_due(1, 900.0)
    assert not BagLimits(split_s=0.0).split_due(1, 1e6)


def test_split_by_size(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_MB=0.002, keep_free_MB=0.0))
    _record(bag, 3)
    bag.close()
    assert len(bag_files(tmp_path / "bag")) == 4


def test_budget_stops_the_recording_and_reports_it(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(budget_MB=0.004, keep_free_MB=0.0))
    decisions = _record(bag, 10)
    bag.close()
    assert decisions == ["the bag has used its 0.004 MB of the disk; recording stopped"]
    assert bag.stopped == decisions[0]
    kept = len(list(messages(tmp_path / "bag")))
    assert 0 < kept < 1000
    assert kept % 100 == 0


def test_budget_drops_the_oldest_file_when_asked(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(budget_MB=0.02, when_full="oldest", keep_free_MB=0.0))
    decisions = _record(bag, 30)
    bag.close()
    assert any("dropped the oldest, bag_0.mcap" in sentence for sentence in decisions)
    assert not bag.stopped
    assert bag.counts == {WORD.topic: 3000}
    stamps = [one.received for one in messages(tmp_path / "bag")]
    assert stamps[-1] == 30 * NS_PER_S + 990_000_000
    assert len(stamps) < 3000
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == len(stamps)


def test_a_dropped_file_is_named_no_more_even_if_the_recorder_is_killed_then(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(budget_MB=0.02, when_full="oldest", keep_free_MB=0.0))
    while not any("dropped" in sentence for sentence in _record(bag, 1)):
        pass
    assert "bag_0.mcap" not in (tmp_path / "bag" / "metadata.yaml").read_text()
    bag.close()


def test_a_full_disk_is_noticed_before_and_during_the_recording(tmp_path: Path) -> None:
    with pytest.raises(HindraxError, match="MB are wanted"):
        writer(tmp_path / "never", BagLimits(planned_s=1e6, keep_free_MB=1e6))
    bag = writer(tmp_path / "bag", BagLimits(keep_free_MB=50.0))
    bag.free = lambda _folder: 1_000_000
    assert _record(bag, 2) == ["less than 50 MB are free on the disk; recording waits for room"]
    assert len(list(messages(tmp_path / "bag"))) == 100


def test_recording_goes_on_in_the_next_file_when_there_is_room_again(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(keep_free_MB=50.0))
    bag.describe("hindrax", {"notes": "full"})
    for free_MB, decisions, stopped in (
        (50, [], False),
        (49, ["less than 50 MB are free on the disk; recording waits for room"], True),
        (74, [], True),
        (75, ["there is room on the disk again; recording continues in bag_1.mcap"], False),
        (49, ["less than 50 MB are free on the disk; recording waits for room"], True),
    ):
        bag.free = lambda _folder, free_MB=free_MB: free_MB * 1_000_000  # type: ignore[misc]
        assert _record(bag, 1) == decisions
        assert bool(bag.stopped) is stopped
    bag.close()
    assert [len(list(messages(file))) for file in bag_files(tmp_path / "bag")] == [200, 100]
    with bag_files(tmp_path / "bag")[1].open("rb") as stream:
        assert next(iter(make_reader(stream).iter_metadata())).metadata == {"notes": "full"}


def test_a_disk_that_is_full_as_a_file_ends_leaves_no_file_unfinished(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_s=1.9, keep_free_MB=50.0))
    bag.free = lambda _folder: 1_000_000_000
    _record(bag, 1)
    bag.free = lambda _folder: 1_000_000
    stamp = 3 * NS_PER_S
    bag.write(WORD, word("late"), stamp, stamp)
    assert bag.flush() == [
        "bag_0.mcap is full; recording continues in bag_1.mcap",
        "less than 50 MB are free on the disk; recording waits for room",
    ]
    files = bag_files(tmp_path / "bag")
    assert [(file.name, is_whole(file)) for file in files] == [("bag_0.mcap", True), ("bag_1.mcap", True)]
    bag.close()


def test_a_resumed_bag_of_nothing_begins_with_its_first_file(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "bag", lookup)
    assert bag.open(resume=True) == []
    bag.close()
    assert bag_files(tmp_path / "bag") == [bag.path] == [tmp_path / "bag" / "bag_0.mcap"]


def test_a_bag_that_was_never_opened_closes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[int] = []
    monkeypatch.setattr(os, "close", closed.append)
    BagWriter(tmp_path / "bag", lookup).close()
    assert closed == []


def test_a_bag_of_no_planned_length_begins_on_a_full_disk_and_waits(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "bag", lookup, limits=BagLimits(keep_free_MB=50.0))
    bag.free = lambda _folder: 1_000_000
    bag.open()
    bag.describe("hindrax", {"notes": "full"})
    assert (bag.path.name, bag.size_bytes) == ("bag_0.mcap", 0)
    assert bag.stopped == "less than 50 MB are free on the disk; recording waits for room"
    assert _record(bag, 1) == []
    bag.free = lambda _folder: 1_000_000_000
    assert bag.flush() == ["there is room on the disk again; recording continues in bag_0.mcap"]
    _record(bag, 1)
    bag.close()
    assert len(list(messages(tmp_path / "bag"))) == 100


def test_a_bag_that_has_used_its_budget_does_not_go_on_for_want_of_room_before(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(budget_MB=0.006, keep_free_MB=50.0))
    bag.free = lambda _folder: 1_000_000
    _record(bag, 1)
    bag.free = lambda _folder: 1_000_000_000
    decisions = _record(bag, 10)
    assert ["continues in" in sentence for sentence in decisions] == [True, False]
    assert decisions[-1] == bag.stopped == "the bag has used its 0.006 MB of the disk; recording stopped"
    bag.close()


def test_what_is_to_outlast_a_power_cut_is_given_to_the_disk_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag, synced, fsync = writer(tmp_path / "bag"), list[int](), os.fsync

    def watched(descriptor: int) -> None:
        fsync(descriptor)
        if Path(f"/proc/self/fd/{descriptor}").readlink() == bag.path:
            synced.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", watched)
    _record(bag, 1)
    assert synced == []
    bag.flush(sync=True)
    assert synced == [bag.path.stat().st_size]
    bag.close()
    assert synced[1:] == [bag.path.stat().st_size]


def refusing(number: int, text: str) -> Callable[..., None]:
    """In the place of what writes, on a disk with this error."""

    def refuse(*_args: object, **_keywords: object) -> None:
        raise OSError(number, text)

    return refuse


def test_a_disk_that_refuses_the_end_of_a_file_is_reported_and_what_was_flushed_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = writer(tmp_path / "bag")
    _record(bag, 1)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", refusing(5, "Input/output error"))
        bag.close()
    assert "Input/output error" in bag.stopped
    assert len(list(messages(tmp_path / "bag"))) == 100
    bag.close()


def test_a_disk_that_refuses_ends_the_recording_but_not_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = writer(tmp_path / "bag")
    _record(bag, 1)

    part = bag._part
    monkeypatch.setattr(type(part), "flush", refusing(28, "No space left on device"))
    (decisions,) = bag.flush()
    assert "No space left on device" in decisions
    assert "bag recover" in decisions
    assert bag.flush() == []
    with bag.path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # nobody has it any more: it can be recovered
    bag.close()
    damage = Damage()
    assert len(list(messages(Path(bag.folder), damage=damage))) == 100
    assert damage.unfinished


def test_a_disk_that_refuses_a_message_ends_the_recording_with_what_was_flushed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = writer(tmp_path / "bag")
    _record(bag, 1)

    monkeypatch.setattr(type(bag._part), "write", refusing(28, "No space left on device"))
    for _ in range(2):
        bag.write(WORD, word("lost"), 5 * NS_PER_S, 5 * NS_PER_S)
    assert "bag_0.mcap: No space left on device; recording stopped" in bag.stopped
    assert bag.counts == {WORD.topic: 100}
    bag.close()
    assert len(list(messages(tmp_path / "bag"))) == 100
