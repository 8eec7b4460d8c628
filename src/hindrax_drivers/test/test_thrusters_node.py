"""What the node makes of the bytes of a command, without its thread and without a graph."""

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from rclpy.serialization import serialize_message

from hindrax_core.events import Stamp
from hindrax_drivers.nodes.thrusters_node import ThrustersNode
from hindrax_drivers.output.output_guard import Command
from hindrax_msgs.msg import ThrusterCommand


def heard(data: bytes, unfit: str = "") -> tuple[list[Command], list[str]]:
    """Commands that reach the guard, and reasons of refusals; `unfit`: why their sender is not obeyed."""
    commands: list[Command] = []
    refused: list[str] = []
    node: Any = SimpleNamespace(
        _thread=SimpleNamespace(now=Stamp(5), command=commands.append),
        _unfit_sender=lambda: unfit,
        refused=lambda refusal, _stamp: refused.append(refusal.reason),
    )
    ThrustersNode._on_command(node, data)  # the callback of its subscription
    return commands, refused


def test_a_command_reaches_the_guard_with_its_lights_apart() -> None:
    message = ThrusterCommand(sequence=7, pulses=[1500.0, 1600.0], lights=[1100.0])
    message.header.stamp.sec = 3
    assert heard(bytes(serialize_message(message))) == (
        [Command((1500.0, 1600.0), (1100.0,), Stamp(3_000_000_000), 7)],
        [],
    )


def test_a_command_of_a_sender_that_is_not_obeyed_does_not_reach_the_guard() -> None:
    message = ThrusterCommand(sequence=7, pulses=[1500.0], lights=[])
    assert heard(bytes(serialize_message(message)), unfit="two publish") == ([], ["sender"])


@pytest.mark.parametrize(
    "data", [b"", b"\x00\x00" + bytes(60), b"\x00\x01" + bytes(6)], ids=["none", "big endian", "short"]
)
def test_bytes_that_are_no_command_are_refused_and_end_nothing(data: bytes) -> None:
    assert heard(data) == ([], ["not a command"])
