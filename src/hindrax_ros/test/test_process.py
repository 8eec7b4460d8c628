"""What a process has behind it when its loop begins; on loopback, in a domain apart."""

import gc
import inspect
import os
import signal

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.process import spin


class Curious(BatchedNode):
    """Looks around in its first turn, then asks to stop."""

    def __init__(self) -> None:
        super().__init__("curious")
        self.found: list[tuple[bool, bool]] = []

    def drain(self) -> None:
        """Note whether modules have been looked up, and whether the collector passes over what is there."""
        self.found.append((bool(inspect.modulesbyfile), gc.get_freeze_count() > 0))
        os.kill(os.getpid(), signal.SIGTERM)


def test_what_is_slow_once_is_done_before_the_first_turn(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setattr(inspect, "modulesbyfile", {})
    monkeypatch.setattr(inspect, "_filesbymodname", {})
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    made: list[Curious] = []

    def make() -> list[Curious]:
        made.append(Curious())
        return made

    try:
        assert spin(make, ["curious"]) == 0
    finally:
        gc.unfreeze()
        for number, handler in kept.items():
            signal.signal(number, handler)
    assert made[0].found == [(True, True)]
