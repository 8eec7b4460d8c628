"""metadata.yaml of a bag, in the words of rosbag2."""

from collections import Counter
from typing import Any

import yaml

from hindrax_bag.metadata import Contents, metadata_text, qos_map
from hindrax_bag.testing.bag_samples import LEVEL, WORD
from hindrax_core.topics import Quality

EARLY = Contents("bag_0.mcap", Counter({LEVEL.topic: 3}), 1_000, 4_000, (LEVEL,))
LATE = Contents("bag_1.mcap", Counter({LEVEL.topic: 1, WORD.topic: 1}), 6_000, 9_500, (LEVEL, WORD))
EMPTY = Contents("bag_2.mcap")


def information(*files: Contents) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(metadata_text(files))["rosbag2_bagfile_information"]
    return found


def test_a_bag_lasts_from_its_first_message_to_its_last_over_all_files() -> None:
    found = information(EARLY, LATE, EMPTY)
    assert found["starting_time"]["nanoseconds_since_epoch"] == 1_000
    assert found["duration"]["nanoseconds"] == 8_500
    assert found["message_count"] == 5
    assert [one["message_count"] for one in found["topics_with_message_count"]] == [4, 1]
    assert [one["duration"]["nanoseconds"] for one in found["files"]] == [3_000, 3_500, 0]
    assert [one["starting_time"]["nanoseconds_since_epoch"] for one in found["files"]] == [1_000, 6_000, 0]
    assert [one["message_count"] for one in found["files"]] == [3, 2, 0]
    assert found["relative_file_paths"] == [one["path"] for one in found["files"]]


def test_a_bag_without_a_message_lasts_no_time() -> None:
    found = information(EMPTY)
    assert (found["duration"]["nanoseconds"], found["starting_time"]["nanoseconds_since_epoch"]) == (0, 0)


def test_no_limit_is_the_longest_duration_of_the_middleware() -> None:
    # RMW_DURATION_INFINITE of rmw/time.h: the largest number of nanoseconds in 64 bits.
    found = qos_map(Quality(deadline_s=1.25))
    for name in ("lifespan", "liveliness_lease_duration"):
        assert found[name]["sec"] * 10**9 + found[name]["nsec"] == 2**63 - 1
    assert found["deadline"] == {"sec": 1, "nsec": 250_000_000}
    assert found["avoid_ros_namespace_conventions"] is False
