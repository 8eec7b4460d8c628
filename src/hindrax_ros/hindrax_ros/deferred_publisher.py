"""Messages that are sent together.

Every datagram that reaches a sleeping process wakes it, and waking is what costs. What is published within one cycle
is therefore serialized at once and sent back to back at the end of it: its readers wake once and find all of it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher

from hindrax_ros.messages.serialization import serialized


class PublishQueue:
    """Holds serialized messages until `flush`; both may be called from any thread."""

    def __init__(self) -> None:
        self._held: deque[tuple[Callable[[bytes], None], bytes]] = deque()
        self._sending = threading.Lock()

    def flush(self) -> None:
        """Send the queued messages in the order of publication."""
        with self._sending:
            while self._held:
                send, data = self._held.popleft()
                send(data)

    def add(self, send: Callable[[bytes], None], message: Any) -> None:
        """Serialize a message now and queue it for the next flush."""
        self._held.append((send, serialized(message)))


class DeferredPublisher:
    """A publisher whose messages wait in a publish queue."""

    def __init__(self, publisher: Publisher, publish_queue: PublishQueue) -> None:
        self._enqueue, self._send = publish_queue.add, publisher.publish
        self.get_subscription_count = publisher.get_subscription_count

    def publish(self, message: Any) -> None:
        """Serialize a message now; it is sent when the queue is flushed."""
        self._enqueue(self._send, message)
