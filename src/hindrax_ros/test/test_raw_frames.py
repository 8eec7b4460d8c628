"""Raw frames in batches; the first waits for its recorder."""

from typing import Any, cast

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from hindrax_core.bus_operations import frames_in
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_msgs.msg import RawFrames
from hindrax_ros import raw_frames
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.fast_serialization import raw_frames_bytes
from hindrax_ros.raw_frames import READER_WAIT_S, FrameTap

STEP_ns = NS_PER_S // 100


class Wire:
    """Publisher with a given number of subscribers."""

    def __init__(self) -> None:
        self.subscribers = 0
        self.sent: list[Any] = []

    def publish(self, data: bytes) -> None:
        self.sent.append(deserialize_message(data, RawFrames))

    def get_subscription_count(self) -> int:
        return self.subscribers


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    made = Wire()
    monkeypatch.setattr(raw_frames, "publisher", lambda _node, _topic: made)
    return made


def stamps_of(messages: list[Any]) -> list[int]:
    return [stamp for message in messages for stamp, _, _ in frames_in(message)]


def test_no_frame_before_the_first_subscriber_is_lost(wire: Wire) -> None:
    tap, stamps = FrameTap(cast("Node", None), "dvl75"), [Stamp(STEP_ns * turn) for turn in range(1, 301)]
    for stamp in stamps[:200]:
        tap.add(stamp, False, b"x")
    assert not wire.sent
    wire.subscribers = 1
    for stamp in stamps[200:]:
        tap.add(stamp, False, b"x")
    wire.subscribers = 0  # a recorder that was restarted is the supervisor's matter: frames go on
    tap.flush()
    assert stamps_of(wire.sent) == stamps
    assert len(wire.sent) > 5


def test_without_a_recorder_frames_are_not_kept(wire: Wire) -> None:
    tap = FrameTap(cast("Node", None), "dvl75")
    for turn in range(round(2 * READER_WAIT_S * 100)):
        tap.add(Stamp(STEP_ns * (turn + 1)), False, b"x")
    assert len(wire.sent[-1].stamps) < 20


frames = st.lists(st.tuples(st.integers(0, 2**64 - 1), st.sampled_from([0, 1]), st.binary(max_size=20)), min_size=1)


@given(st.integers(0, 2**31 * NS_PER_S - 1), st.text("abc", max_size=9), frames)
def test_a_batch_in_bytes_is_the_message(stamp: int, source: str, batch: list[tuple[int, int, bytes]]) -> None:
    stamps, directions, parts = zip(*batch, strict=True)
    lengths, data = [len(part) for part in parts], b"".join(parts)
    message = RawFrames(source=source, stamps=stamps, directions=bytes(directions), lengths=lengths, data=data)
    message.header.stamp = stamp_to_msg(Stamp(stamp))
    found = raw_frames_bytes(
        Stamp(stamp), source, stamps=stamps, directions=bytes(directions), lengths=lengths, data=data
    )
    assert deserialize_message(found, RawFrames) == message
    assert len(found) == len(serialize_message(message))
