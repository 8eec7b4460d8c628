"""Identifier node: runs the session live and publishes an estimate at every sample."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Estimate
from hindrax_core.topics import ESTIMATE
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.nodes.measurement_messages import AS_BYTES, LISTENERS, Listen
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import DROPPED, Feed
from hindrax_ident.tuning import Tuning
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.convert import estimate_to_msg
from hindrax_ros.diagnostics import DiagnosticsPublisher, status
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.parameters import knobs, text
from hindrax_ros.process import spin

REPORT_S = 1.0


class Identifier(BatchedNode):
    """Publishes the estimates of a live session, and diagnostics."""

    def __init__(self) -> None:
        super().__init__("identifier")
        vehicle: Vehicle = load_vehicle(text(self, "vehicle", "", "vehicle file [-]"))
        self._begin(vehicle, knobs(self, Tuning, partial(self._begin, vehicle)))
        self._out = publisher(self, ESTIMATE)
        self._reporter = DiagnosticsPublisher(self)
        self._last: Estimate | None = None
        for topic, listen in LISTENERS.items():
            fast = AS_BYTES.get(topic)
            subscription(self, topic, self._listener(fast or listen), raw=fast is not None)
        self.create_timer(REPORT_S, self._report)

    def _begin(self, vehicle: Vehicle, tuning: Tuning) -> None:
        """Begin a session; one with another tuning forgets what was learned before."""
        self._feed, self._session = Feed(vehicle, tuning), Session(vehicle, tuning)

    def _listener(self, listen: Listen) -> Callable[[Any], None]:
        def on_message(message: Any) -> None:
            for event in self._feed.step(listen(message)):
                for estimate in self._session.step(event):
                    self._publish(estimate)

        return on_message

    def _publish(self, estimate: Stamped[Estimate]) -> None:
        self._last = estimate.reading
        self._out.publish(estimate_to_msg(estimate))

    def _report(self) -> None:
        last = self._last
        summary = "waiting for a maneuver" if last is None else f"{last.motion}: {last.samples} samples"
        reason = f"holding: {last.reason}" if last is not None and not last.learning else "learning"
        values = {"state": reason, DROPPED: str(self._feed.dropped)}
        now = Stamp(self.get_clock().now().nanoseconds)
        self._reporter.publish(now, status("hindrax: identifier", DiagnosticStatus.OK, summary, values))


def make_nodes() -> Sequence[Node]:
    """The identifier alone."""
    return [Identifier()]


def main() -> int:
    """Run the identifier until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
