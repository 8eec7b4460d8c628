"""The launch file of a replay: the record, and the nodes that compute on it."""

import pytest

pytest.importorskip("rclpy", reason="the words of the replay are read from its process, which imports rclpy")

from deployment.test_launch_files import executed, options_of, scripts_of, stand_in

from hindrax_bringup.processes import REPLAY
from hindrax_bringup.stack import ReplayOptions
from hindrax_sim.nodes.replay import parser

__all__ = ["stand_in"]


@pytest.mark.usefixtures("stand_in")
def test_a_replay_is_a_record_in_place_of_a_vehicle() -> None:
    options = options_of(executed("replay", bag="runs/today/bag"))
    assert options.hardware == options.replay == ReplayOptions("runs/today/bag", 1.0)
    words = parser().parse_args(options.replay.words())
    assert (str(words.bag), words.rate) == ("runs/today/bag", 1.0)


def test_it_is_an_executable_of_its_package() -> None:
    assert scripts_of(REPLAY.package)[REPLAY.name] == f"{REPLAY.module}:main"
