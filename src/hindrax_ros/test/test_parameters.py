"""Parameters that no node declares: each gets a warning with the name that was probably meant."""

import contextlib
import os
import re
import signal
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

import rclpy
import yaml
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file

from hindrax_core.errors import UsageError
from hindrax_core.knobs import knob
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.parameters import SAFETY, CheckedNode, CheckedParameterService, knobs, unknown_parameters
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
        signal.alarm(0)
        for number, handler in kept.items():
            signal.signal(number, handler)
    assert made[0].warned == [
        "parameter 'safety.wall_m' of pilot: unknown, ignored; it is called guards.wall_m now",
    ]


@dataclass(frozen=True, slots=True)
class Inner:
    gain: float = knob(1.0, 0.0, 10.0, "a gain [-]")
    limit: float = knob(2.0, 0.0, 10.0, "a limit [N]")


@dataclass(frozen=True, slots=True)
class Outer:
    """Knobs as a node has them."""

    inner: Inner = field(default_factory=Inner)
    count: int = knob(3, 0, 9, "a count [-]")
    steps: tuple[float, ...] = knob((1.0, 2.0), 0.0, 100.0, "steps [m]")
    rest_us: float | None = knob(None, 0.0, 2000.0, "pulse at rest; none: by the vehicle file [us]")

    def __post_init__(self) -> None:
        """Refuse what fits only one by one."""
        if self.inner.gain > self.inner.limit:
            raise ValueError(f"gain: found {self.inner.gain:g}, wanted at most the limit ({self.inner.limit:g})")


@contextlib.contextmanager
def tuned_node(*words: str) -> Iterator[tuple[CheckedNode, list[Outer]]]:
    """A node of its own context with these parameters, and every instance of its knobs so far."""
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", *(word for one in words for word in ("-p", one))], context=context)
    node, seen = CheckedNode("pilot", context=context, enable_rosout=False), list[Outer]()
    try:
        seen.append(knobs(node, Outer, seen.append, fixed={"inner.limit": SAFETY}))
        yield node, seen
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def asked(node: CheckedNode, **wanted: Any) -> str:
    """Ask as `ros2 param set` does, whole numbers as integers; returns the reason of a refusal."""
    service = CheckedParameterService.__new__(CheckedParameterService)
    service._get_node = lambda: node
    messages = [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in wanted.items()]
    return str(service._set(messages).reason)


@pytest.fixture
def _alone(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))


@pytest.mark.usefixtures("_alone")
def test_a_whole_number_is_a_float_where_one_is_wanted_at_start_and_later() -> None:
    with tuned_node("inner.gain:=2", "steps:=[3, 4]") as (node, seen):
        assert seen[0] == Outer(Inner(2.0), steps=(3.0, 4.0))
        assert isinstance(node.get_parameter("inner.gain").value, float)
        assert asked(node, inner__gain=1, steps=[5, 6]) == ""
        assert seen[1:] == [Outer(Inner(1.0), steps=(5.0, 6.0))]


@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize(
    ("word", "value"), [("count:=3", None), ("rest_us:=''", None), ("rest_us:=0", 0.0), ("rest_us:=1500.0", 1500.0)]
)
def test_not_set_is_none_and_every_number_that_is_given_is_the_users(word: str, value: float | None) -> None:
    with tuned_node(word) as (node, seen):
        assert seen == [Outer(rest_us=value)]
        assert node.get_parameter("rest_us").value == value
        assert asked(node, rest_us=7) == asked(node, count=4) == ""
        assert seen[-1] == Outer(count=4, rest_us=7.0)


@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("inner.gain:=fast", "pilot.inner.gain: found 'fast', wanted a number"),
        ("inner.gain:=11.0", "pilot.inner.gain: found 11, wanted 0 to 10"),
        ("rest_us:=2500.0", "pilot.rest_us: found 2500, wanted 0 to 2000"),
        ("rest_us:=fast", "pilot.rest_us: found 'fast', wanted a number"),
        ("count:=2.5", "pilot.count: found 2.5, wanted a whole number"),
        ("inner.gain:=3.0", "gain: found 3, wanted at most the limit"),
    ],
)
def test_a_wrong_parameter_costs_one_sentence(word: str, why: str) -> None:
    with pytest.raises(UsageError, match=re.escape(why)), tuned_node(word):
        pass


@pytest.mark.usefixtures("_alone")
def test_what_cannot_change_or_does_not_fit_is_refused_with_the_reason_and_changes_nothing() -> None:
    with tuned_node() as (node, seen):
        assert asked(node, inner__limit=3.0) == f"inner.limit: fixed at start, since {SAFETY}; restart the node"
        assert "wanted at most the limit" in asked(node, inner__gain=5.0)
        assert "range" in asked(node, inner__gain=11.0)
        assert "type" in asked(node, count="three").lower()
        assert seen == [Outer()]
        assert node.get_parameter("inner.gain").value == 1.0


@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize("word", ["steps:=[0.00001, 3.0]", "inner.gain:=0.00001", "inner.limit:=3.0"])
def test_a_dump_of_what_is_loads_and_changes_nothing(word: str, tmp_path: Path) -> None:
    with tuned_node(word) as (node, seen):
        node.declare_parameter("odd", float("nan"))
        node.declare_parameter("empty", [])
        values = {name: node.get_parameter(name).value for name in node.get_parameters_by_prefix("")}
        plain = {name: list(one) if isinstance(one, Sequence) else one for name, one in values.items()}
        file = tmp_path / "dump.yaml"
        file.write_text(yaml.safe_dump({"/pilot": {"ros__parameters": plain}}))
        service = CheckedParameterService.__new__(CheckedParameterService)
        service._get_node = lambda: node
        for name, message in parameter_dict_from_yaml_file(str(file)).items():
            assert (name, service._set([message]).reason) == (name, "")
        assert len(seen) == 1
        assert asked(node, inner__limit=2.5).startswith("inner.limit: fixed at start")
        assert asked(node, use_sim_time=True).startswith("use_sim_time: fixed at start")
