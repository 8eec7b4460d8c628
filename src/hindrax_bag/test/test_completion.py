"""Bags that a recorder left unfinished: resumed in the next file, and completed where they lie."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from hindrax_bag import metadata
from hindrax_bag.metadata import is_whole, parts, write_metadata
from hindrax_bag.read import recovery
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.recovery import begin_completion, complete, copy_of, main, unfinished_files
from hindrax_bag.read.survey import find_bags
from hindrax_bag.testing.bag_samples import LEVEL, chunk_ends, level, lookup, small_bag, summary_of, writer
from hindrax_bag.write import bag_writer
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_core.events import NS_PER_S


def unfinished_bag(folder: Path) -> Path:
    """A bag whose recorder was killed as it wrote its tenth chunk; returns its only file."""
    path = small_bag(folder)
    path.write_bytes(path.read_bytes()[: chunk_ends(path)[9] - 10])
    (folder / "metadata.yaml").unlink()
    return path


def resumed(folder: Path, limits: BagLimits | None = None) -> tuple[BagWriter, list[Path]]:
    made = BagWriter(folder, lookup, limits=limits or BagLimits(keep_free_MB=0.0))
    return made, made.open(resume=True)


def record(bag: BagWriter, count: int) -> None:
    for index in range(count):
        bag.write(LEVEL, level(index, 1.0), 9 * NS_PER_S + index, index)


def test_an_unfinished_bag_is_resumed_completed_and_indexed(tmp_path: Path) -> None:
    first = unfinished_bag(tmp_path / "bag")
    bag, unfinished = resumed(tmp_path / "bag")
    assert unfinished == [first]
    record(bag, 7)
    bag.close()
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 7
    subprocess.run([sys.executable, "-m", "hindrax_bag.read.recovery", *unfinished], check=True)
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == len(list(reader.messages())) == 181 + 7
    with first.open("rb") as stream:
        assert summary_of(make_reader(stream, validate_crcs=True))[1].message_count == 181
    assert sorted(file.name for file in first.parent.iterdir()) == ["bag_0.mcap", "bag_1.mcap", "metadata.yaml"]


def test_a_finished_bag_is_resumed_and_metadata_names_all_files(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=5)
    bag, unfinished = resumed(tmp_path / "bag")
    assert unfinished == []
    record(bag, 7)
    bag.close()
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == len(list(reader.messages())) == 6 + 7
        assert {one.topic: one.digest for one in reader.connections}[LEVEL.topic] == LEVEL.type_hash


def test_a_file_that_is_written_is_left_alone(tmp_path: Path) -> None:
    bag = writer(tmp_path / "bag")
    record(bag, 3)
    bag.flush()
    assert "still being written" in complete(bag.path)
    assert unfinished_files(tmp_path) == []
    record(bag, 3)
    bag.close()
    assert len(list(messages(tmp_path / "bag"))) == 6


def test_unfinished_files_of_all_bags_below_a_folder_are_found(tmp_path: Path) -> None:
    path = unfinished_bag(tmp_path / "a" / "bag")
    small_bag(tmp_path / "b" / "bag", count=1)
    assert unfinished_files(tmp_path) == [path]
    resumed(path.parent)[0].close()  # nobody holds the bag after the look


def test_a_bag_of_several_files_is_unfinished_as_long_as_metadata_lacks_one(tmp_path: Path) -> None:
    small_bag(tmp_path / "bag", count=5)
    bag, _ = resumed(tmp_path / "bag")
    assert [one.finished for one in find_bags(tmp_path)] == [False]
    record(bag, 7)
    bag.close()
    assert [(one.finished, one.messages) for one in find_bags(tmp_path)] == [(True, 13)]


def test_a_file_without_a_message_is_removed(tmp_path: Path) -> None:
    path = unfinished_bag(tmp_path / "bag")
    path.write_bytes(path.read_bytes()[: chunk_ends(path)[0] - 5])
    assert "removed" in complete(path)
    assert list((tmp_path / "bag").iterdir()) == []


def test_a_file_with_a_damaged_chunk_is_kept_beside_its_copy(tmp_path: Path) -> None:
    path = unfinished_bag(tmp_path / "bag")
    data = bytearray(path.read_bytes())
    data[chunk_ends(path)[5] - 40] ^= 0xFF
    path.write_bytes(data)
    assert "completed, 161 messages" in complete(path)
    assert is_whole(path)
    assert (tmp_path / "bag" / "bag_0.mcap.damaged").read_bytes() == data


def test_a_copy_that_was_cut_short_before_is_made_anew(tmp_path: Path) -> None:
    path = unfinished_bag(tmp_path / "bag")
    (tmp_path / "bag" / "bag_0.mcap.completed").write_bytes(b"half a copy")
    assert "completed, 181 messages" in complete(path)
    assert [file.name for file in path.parent.iterdir()] == ["bag_0.mcap"]


def test_a_file_that_is_dropped_meanwhile_does_not_come_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = unfinished_bag(tmp_path / "bag")

    def copy_and_drop(source: Path, target: Path) -> object:
        made = copy_of(source, target)
        source.unlink()
        return made

    monkeypatch.setattr(recovery, "copy_of", copy_and_drop)
    assert complete(path) == f"{path}: was left unfinished; dropped meanwhile"
    assert list(path.parent.iterdir()) == []


def test_a_copy_is_made_where_there_is_room_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = unfinished_bag(tmp_path / "bag")
    size, before = path.stat().st_size, path.read_bytes()
    monkeypatch.setattr(recovery, "free_bytes", lambda _folder: size - 1)
    assert "cannot be completed (0 MB are free, 0 MB are wanted for a copy); try" in complete(path)
    assert (path.read_bytes(), list(path.parent.iterdir())) == (before, [path])
    monkeypatch.setattr(recovery, "free_bytes", lambda _folder: size)
    assert "completed, 181 messages" in complete(path)


def test_files_are_completed_beside_the_flight_or_nothing_is_started(tmp_path: Path) -> None:
    assert begin_completion([]) is None
    path = unfinished_bag(tmp_path / "bag")
    completion = begin_completion([path])
    assert completion is not None
    assert completion.wait(60.0) == 0
    assert is_whole(path)


def test_the_process_that_completes_yields_to_the_flight_outlives_ctrl_c_and_indexes_every_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [unfinished_bag(tmp_path / name / "bag") for name in ("a", "b")]
    yields: list[int] = []
    signals: list[tuple[int, object]] = []
    monkeypatch.setattr(os, "nice", yields.append)
    monkeypatch.setattr(signal, "signal", lambda *what: signals.append(what))
    monkeypatch.setattr(sys, "argv", ["completion", *map(str, files)])
    assert main() == 0
    assert yields[0] > 0
    assert signals == [(signal.SIGINT, signal.SIG_IGN)]
    printed = capsys.readouterr().err.splitlines()
    assert printed == [f"{file}: was left unfinished; completed, 181 messages" for file in files]
    for file in files:
        with Reader(file.parent) as reader:
            assert reader.message_count == 181


@pytest.mark.parametrize("content", [bytes(5000), b"no bag at all, by any means"])
def test_what_cannot_be_completed_is_left_as_it_is(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bag_0.mcap"
    path.write_bytes(content)
    assert "cannot be completed" in complete(path)
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_the_budget_counts_and_drops_the_files_of_the_recorder_before(tmp_path: Path) -> None:
    path = unfinished_bag(tmp_path / "bag")
    budget_MB = (path.stat().st_size + 600) / 1e6
    bag, _ = resumed(tmp_path / "bag", BagLimits(budget_MB=budget_MB, when_full="oldest", keep_free_MB=0.0))
    record(bag, 100)
    decisions = bag.flush()
    bag.close()
    assert any("dropped the oldest, bag_0.mcap" in sentence for sentence in decisions)
    assert not path.exists()


def test_a_file_that_is_removed_while_the_bag_is_measured_ends_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process that completes files removes one without messages between their listing and the look at its size."""
    bag = writer(tmp_path / "bag")
    gone = tmp_path / "bag" / "bag_7.mcap"
    for module in (bag_writer, metadata):
        monkeypatch.setattr(module, "parts", lambda folder: [*parts(folder), gone])
    record(bag, 100)
    assert bag.flush() == []
    assert bag.size_bytes == bag.path.stat().st_size
    bag.close()
    assert not bag.stopped
    assert yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())


def test_metadata_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A power cut soon after the recovery left a metadata.yaml of no bytes, in a bag that nobody completes again."""
    small_bag(tmp_path / "bag")
    synced: dict[int, int] = {}
    monkeypatch.setattr(os, "fsync", lambda number: synced.update({os.fstat(number).st_ino: os.fstat(number).st_size}))
    write_metadata(tmp_path / "bag", {})
    found = (tmp_path / "bag" / "metadata.yaml").stat()
    assert found.st_size > 0
    assert synced[found.st_ino] == found.st_size
