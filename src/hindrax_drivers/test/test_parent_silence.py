"""When the dead man counts as silent: by both clocks, never by one that stands still or leaps."""

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from hindrax_core.events import after, stamp_from_s
from hindrax_drivers.nodes.thruster_settings import KEEPALIVE_S
from hindrax_drivers.nodes.thrusters_node import SILENT_S, SILENT_WALL_S, ParentSilence

START = stamp_from_s(100.0)


@pytest.mark.parametrize(
    ("output_s", "wall_s", "silent"),
    [
        (0.9, 0.9, False),
        (1.0, 0.9, True),
        (1.0, 0.7, False),  # a mock that runs faster than the wall
        (0.0, 60.0, False),  # a mock that stands still
        (3600.0, 0.1, False),  # the system's clock is set
        (-3600.0, 0.1, False),
        (-3600.0, 0.9, True),  # set back, and silent
    ],
)
def test_both_clocks_must_tell(output_s: float, wall_s: float, silent: bool) -> None:
    silence = ParentSilence(START, 50.0)
    assert silence.silent(after(START, output_s), 50.0 + wall_s) is silent


def test_a_word_ends_the_silence() -> None:
    silence = ParentSilence(START, 50.0)
    later = after(START, 5.0)
    silence.on_beat(later, 55.0)
    assert not silence.silent(after(later, 0.9), 55.9)
    assert silence.silent(after(later, 1.0), 56.0)


def test_two_words_in_a_row_may_be_late_or_lost() -> None:
    assert min(SILENT_S, SILENT_WALL_S) >= 3 * KEEPALIVE_S
