"""Nodes that empty their subscriptions in loop, and messages that go out together; on loopback, in a domain apart."""

import time
from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest

from hindrax_ros.batched_node import DeferredPublisher

pytest.importorskip("rclpy", reason="needs the ROS environment")

import rclpy
from rclpy.context import Context
from rclpy.qos import ReliabilityPolicy

from hindrax_core.topics import BATTERY, HOLD_STATUS, ODOMETRY, THRUSTER_COMMAND
from hindrax_msgs.msg import HoldStatus, ThrusterCommand
from hindrax_ros.batched_node import IDLE_TURN_S, TURN_S, BatchedNode, PublishQueue, SpinLoop, events_executor
from hindrax_ros.graph import publisher, subscription


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> Iterator[Context]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    made = Context()
    rclpy.init(context=made, domain_id=ros_domain)
    yield made
    rclpy.try_shutdown(context=made)


@pytest.fixture
def node(context: Context) -> Iterator[BatchedNode]:
    made = BatchedNode("tested", context=context)
    yield made
    made.destroy_node()


def wait_for(done: Callable[[], bool], seconds: float = 10.0, turn: Callable[[], None] = lambda: None) -> None:
    deadline = time.monotonic() + seconds
    turn()
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.01)
        turn()


def publish(out: DeferredPublisher, number: int) -> None:
    out.publish(ThrusterCommand(sequence=number))


def test_nothing_goes_out_before_the_flush_and_nothing_comes_in_before_the_drain(node: BatchedNode) -> None:
    received = []
    out = publisher(node, HOLD_STATUS)
    subscription(node, HOLD_STATUS, lambda message: received.append(list(message.axes)))
    wait_for(lambda: out.get_subscription_count() == 1)
    for name in ("one", "two", "three"):
        out.publish(HoldStatus(axes=[name]))
    time.sleep(0.2)
    node.drain()
    assert not received
    node.publish_queue.flush()
    time.sleep(0.2)
    assert not received
    node.drain()
    assert received == [["one"], ["two"], ["three"]]


def test_a_held_message_is_what_it_was_when_it_was_published(node: BatchedNode) -> None:
    received = []
    out = publisher(node, HOLD_STATUS)
    subscription(node, HOLD_STATUS, lambda message: received.append(list(message.axes)))
    wait_for(lambda: out.get_subscription_count() == 1)
    message = HoldStatus(axes=["before"])
    out.publish(message)
    message.axes = ["after"]
    node.publish_queue.flush()
    wait_for(lambda: bool(received), turn=node.drain)
    assert received == [["before"]]


def test_of_commands_only_the_newest_waits(node: BatchedNode) -> None:
    received = []
    out = publisher(node, THRUSTER_COMMAND, held=False)
    subscription(node, THRUSTER_COMMAND, lambda message: received.append(message.sequence))
    wait_for(lambda: out.get_subscription_count() == 1)
    for number in range(5):
        publish(out, number)
    time.sleep(0.2)
    node.drain()
    assert received == [4]


def test_the_lead_begins_a_turn(node: BatchedNode, context: Context) -> None:
    received = []
    node.lead = subscription(node, THRUSTER_COMMAND, lambda message: received.append(message.sequence))
    subscription(node, BATTERY, received.append)
    executor = events_executor(context)
    executor.add_node(node)
    loop = SpinLoop([node], executor)
    out = publisher(node, THRUSTER_COMMAND, held=False)
    wait_for(lambda: out.get_subscription_count() == 1)
    loop.spin_once()  # nobody leads: it ends by itself
    assert not received
    publish(out, 7)
    wait_for(lambda: bool(received), turn=loop.spin_once)
    assert received == [7]
    executor.shutdown()


def test_an_error_in_a_callback_is_not_swallowed(node: BatchedNode) -> None:
    out = publisher(node, THRUSTER_COMMAND, held=False)

    def fail(_message: Any) -> None:
        raise ZeroDivisionError

    subscription(node, THRUSTER_COMMAND, fail)
    wait_for(lambda: out.get_subscription_count() == 1)
    publish(out, 1)
    with pytest.raises(ZeroDivisionError):
        wait_for(lambda: False, 5.0, turn=node.drain)


def test_one_outbox_serves_several_senders() -> None:
    publish_queue, sent = PublishQueue(), []
    publish_queue.add(lambda data: sent.append(("a", data)), b"1")
    publish_queue.add(lambda data: sent.append(("b", data)), b"2")
    assert not sent
    publish_queue.flush()
    assert sent == [("a", b"1"), ("b", b"2")]
    publish_queue.flush()
    assert len(sent) == 2


