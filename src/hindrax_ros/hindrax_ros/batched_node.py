"""Nodes that read their subscriptions in batches, instead of waking for every message: ADR 15.

A process sleeps until its leading topic has a message, or for a while, and then takes all that
waits. Services, actions and timers stay with the executor. What is published within one cycle is serialized at once and
sent back to back at the end of it: its readers wake once and find all of it.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from hindrax_core.topics import NAMESPACE, Topic
from hindrax_ros.messages.serialization import serialized
from hindrax_ros.parameters import CheckedNode

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.executors import Executor

TURN_S = 0.05
"""Longest wait between two turns of a process [wall time]."""
IDLE_TURN_S = 0.2
"""The same where nothing is read and a thread sends what is published; services and timers begin a turn anyway."""
# Best effort: a receipt for every message that nobody reads would wake the threads of the middleware.
UNREAD = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class PublishQueue:
    """Holds serialized messages until `flush`; both may be called from any thread."""

    def __init__(self) -> None:
        self._held: deque[tuple[Callable[[bytes], None], bytes]] = deque()
        self._sending = threading.Lock()
        self.flushes = 0

    def flush(self) -> None:
        """Send the queued messages in the order of publication."""
        self.flushes += 1
        with self._sending:
            while self._held:
                send, data = self._held.popleft()
                send(data)

    def add(self, send: Callable[[bytes], None], message: object) -> None:
        """Serialize a message now and queue it for the next flush."""
        self._held.append((send, serialized(message)))


class DeferredPublisher:
    """A publisher whose messages wait in a publish queue."""

    def __init__(self, publisher: Publisher, publish_queue: PublishQueue) -> None:
        self._enqueue, self._send = publish_queue.add, publisher.publish
        self.get_subscription_count = publisher.get_subscription_count

    def publish(self, message: object) -> None:
        """Serialize a message now; it is sent when the queue is flushed."""
        self._enqueue(self._send, message)


class BatchedNode(CheckedNode):
    """A node whose subscriptions are read by `drain`, not by the executor.

    Without `ros_time` it reads no /clock: for nodes that have their time from the messages or from their wire.
    """

    lead: Subscription | None = None
    """The subscription whose messages begin a turn; without one the process turns every `TURN_S`."""
    turn_s = TURN_S
    """Longest wait between two turns [wall time]."""
    settle_s = 0.0
    """Time in which the rest of a burst follows the first message of the lead [wall time]."""

    def __init__(
        self,
        name: str,
        *,
        publish_queue: PublishQueue | None = None,
        ros_time: bool = True,
        parameter_overrides: Sequence[Parameter] = (),
        **options: Any,
    ) -> None:
        self.publish_queue = PublishQueue() if publish_queue is None else publish_queue
        overrides = [*parameter_overrides]
        if not ros_time:
            overrides.append(Parameter("use_sim_time", Parameter.Type.BOOL, False))  # as rclpy has it
        self._bypassed: frozenset[Subscription] = frozenset()
        self._read: (
            list[tuple[Callable[..., tuple[object, object] | None], type, bool, Callable[..., object], int]] | None
        ) = None
        super().__init__(name, namespace=NAMESPACE, parameter_overrides=overrides, **options)

    def bypass(self, source: Node, topic: Topic) -> bool:
        """Read a topic no more from the graph where a node of the same process publishes it.

        The caller then passes its messages on by call. Where a remap separates the two, this changes nothing. A
        subscription that nobody reads stays in the graph, so that `ros2 node info` and rqt_graph show the edge.

        Parameters
        ----------
        source
            Node of the same process.
        topic
            Row of the topics table.

        Returns
        -------
        bool
            Whether both have it under the same full name.
        """
        name = self.resolve_topic_name(topic.name)
        if source.resolve_topic_name(topic.name) != name:
            return False
        (passed,) = (one for one in super().subscriptions if one.topic_name == name)
        if passed is self.lead:
            self.lead = None
        self.destroy_subscription(passed)
        self._bypassed |= {self.create_subscription(passed.msg_type, topic.name, passed.callback, UNREAD)}
        return True

    def every(self, seconds: float, act: Callable[[], None]) -> None:
        """Call `act` periodically, in wall time."""
        self.create_timer(seconds, act, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Empty, so that the executor waits for none of them."""
        return iter(())

    @property
    def reads(self) -> bool:
        """Whether it subscribes to anything."""
        return any(super().subscriptions)

    def create_subscription(self, *arguments: object, **options: object) -> Subscription:
        """As rclpy does; `drain` reads it from its next call on."""
        self._read = None
        return super().create_subscription(*arguments, **options)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """As rclpy does."""
        self._read = None
        return super().destroy_subscription(subscription)

    def drain(self) -> None:
        """Pass every waiting message to its callback, topic by topic in the order of subscription."""
        if self._read is None:
            read = [one for one in super().subscriptions if one not in self._bypassed]
            with_info = Subscription.CallbackType.WithMessageInfo
            self._read = [
                (one.handle.take_message, one.msg_type, one.raw, one.callback, 1 + (one._callback_type is with_info))  # noqa: SLF001  # as rclpy
                for one in read
            ]
        for take, kind, raw, callback, count in self._read:
            while (found := take(kind, raw)) is not None:
                callback(*found[:count])


def events_executor(context: Context | None = None) -> Executor:
    """Make the executor. It keeps the stderr of the process for crash reports."""
    with contextlib.redirect_stderr(sys.__stderr__):
        return EventsExecutor(context=context)


class SpinLoop:
    """The loop of a process: wait for the leading topic, read all subscriptions, then spin the executor."""

    def __init__(self, nodes: Sequence[Node], executor: Executor) -> None:
        self._batched = [node for node in nodes if isinstance(node, BatchedNode)]
        self._executor = executor
        self._queues = {node.publish_queue: 0 for node in self._batched}
        leads = [node.lead for node in self._batched if node.lead is not None]
        self._leads = [lead.handle for lead in leads]
        self._settle_s = max((node.settle_s for node in self._batched), default=0.0)
        self._set: Any = None
        if leads:
            self._set = rclpy_implementation.WaitSet(len(leads), 0, 0, 0, 0, 0, nodes[0].context.handle)
        self._served = 0.0
        self._turn_s = min((node.turn_s for node in self._batched), default=TURN_S)
        self._idle = False

    def spin_once(self) -> None:
        """Run one turn of the loop."""
        if self._set is None:
            self._executor.spin_once(timeout_sec=IDLE_TURN_S if self._idle else self._turn_s)
        else:
            self._wait()
            now = time.monotonic()
            if now - self._served >= TURN_S:
                self._served = now
                self._executor.spin_once(timeout_sec=0.0)
        for node in self._batched:
            node.drain()
        self.flush()

    def flush(self) -> None:
        """Send the queued messages of the nodes, but for a queue that a thread has flushed since the last turn."""
        self._idle = not any(node.reads for node in self._batched)
        for queue, before in self._queues.items():
            if queue.flushes == before:
                queue.flush()
                self._idle = False
            self._queues[queue] = queue.flushes

    def _wait(self) -> None:
        self._set.clear_entities()
        for lead in self._leads:
            self._set.add_subscription(lead)
        self._set.wait(int(TURN_S * 1e9))
        if self._settle_s > 0.0:
            time.sleep(self._settle_s)
