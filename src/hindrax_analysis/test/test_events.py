"""Measurements out of a bag: each one, in the order of its stamp, however late it was written."""

from types import SimpleNamespace

import pytest

from hindrax_analysis.records import own_bag
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.signals import Phase
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import ManeuverStatus
from hindrax_ros.messages.serialization import serialized


def test_what_a_process_published_late_is_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def phase(second: int) -> SimpleNamespace:
        status = ManeuverStatus(motion="pitch", phase=str(second))
        status.header.stamp.sec = second
        return SimpleNamespace(topic=resolved(MANEUVER), form=SimpleNamespace(old=False), data=serialized(status))

    written = [phase(second) for second in (10, 17, 18, 12, 13, 19)]
    monkeypatch.setattr(own_bag, "messages", lambda _bag, _topics: iter(written))
    found = [one.reading for one in own_bag.bag_events("a bag", load_vehicle(default_vehicle()))]
    assert found == [Phase("pitch", second) for second in ("10", "12", "13", "17", "18", "19")]
