"""Whatever byte a file is cut at, a whole bag comes out, and no more than the open chunk is lost."""

import os
import random
import struct
import tracemalloc
from dataclasses import replace
from pathlib import Path

import lz4.frame
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Message
from mcap.writer import Writer
from rosbags.rosbag2 import Reader

from hindrax_bag.read import mcap_records, recovery
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.mcap_records import Damage, records
from hindrax_bag.read.recovery import recover
from hindrax_bag.testing.bag_samples import LEVEL, chunk_ends, level, small_bag, summary_of, writer
from hindrax_bag.write.bag_writer import BagFile
from hindrax_bag.write.limits import BagLimits
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import NS_PER_S


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hundreds of bags are made here, and none is to survive this machine."""
    monkeypatch.setattr(os, "fsync", lambda _number: None)


def test_cut_at_any_byte(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag")
    whole = path.read_bytes()
    everything = [(one.topic, one.data, one.received, one.sent) for one in messages(path)]
    ends = chunk_ends(path)
    offsets = {0, 1, 7, 8, 9, len(whole) - 1, *random.Random(6).sample(range(len(whole)), 200)}
    for offset in offsets:
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(whole[:offset])
        made = recover(cut, tmp_path / f"out{offset}")
        found = [(one.topic, one.data, one.received, one.sent) for one in messages(made.output)]
        flushed = min(len(everything), 20 * sum(end <= offset for end in ends) + (offset >= ends[0]))
        assert found == everything[:flushed], offset
        assert made.messages == flushed
        assert 0.0 <= made.lost_s <= 0.2
        with next(made.output.glob("*.mcap")).open("rb") as stream:
            summary, statistics = summary_of(make_reader(stream, validate_crcs=True))
            assert statistics.message_count == flushed
            assert bool(summary.chunk_indexes) == bool(flushed)


def test_a_channel_that_has_lost_its_schema_keeps_its_messages(tmp_path: Path) -> None:
    with (tmp_path / "lost.mcap").open("wb") as file:
        bare = Writer(file, use_chunking=False)
        bare.start()
        lost = bare.register_channel(LEVEL.topic, "cdr", schema_id=7)
        for index in range(3):
            bare.add_message(lost, index, level(index, 0.5), index)
        bare.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    made = recover(tmp_path / "lost.mcap", tmp_path / "out")
    assert made.messages == 3
    with next(made.output.glob("*.mcap")).open("rb") as stream:
        assert [message.data for _, _, message in make_reader(stream).iter_messages()] == [
            level(n, 0.5) for n in range(3)
        ]


def test_messages_of_a_channel_that_is_lost_are_left_out(tmp_path: Path) -> None:
    whole = small_bag(tmp_path / "bag", count=3).read_bytes()
    stray = struct.pack("<BQHIQQ", Opcode.MESSAGE, 26, 99, 0, 1, 1) + b"data"
    (tmp_path / "stray.mcap").write_bytes(whole[:8] + stray + whole[8:])
    made = recover(tmp_path / "stray.mcap", tmp_path / "out")
    assert (made.messages, [one.topic for one in messages(made.output)]) == (4, ["/demo/word", *[LEVEL.topic] * 3])


def test_a_bag_of_several_files_is_cut_at_any_byte_of_its_last(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag", BagLimits(split_s=1.0, keep_free_MB=0.0))
    for index in range(340):
        bag.write(LEVEL, level(index, index * 0.5), NS_PER_S + index * 10_000_000, index)
        if index % 20 == 19:
            bag.flush()
    files, last = sorted((tmp_path / "bag").glob("*.mcap")), bag.path
    bag.close()
    everything = [one.data for one in messages(tmp_path / "bag")]
    assert (len(files), len(everything)) == (3, 340)
    whole, ends = last.read_bytes(), chunk_ends(last)
    before = sum(1 for file in files[:-1] for _ in messages(file))
    for offset in random.Random(7).sample(range(len(whole)), 30):
        last.write_bytes(whole[:offset])
        made = recover(tmp_path / "bag", tmp_path / f"out{offset}")
        held = sum(1 for end in ends if end <= offset)
        kept = [one.data for one in messages(made.output)]
        assert kept == everything[: before + 20 * held], offset
        with Reader(made.output) as reader:
            assert reader.message_count == made.messages == len(kept)
        assert len(list(made.output.glob("*.mcap"))) == 3


def test_a_damaged_chunk_costs_itself_only(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag")
    data, ends = bytearray(path.read_bytes()), chunk_ends(path)
    data[ends[5] - 40] ^= 0xFF
    path.write_bytes(data)
    made, damage = recover(path, tmp_path / "out"), Damage()
    assert made.messages == len(list(messages(path, damage=damage))) == 301 - 20
    assert made.lost_s == damage.lost_s == pytest.approx(0.19)
    (note,) = damage.notes
    assert made.notes == (note,)
    assert "a chunk is damaged" in note
    assert not damage.unfinished


def test_recovered_bag_opens_elsewhere_and_keeps_everything(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag")
    path.write_bytes(path.read_bytes()[: chunk_ends(path)[10] - 10])
    made = recover(path.parent, tmp_path / "out")
    with Reader(made.output) as reader:
        assert reader.message_count == made.messages == 201
        assert {one.digest for one in reader.connections} == {"", "RIHS01_" + "ab" * 32}
    with (made.output / "out_0.mcap").open("rb") as stream:
        inside = make_reader(stream)
        assert next(iter(inside.iter_attachments())).name == "vehicle.yaml"
        assert next(iter(inside.iter_metadata())).metadata == {"notes": "sample"}
    assert made.lost_s == pytest.approx(0.19)
    assert "in the middle of a chunk" in made.notes[0]


def test_a_whole_bag_loses_nothing(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag")
    made = recover(path, tmp_path / "out")
    assert (made.messages, made.lost_s, made.notes) == (301, 0.0, ())


def test_output_is_never_overwritten(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=3)
    with pytest.raises(UsageError, match="exists already"):
        recover(path, path.parent)


def test_the_output_may_be_an_empty_folder_or_one_to_be_made_but_no_file(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag", count=3)
    (tmp_path / "empty").mkdir()
    for output in (tmp_path / "empty", tmp_path / "far" / "away"):
        made = recover(path, output)
        assert [one.decoded().level for one in messages(made.output, {LEVEL.topic})] == [0.0, 0.5, 1.0]
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="exists already"):
        recover(path, tmp_path / "file")


def test_what_is_no_bag_leaves_no_output(tmp_path: Path) -> None:
    (tmp_path / "x.db3").write_text("a text that is no bag")
    with pytest.raises(UsageError, match="sqlite3"):
        recover(tmp_path / "x.db3", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_messages_are_kept_by_topic_and_by_seconds_since_the_first(tmp_path: Path) -> None:
    path = small_bag(tmp_path / "bag")
    made = recover(path, tmp_path / "out", keep=lambda topic, after_s: topic == LEVEL.topic and after_s < 1.0)
    found = list(messages(made.output))
    assert [one.data for one in found] == [level(NS_PER_S + i * 10_000_000, i * 0.5) for i in range(100)]


def test_messages_of_another_namespace_are_chosen_by_the_name_that_is_shown_and_keep_their_own(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag")
    bag.describe("hindrax", {"namespace": "/rov1"})
    for topic in ("/rov1/level", "/rov1/other"):
        bag.write(replace(LEVEL, topic=topic), level(1, 2.0), 1, 1)
    bag.close()
    shown = [one.topic for one in messages(tmp_path / "bag")]
    assert shown == ["/hindrax/level", "/hindrax/other"]
    made = recover(tmp_path / "bag", tmp_path / "out", keep=lambda topic, _: topic == shown[0])
    with Reader(made.output) as reader:
        assert [one.topic for one in reader.connections] == ["/rov1/level"]
    assert [one.topic for one in messages(made.output)] == shown[:1]


def test_a_long_recovery_states_now_and_then_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, progress = small_bag(tmp_path / "bag", count=250), list[int]()
    monkeypatch.setattr(recovery, "EVERY", 100)
    assert recover(path, tmp_path / "out", progress.append).messages == 251
    assert progress == [100, 200]


def _zstd_of_zeros(size: int, claimed: int | None = None) -> bytes:
    """A frame of RLE blocks (RFC 8878, 3.1.1): four bytes for each 128 KiB of zeros; it may claim another size."""
    head = b"\x28\xb5\x2f\xfd" + (b"\x00\x38" if claimed is None else b"\xc0\x38" + struct.pack("<Q", claimed))
    block = 2**17
    blocks = [min(block, size - at) for at in range(0, size, block)]
    parts = [
        (length << 3 | 1 << 1 | (i == len(blocks) - 1)).to_bytes(3, "little") + b"\x00"
        for i, length in enumerate(blocks)
    ]
    return head + b"".join(parts)


@pytest.mark.parametrize(
    ("compression", "data", "claimed"),
    [
        ("zstd", _zstd_of_zeros(2**32), 2**32),
        ("zstd", _zstd_of_zeros(2**32), 100),
        ("zstd", _zstd_of_zeros(2**20, claimed=2**40), 2**40),
        ("zstd", _zstd_of_zeros(2**20), 2**63),
        ("lz4", lz4.frame.compress(bytes(2**24)), 2**24),
        ("lz4", lz4.frame.compress(bytes(2**24)), 2**63),
        ("", bytes(2**21), 2**21),
        ("brotli", bytes(100), 100),
    ],
    ids=["zstd", "zstd claims less", "zstd claims more", "zstd of 2^63", "lz4", "lz4 of 2^63", "none", "unknown"],
)
def test_a_chunk_that_claims_or_holds_gigabytes_costs_itself_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str, data: bytes, claimed: int
) -> None:
    path = small_bag(tmp_path / "bag")
    monkeypatch.setattr(mcap_records, "MOST_B", 2**20)
    whole, end = path.read_bytes(), chunk_ends(path)[0]
    body = (
        struct.pack("<QQQII", 0, 0, claimed, 0, len(compression)) + compression.encode() + struct.pack("<Q", len(data))
    )
    record = struct.pack("<BQ", Opcode.CHUNK, len(body) + len(data)) + body + data
    path.write_bytes(whole[:end] + record + whole[end:])
    tracemalloc.start()
    damage = Damage()
    found = sum(isinstance(one, Message) for one in records(path, damage))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == len(list(messages(small_bag(tmp_path / "same"))))
    assert damage.left_out == 1
    assert peak < 2**24


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_what_ends_a_recovery_leaves_no_part_that_is_in_the_way_of_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: BaseException
) -> None:
    bag = small_bag(tmp_path / "bag.mcap")

    def fail(*_: object) -> None:
        raise failure

    with monkeypatch.context() as patch:
        patch.setattr(BagFile, "close", fail)
        with pytest.raises((HindraxError, KeyboardInterrupt)):
            recover(bag, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert recover(bag, tmp_path / "out").messages