def test_what_follows_the_flush_of_a_thread_waits_for_its_next_one_or_for_the_next_turn(
    node: BatchedNode, context: Context
) -> None:
    executor = events_executor(context)
    loop, sent = SpinLoop([node], executor), list[bytes]()
    node.publish_queue.add(sent.append, b"1")
    loop.flush()
    assert sent == [b"1"]
    node.publish_queue.add(sent.append, b"2")
    node.publish_queue.flush()
    node.publish_queue.add(sent.append, b"3")
    loop.flush()
    assert sent == [b"1", b"2"]
    loop.flush()
    assert sent == [b"1", b"2", b"3"]
    executor.shutdown()


def test_a_subscription_made_or_destroyed_between_two_reads_counts_at_the_next(node: BatchedNode) -> None:
    received: list[Any] = []
    out = publisher(node, THRUSTER_COMMAND, held=False)
    node.drain()
    one = subscription(node, THRUSTER_COMMAND, received.append)
    wait_for(lambda: out.get_subscription_count() == 1)
    publish(out, 1)
    wait_for(lambda: len(received) == 1, turn=node.drain)
    node.destroy_subscription(one)
    publish(out, 2)
    node.drain()
    assert len(received) == 1


def test_only_a_process_that_reads_nothing_and_leaves_sending_to_a_thread_turns_rarely(context: Context) -> None:
    waits: list[float] = []

    class Executor:
        def spin_once(self, timeout_sec: float) -> None:
            waits.append(timeout_sec)

    node = BatchedNode("c", context=context, ros_time=False)
    loop = SpinLoop([node], cast(Any, Executor()))
    loop.spin_once()  # nobody else has flushed
    loop.spin_once()
    node.publish_queue.flush()
    loop.spin_once()
    loop.spin_once()
    subscription(node, BATTERY, print)
    node.publish_queue.flush()
    loop.spin_once()
    loop.spin_once()
    assert waits == [TURN_S, TURN_S, TURN_S, IDLE_TURN_S, TURN_S, TURN_S]
    node.destroy_node()


def test_without_ros_time_no_clock_is_read(context: Context) -> None:
    with_time, without = BatchedNode("a", context=context), BatchedNode("b", context=context, ros_time=False)
    assert not without.get_parameter("use_sim_time").value
    assert with_time.has_parameter("use_sim_time")
    for one in (with_time, without):
        one.destroy_node()


def test_what_comes_by_call_is_not_read_from_the_graph_unless_a_remap_separates_the_ends(context: Context) -> None:
    remaps = ["--ros-args", "-r", "apart:holds/status:=elsewhere"]
    made = [BatchedNode(name, context=context, cli_args=remaps) for name in ("source", "reader", "apart")]
    source, reader, apart = made
    received: list[str] = []
    reader.lead = subscription(reader, HOLD_STATUS, lambda _: received.append("reader"))
    apart.lead = subscription(apart, HOLD_STATUS, lambda _: received.append("apart"))
    assert reader.bypass(source, HOLD_STATUS)
    assert not apart.bypass(source, HOLD_STATUS)
    assert (reader.lead is None, apart.lead is None) == (True, False)
    name = apart.resolve_topic_name(HOLD_STATUS.name)
    out = [publisher(source, HOLD_STATUS), source.create_publisher(HoldStatus, name, 10)]
    wait_for(lambda: all(one.get_subscription_count() == 1 for one in out))
    (shown,) = source.get_subscriptions_info_by_topic(HOLD_STATUS.name)
    assert shown.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
    for one in out:
        one.publish(HoldStatus())
    source.publish_queue.flush()

    def drained() -> bool:
        for one in (reader, apart):
            one.drain()
        return bool(received)

    wait_for(drained)
    assert received == ["apart"]
    for one in made:
        one.destroy_node()


def test_commands_are_read_best_effort_and_what_the_recorder_has_too_reliably(node: BatchedNode) -> None:
    for topic, reliable in ((THRUSTER_COMMAND, False), (ODOMETRY, True), (BATTERY, True)):
        one = subscription(node, topic, print)
        (found,) = node.get_subscriptions_info_by_topic(one.topic_name)
        assert (found.qos_profile.reliability is ReliabilityPolicy.RELIABLE) is reliable
