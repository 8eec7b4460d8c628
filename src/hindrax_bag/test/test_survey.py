"""What a bag holds, and a list of bags, over files written by the `mcap` package."""

from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer

from hindrax_bag.metadata import NAME
from hindrax_bag.read import survey as module
from hindrax_bag.read.survey import ListedBag, find_bags, survey
from hindrax_core.errors import UsageError

START = 1_700_000_000_000_000_000
TIMES_S = {"/a": (1.0, 0.0, 2.0, 3.0), "/b": (2.5,)}


def written(folder: Path, name: str = "bag_0.mcap", *, finish: bool = True) -> Path:
    folder.mkdir(exist_ok=True)
    file = folder / name
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        for topic, times in TIMES_S.items():
            channel = writer.register_channel(topic, "cdr", schema)
            for time_s in times:
                at = START + round(time_s * 1e9)
                writer.add_message(channel, at, bytes(5), at)
        if finish:
            writer.finish()  # type: ignore[no-untyped-call]
    return file


def described(folder: Path, *files: str) -> None:
    metadata = {"relative_file_paths": [*files], "duration": {"nanoseconds": 4_500_000_000}, "message_count": 7}
    (folder / NAME).write_text(yaml.safe_dump({"rosbag2_bagfile_information": metadata}))


def test_a_bag_is_counted_topic_by_topic_from_the_first_message_to_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, progress = written(tmp_path / "bag"), list[int]()
    monkeypatch.setattr(module, "EVERY", 2)
    found = survey(tmp_path / "bag", progress.append)
    assert progress == [2, 4]
    assert (found.first, found.last, found.seconds, found.messages) == (START, START + 3 * 10**9, 3.0, 5)
    document = found.document()
    assert document["topics"] == {
        "/a": {"type": "std_msgs/msg/Empty", "count": 4, "bytes": 20, "rate_Hz": 1.33},
        "/b": {"type": "std_msgs/msg/Empty", "count": 1, "bytes": 5, "rate_Hz": 0.33},
    }
    assert document["bytes"] == file.stat().st_size
    assert document["files"] == ["bag_0.mcap"]
    assert (document["finished"], document["damage"], document["seconds"]) == (True, [], 3.0)


def test_a_bag_of_one_moment_has_no_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TIMES_S, "/a", (2.5,))
    written(tmp_path / "bag")
    found = survey(tmp_path / "bag")
    assert found.seconds == 0.0
    assert {found.rate_Hz(one) for one in found.topics.values()} == {0.0}


def test_a_bag_of_no_message_lasts_no_time(tmp_path: Path) -> None:
    (tmp_path / "bag_0.mcap").write_bytes(b"")
    found = survey(tmp_path)
    assert (found.first, found.last, found.seconds, found.messages) == (0, 0, 0.0, 0)


def test_bags_are_listed_with_what_their_metadata_or_their_last_file_states(tmp_path: Path) -> None:
    sizes = {}
    for name in ("a", "b", "c", "d", "e"):
        sizes[name] = written(tmp_path / name, finish=name != "d").stat().st_size
    described(tmp_path / "a", "bag_0.mcap")
    described(tmp_path / "b", "other.mcap")
    (tmp_path / "e" / "bag_0.mcap").write_bytes(b"SQLite format 3\0 and more")
    sizes["e"] = 25
    (tmp_path / "f").mkdir()
    (tmp_path / "f" / "bag_0.mcap").write_bytes(b"something else")
    (tmp_path / "g").mkdir()
    (tmp_path / "g" / "bag_0.mcap").write_bytes(b"")
    whole, cut = f"no {NAME}: bag info reads it", "unfinished: bag recover"
    assert find_bags(tmp_path) == [
        ListedBag(tmp_path / "a", sizes["a"], True, 4.5, 7),
        ListedBag(tmp_path / "b", sizes["b"], False, 0.0, 0, cut),
        ListedBag(tmp_path / "c", sizes["c"], True, 0.0, 0, whole),
        ListedBag(tmp_path / "d", sizes["d"], False, 0.0, 0, cut),
        ListedBag(tmp_path / "e", sizes["e"], True, 0.0, 0, whole),
        ListedBag(tmp_path / "f", 14, False, note="bag_0.mcap is no bag"),
        ListedBag(tmp_path / "g", 0, False, note=cut),
    ]


def test_the_last_file_states_whether_a_bag_of_several_is_finished(tmp_path: Path) -> None:
    first, last = written(tmp_path / "a", "bag_0.mcap"), written(tmp_path / "a", "bag_1.mcap", finish=False)
    (found,) = find_bags(tmp_path)
    assert (found.finished, found.bytes) == (False, first.stat().st_size + last.stat().st_size)


def test_bags_are_sought_in_folders(tmp_path: Path) -> None:
    assert find_bags(tmp_path) == []
    with pytest.raises(UsageError, match="nowhere: is no folder"):
        find_bags(tmp_path / "nowhere")
