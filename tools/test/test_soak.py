"""The soak judges growth after the warm-up and pauses of the control cycle."""

import struct
from pathlib import Path

import pytest

from hindrax_bag.metadata import Channel
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import THRUSTER_COMMAND, resolved
from hindrax_tools.soak import findings, pauses_s

STEADY = [0.02] * 3


def test_pauses_are_those_of_the_stamps_the_longest_first(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "bag", lambda *_: "std_msgs/Header header\n", BagLimits(keep_free_MB=0.0))
    bag.open()
    command = Channel(resolved(THRUSTER_COMMAND), "demo_msgs/msg/Command")
    other = Channel("/hindrax/other", "demo_msgs/msg/Command")
    for channel, sent_ms in ((command, 0), (command, 20), (other, 30), (command, 170), (command, 190)):
        data = b"\x00\x01\x00\x00" + struct.pack("<iI", 7, sent_ms * 1_000_000)
        bag.write(channel, data, 9 * NS_PER_S, 9 * NS_PER_S)
    bag.close()
    assert pauses_s(tmp_path / "bag") == pytest.approx([0.15, 0.02, 0.02])


@pytest.mark.parametrize(("end_MB", "good"), [(104.9, True), (105.1, False)])
def test_growth_counts_from_the_tenth_minute(end_MB: float, good: bool) -> None:
    seen = [{"recorder": 40.0}] * 9 + [{"recorder": 100.0}] * 50 + [{"recorder": end_MB}]
    (memory, of_memory), (_, of_cycle) = findings(seen, STEADY)
    assert (of_memory, of_cycle) == (good, True)
    assert memory.split() == ["recorder", "100.0", "MB", f"{end_MB}", "MB", f"{end_MB / 100.0 - 1.0:+.1%}"]


@pytest.mark.parametrize("pauses", [[0.101, 0.02], []])
def test_a_pause_of_the_cycle_is_bad_and_so_is_a_record_without_any(pauses: list[float]) -> None:
    *_, (_, good) = findings([{"recorder": 40.0}], pauses)
    assert not good
