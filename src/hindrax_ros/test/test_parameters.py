"""Parameters that no node declares: each gets a warning with the name that was probably meant."""

import os
import signal
from collections.abc import Sequence
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.parameters import unknown_parameters
from hindrax_ros.process import spin

DECLARED = ("use_sim_time", "pool_bounds.start_along", "guards.wall_m", "holds.turn_radps")


@pytest.mark.parametrize(
    ("given", "hint"),
    [
        ("box.start_along", "; it is called pool_bounds.start_along now"),
        ("safety.wall_m", "; it is called guards.wall_m now"),
        ("holds.turn_rads", "; the nearest is holds.turn_radps"),
        ("box.nothing_like_it", ""),
        ("xyz", ""),
    ],
)
def test_an_unknown_parameter_is_named_with_the_one_meant(given: str, hint: str) -> None:
    found = unknown_parameters("pilot", ["use_sim_time", given], DECLARED)
    assert found == [f"parameter {given!r} of pilot: unknown, ignored{hint}"]


def test_declared_parameters_are_not_unknown() -> None:
    assert unknown_parameters("pilot", DECLARED, DECLARED) == []


@pytest.mark.parametrize("given", ["guards.wall_m", "safety.wall_m"])
def test_an_argument_of_the_process_is_left_to_the_node_that_declares_it(given: str) -> None:
    assert unknown_parameters("allocator", [given], ["use_sim_time"], elsewhere=DECLARED) == []


class Brief(BatchedNode):
    """Declares one parameter, stops in its first turn, and keeps what it logs."""

    def __init__(self) -> None:
        super().__init__("pilot")
        self.declare_parameter("guards.wall_m", 0.3)
        self.warned: list[str] = []

    def get_logger(self) -> Any:
        """Collect warnings."""
        return self

    def warning(self, sentence: str) -> None:
        """Keep one."""
        self.warned.append(sentence)

    def drain(self) -> None:
        """Ask to stop."""
        os.kill(os.getpid(), signal.SIGTERM)


def test_a_process_warns_when_it_begins_to_spin(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    words = ["pilot", "--ros-args", "-p", "safety.wall_m:=0.5", "-p", "guards.wall_m:=0.4"]
    made: list[Brief] = []

    def make() -> Sequence[Brief]:
        made.append(Brief())
        return made

    try:
        assert spin(make, words) == 0
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
    assert made[0].warned == [
        "parameter 'safety.wall_m' of pilot: unknown, ignored; it is called guards.wall_m now",
    ]
