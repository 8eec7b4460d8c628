"""The identifier node: listens, learns, and says what it knows at every accepted sample."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from hindrax_core.events import Stamp, Stamped
from hindrax_core.state import Estimate
from hindrax_core.topics import ESTIMATE
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.feed import Feed, Sorter
from hindrax_ident.nodes.listen import AS_BYTES, LISTENERS, Listen
from hindrax_ident.session import Session
from hindrax_ident.tuning import Tuning
from hindrax_ros.convert import estimate_to_msg
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.health import Reporter, status
from hindrax_ros.parameters import knobs, text
from hindrax_ros.polled import PolledNode
from hindrax_ros.process import spin

REPORT_S = 1.0


class Identifier(PolledNode):
    """The session, live."""

    def __init__(self) -> None:
        super().__init__("identifier")
        vehicle: Vehicle = load_vehicle(text(self, "vehicle", "", "vehicle file [-]"))
        self._session = Session(vehicle, knobs(self, Tuning))
        self._sorter, self._feed = Sorter(), Feed(vehicle)
        self._out = publisher(self, ESTIMATE)
        self._reporter = Reporter(self)
        self._last: Estimate | None = None
        for topic, listen in LISTENERS.items():
            fast = AS_BYTES.get(topic)
            subscription(self, topic, self._listener(fast or listen), raw=fast is not None)
        self.create_timer(REPORT_S, self._report)

    def _listener(self, listen: Listen) -> Callable[[Any], None]:
        def on_message(message: Any) -> None:
            for measurement in self._sorter.push(listen(message)):
                for event in self._feed.step(measurement):
                    for estimate in self._session.step(event):
                        self._publish(estimate)

        return on_message

    def _publish(self, estimate: Stamped[Estimate]) -> None:
        self._last = estimate.reading
        self._out.publish(estimate_to_msg(estimate))

    def _report(self) -> None:
        last = self._last
        said = "waiting for a maneuver" if last is None else f"{last.motion}: {last.samples} samples"
        reason = f"holding: {last.reason}" if last is not None and not last.learning else "learning"
        values = {"state": reason, "late events dropped": str(self._sorter.dropped)}
        now = Stamp(self.get_clock().now().nanoseconds)
        self._reporter.publish(now, status("hindrax: identifier", DiagnosticStatus.OK, said, values))


def make_nodes() -> Sequence[Node]:
    """The identifier alone."""
    return [Identifier()]


def main() -> int:
    """Run the identifier until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
