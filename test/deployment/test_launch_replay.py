"""The launch file of a replay: the record, and the nodes that compute on it."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="the words of the replay are read from its process, which imports rclpy")

from deployment.test_launch_files import ROOT, described, pairs, processes, scripts_of, stand_in, words_of

from hindrax_bringup.processes import CONTROL, IDENTIFIER, REPLAY, SENSORS, UNHEARD
from hindrax_sim.nodes.replay import parser


def test_a_replay_is_a_record_on_the_nodes_that_compute(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch)
    found = described(ROOT / "src/hindrax_bringup/launch/replay.launch.py")
    assert processes(found) == pairs((SENSORS, CONTROL, IDENTIFIER, REPLAY))
    assert parser().parse_args(words_of(found)).rate == 1.0
    (control,) = (one for one in found if one.kind == "Node" and one.keywords["executable"] == CONTROL.executable)
    assert control.keywords["ros_arguments"] == UNHEARD


def test_it_is_an_executable_of_its_package() -> None:
    assert scripts_of(REPLAY.package)[REPLAY.executable] == f"{REPLAY.module}:main"
