"""Measurements out of a bag: each one, in the order of its stamp, however late it was written."""

from types import SimpleNamespace

from hindrax_bringup import events
from hindrax_core.topics import MANEUVER, resolved


def test_what_a_process_said_late_is_not_left_out(monkeypatch):
    def phase(second):
        stamp = SimpleNamespace(sec=second, nanosec=0)
        told = SimpleNamespace(header=SimpleNamespace(stamp=stamp), motion="pitch", phase=str(second))
        return SimpleNamespace(topic=resolved(MANEUVER), decoded=lambda: told)

    written = [phase(second) for second in (10, 17, 18, 12, 13, 19)]
    monkeypatch.setattr(events, "messages", lambda _bag, _topics: iter(written))
    found = [one.reading.phase for one in events.bag_measurements("a bag")]
    assert found == ["10", "12", "13", "17", "18", "19"]
