"""Measurements out of a bag: each one, in the order of its stamp, however late it was written."""

import struct
from types import SimpleNamespace

import pytest
from mcap.records import Channel, Schema

from hindrax_analysis.records import own_bag
from hindrax_bag.read.bag_reader import MessageDecoder
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.messages.definition import SEPARATOR
from hindrax_core.signals import Phase
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import load_vehicle

DEFINITION = f"""Header header
string motion
string phase
{SEPARATOR}
MSG: hindrax_msgs/Header
Stamp stamp
{SEPARATOR}
MSG: hindrax_msgs/Stamp
int32 sec
uint32 nanosec
"""
FORM = MessageDecoder(
    Channel(1, resolved(MANEUVER), "cdr", {}, 1), Schema(1, DEFINITION.encode(), "ros2msg", MANEUVER.type)
)


def test_what_a_process_published_late_is_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def phase(second: int) -> SimpleNamespace:
        data = struct.pack("<4siII8sI3s", b"\0\1\0\0", second, 0, 6, b"pitch", 3, str(second).encode())
        return SimpleNamespace(topic=resolved(MANEUVER), form=FORM, data=data)

    written = [phase(second) for second in (10, 17, 18, 12, 13, 19)]
    monkeypatch.setattr(own_bag, "messages", lambda _bag, _topics: iter(written))
    found = [one.reading for one in own_bag.bag_events("a bag", load_vehicle(default_vehicle()))]
    assert found == [Phase("pitch", second) for second in ("10", "12", "13", "17", "18", "19")]
