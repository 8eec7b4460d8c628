"""Measurements out of a bag: each one, in the order of its stamp, however late it was written."""

import types
from types import SimpleNamespace

import pytest

from hindrax_analysis.records import own_bag
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.signals import Phase
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import load_vehicle


def test_what_a_process_said_late_is_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def phase(second: int) -> types.SimpleNamespace:
        stamp = SimpleNamespace(sec=second, nanosec=0)
        told = SimpleNamespace(header=SimpleNamespace(stamp=stamp), motion="pitch", phase=str(second))
        return SimpleNamespace(topic=resolved(MANEUVER), decoded=lambda: told)

    written = [phase(second) for second in (10, 17, 18, 12, 13, 19)]
    monkeypatch.setattr(own_bag, "messages", lambda _bag, _topics: iter(written))
    found = [one.reading for one in own_bag.bag_events("a bag", load_vehicle(default_vehicle()))]
    assert found == [Phase("pitch", second) for second in ("10", "12", "13", "17", "18", "19")]
