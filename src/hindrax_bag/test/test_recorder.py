"""What the recorder finds out about who publishes: type, quality, gaps, and its own file of parameters."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("hindrax_msgs")

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from hindrax_bag.nodes.recorder import PublicationGaps, offered_quality, parameter_file, type_hash
from hindrax_core.topics import SENSOR, Quality


def test_names_of_hashes_and_parameter_files() -> None:
    class Hash:
        version, value = 1, bytes(range(32))

    assert type_hash(Hash()) == "RIHS01_" + bytes(range(32)).hex()
    Hash.version = 0
    assert type_hash(Hash()) == ""
    Hash.version, Hash.value = 1, bytes(32)
    assert type_hash(Hash()) == type_hash(None) == ""
    assert parameter_file(["recorder", "--ros-args", "--params-file", "a.yaml"]) == "a.yaml"
    assert parameter_file(["recorder", "--params-file", "a.yaml", "--params-file", "b.yaml"]) == "b.yaml"
    assert parameter_file(["recorder"]) == ""


def test_offered_quality_is_that_of_the_publisher() -> None:
    offered = SimpleNamespace(
        depth=0, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.TRANSIENT_LOCAL
    )
    offered.deadline = Duration(seconds=0.25)
    offered.lifespan = Duration(seconds=2_147_483_647)
    wanted = Quality(reliable=False, depth=SENSOR.depth, latched=True, deadline_s=0.25)
    assert offered_quality(offered, SENSOR) == wanted


@pytest.mark.parametrize(
    ("publishers", "numbers", "lost"),
    [
        (1, [1, 2, 3], 0),
        (1, [7, 8, 9], 0),  # heard from the middle on
        (1, [1, 2, 5, 6], 2),
        (1, [1, 2, 3, 1, 2, 4], 1),  # begun anew
        (1, [1, 2, 5, 1, 2, 6], 5),  # begun anew after a gap
        (1, [1, 2, 5, 8], 4),
        (2, [5, 4, 6, 5], 0),
        (2, [4, 1, 2, 5, 3, 6, 9, 4], 2),
        (2, [1, 1, 2, 2, 3, 3], 0),
        (2, [5, 6, 9, 7, 10, 8], 0),  # the other began later
    ],
)
def test_gaps_in_the_numbers_are_counted(publishers: int, numbers: list[int], lost: int) -> None:
    gaps = PublicationGaps(lambda: publishers)
    for number in numbers:
        gaps.count(number)
    assert gaps.lost == lost
