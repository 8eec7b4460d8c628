"""Whatever byte a file is cut at, a whole bag comes out, and no more than the open chunk is lost."""

from __future__ import annotations

import random

import pytest
from bag_samples import small_bag
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from hindrax_bag.reader import messages
from hindrax_bag.recover import recover
from hindrax_core.errors import UsageError


def _chunk_ends(path) -> list[int]:
    with path.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True).records
        return [stream.tell() for record in records if isinstance(record, Chunk)]


def test_cut_at_any_byte(tmp_path):
    path = small_bag(tmp_path / "bag")
    whole = path.read_bytes()
    everything = [(one.topic, one.data, one.received, one.sent) for one in messages(path)]
    ends = _chunk_ends(path)
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
            summary = make_reader(stream, validate_crcs=True).get_summary()
            assert summary.statistics.message_count == flushed
            assert bool(summary.chunk_indexes) == bool(flushed)


def test_recovered_bag_opens_elsewhere_and_keeps_everything(tmp_path):
    path = small_bag(tmp_path / "bag")
    path.write_bytes(path.read_bytes()[: _chunk_ends(path)[10] - 10])
    made = recover(path.parent, tmp_path / "out")
    with Reader(made.output) as reader:
        assert reader.message_count == made.messages == 201
        assert {one.digest for one in reader.connections} == {"", "RIHS01_" + "ab" * 32}
    with (made.output / "out_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert next(iter(reader.iter_attachments())).name == "vehicle.yaml"
        assert next(iter(reader.iter_metadata())).metadata == {"notes": "sample"}
    assert made.lost_s == pytest.approx(0.19)
    assert "in the middle of a chunk" in made.notes[0]


def test_a_whole_bag_loses_nothing(tmp_path):
    path = small_bag(tmp_path / "bag")
    made = recover(path, tmp_path / "out")
    assert (made.messages, made.lost_s, made.notes) == (301, 0.0, ())


def test_output_is_never_overwritten(tmp_path):
    path = small_bag(tmp_path / "bag", count=3)
    with pytest.raises(UsageError, match="exists already"):
        recover(path, path.parent)
