"""The launch file of a replay: the record, and the nodes that compute on it."""

import pytest

pytest.importorskip("rclpy", reason="the words of the replay are read from its process, which imports rclpy")

from deployment.test_launch_files import executed, pairs, processes, scripts_of, stand_in, words_of

from hindrax_bringup.processes import CONTROL, IDENTIFIER, PILOT_STATUS_ASIDE, REPLAY, SENSORS
from hindrax_sim.nodes.replay import parser

__all__ = ["stand_in"]


@pytest.mark.usefixtures("stand_in")
def test_a_replay_is_a_record_on_the_nodes_that_compute() -> None:
    found = executed("replay", bag="runs/today/bag")
    assert processes(found) == pairs((SENSORS, CONTROL, IDENTIFIER, REPLAY))
    words = parser().parse_args(words_of(found))
    assert (str(words.bag), words.rate) == ("runs/today/bag", 1.0)
    (control,) = (one for one in found if one.kind == "Node" and one.keywords["executable"] == CONTROL.name)
    assert control.keywords["ros_arguments"][-2:] == PILOT_STATUS_ASIDE


def test_it_is_an_executable_of_its_package() -> None:
    assert scripts_of(REPLAY.package)[REPLAY.name] == f"{REPLAY.module}:main"
