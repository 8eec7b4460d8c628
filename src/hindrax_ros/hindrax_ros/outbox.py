"""Messages that go out together.

Every datagram that reaches a sleeping process wakes it, and waking is what costs. What is published within one cycle
is therefore serialized at once and sent back to back at the end of it: its readers wake once and find all of it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher

from hindrax_ros.serialized import serialized


class Outbox:
    """Holds serialized messages until `flush`; both may be called from any thread."""

    def __init__(self) -> None:
        self._held: deque[tuple[Callable[[bytes], None], bytes]] = deque()
        self._sending = threading.Lock()

    def flush(self) -> None:
        """Send what is there, in the order in which it was published."""
        with self._sending:
            while self._held:
                send, data = self._held.popleft()
                send(data)

    def hold(self, send: Callable[[bytes], None], message: Any) -> None:
        """Keep a message for the next flush as it is now."""
        self._held.append((send, serialized(message)))


class HeldPublisher:
    """A publisher whose messages wait in an outbox."""

    def __init__(self, publisher: Publisher, outbox: Outbox) -> None:
        self._hold, self._send = outbox.hold, publisher.publish
        self.get_subscription_count = publisher.get_subscription_count

    def publish(self, message: Any) -> None:
        """Serialize a message now; it is sent when the outbox is flushed."""
        self._hold(self._send, message)
