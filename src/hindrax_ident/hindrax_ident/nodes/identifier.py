"""Identifier node: runs the session live and publishes an estimate at every sample."""

import copy
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from typing import TypeAlias, TypeVar

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from std_srvs.srv import Trigger

from hindrax_core.events import Stamp, Stamped
from hindrax_core.input_checks import Refusals
from hindrax_core.messages.contents import Read
from hindrax_core.signals import Estimate, IdentEvent
from hindrax_core.text.digits import measured
from hindrax_core.text.refusals import unreadable
from hindrax_core.topics import ESTIMATE, Topic
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.nodes.experiment_server import ExperimentServer
from hindrax_ident.nodes.measurement_messages import (
    ANY_ODOMETRY,
    ANY_WRENCH,
    readers,
    thrust_from_wrench,
    velocities_from_odometry,
)
from hindrax_ident.online.record_session import RecordSession
from hindrax_ident.online.session import Outcome, Session
from hindrax_ident.records.feed import DROPPED, Feed, Measurement
from hindrax_ident.tuning import Tuning
from hindrax_ros.batched_node import TURN_S, BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher, status
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.heartbeat import HeartbeatFile
from hindrax_ros.messages.convert import estimate_to_msg
from hindrax_ros.parameters import frame_prefix, knobs, text
from hindrax_ros.process import spin

REPORT_S = 1.0
ASSESS = "ident/assess"
NOTHING_TO_JUDGE = "nothing to judge yet: found no velocities and thrust, wanted a maneuver, or `odometry` and `wrench`"
Events: TypeAlias = Sequence[Stamped[IdentEvent]]
MessageT = TypeVar("MessageT")
Judged = TypeVar("Judged")
Verdict = TypeVar("Verdict")


class Identifier(BatchedNode):
    """Publishes the estimates of a live session, and diagnostics; `ident/assess` returns the verdicts so far.

    `ident/run` has the pilot fly what the session is to learn from.

    `odometry` and `wrench`, remapped to those of another stack, are identified without maneuvers.
    """

    def __init__(self) -> None:
        super().__init__("identifier")
        vehicle: Vehicle = load_vehicle(text(self, "vehicle", "", "vehicle file [-]"))
        self._begin(vehicle, knobs(self, Tuning, partial(self._begin, vehicle)))
        self._out, self._prefix = publisher(self, ESTIMATE), frame_prefix(self)
        self._reporter = DiagnosticsPublisher(self)
        self._last: Estimate | None = None
        self._refusals = Refusals()
        for topic, read in readers(vehicle).items():
            subscription(self, topic, self._listener(topic, read), raw=True)
        for topic, events_of in ((ANY_ODOMETRY, velocities_from_odometry), (ANY_WRENCH, thrust_from_wrench)):
            subscription(self, topic, self._any_listener(topic, events_of))
        self._heartbeat = HeartbeatFile(os.environ)
        self.create_service(Trigger, ASSESS, self._on_assess)
        self._experiments = ExperimentServer(self, lambda choose: self._judged(choose, self._session))
        self.every(REPORT_S, self._report)

    def close(self) -> None:
        """Take the actions away before the node."""
        self._experiments.close()

    def _begin(self, vehicle: Vehicle, tuning: Tuning) -> None:
        """Begin a session; one with another tuning forgets what was learned before."""
        self._feed, self._session = Feed(vehicle, tuning), Session(vehicle, tuning)
        self._any, self._any_received = RecordSession(vehicle, tuning), False
        self._waiting: list[Stamped[IdentEvent]] = []

    def _listener(self, topic: Topic, read: Read[Measurement]) -> Callable[[bytes], None]:
        def on_message(data: bytes) -> None:
            try:
                measurement = read(data)
            except ValueError as error:
                self._refusals.add(topic.name, unreadable(error))
                return
            for event in self._feed.step(measurement):
                for estimate in self._session.step(event):
                    self._publish(estimate)

        return on_message

    def _any_listener(
        self, topic: Topic, events_of: Callable[[MessageT, Stamp, str], Events]
    ) -> Callable[[MessageT], None]:
        def on_message(message: MessageT) -> None:
            try:
                events = events_of(message, self.now(), self._prefix)
            except ValueError as error:
                self._refusals.add(topic.name, unreadable(error))
                return
            self._any_received = True
            self._waiting += events

        return on_message

    def drain(self) -> None:
        """Take what waits; of another stack all at once, since a backlog comes topic by topic."""
        super().drain()
        waiting, self._waiting = self._waiting, []
        for estimate in self._any.step(*waiting):
            self._publish(estimate)

    def _on_assess(self, _request: object, response: Trigger.Response) -> Trigger.Response:
        """Verdict on every motion so far, a line each; success if there is any."""
        motions = self._judged(_motions, self._any if self._any_received else self._session)
        response.success = bool(motions)
        response.message = "\n".join(map(verdict_text, motions.values())) or NOTHING_TO_JUDGE
        return response

    def _judged(self, judge: Callable[[Judged], Verdict], session: Judged) -> Verdict:
        """Return the verdict of `judge` on a session, which takes seconds to minutes.

        A thread computes it on a copy: no message is lost meanwhile, and the heartbeat continues.
        """
        with ThreadPoolExecutor(1) as worker:
            verdict = worker.submit(judge, copy.deepcopy(session))
            while not wait([verdict], TURN_S).done:
                self.drain()
                self.publish_queue.flush()
                self._heartbeat.beat(time.monotonic())
        return verdict.result()

    def _publish(self, estimate: Stamped[Estimate]) -> None:
        self._last = estimate.reading
        self._out.publish(estimate_to_msg(estimate, self._prefix))

    def _report(self) -> None:
        last = self._last
        summary = "waiting for a maneuver" if last is None else f"{last.motion}: {last.samples} samples"
        reason = f"holding: {last.reason}" if last is not None and not last.learning else "learning"
        values = {"state": reason, DROPPED: str(self._feed.dropped + self._any.dropped)} | self._refusals.values()
        new_refusals = self._refusals.new_refusals()
        level = DiagnosticStatus.WARN if new_refusals else DiagnosticStatus.OK
        text = "; ".join([summary, *new_refusals])
        self._reporter.publish(self.now(), status("hindrax: identifier", level, text, values))


def _motions(session: Session | RecordSession) -> Mapping[str, MotionResult]:
    found = session.finalize()
    return found.results.motions if isinstance(found, Outcome) else found


def verdict_text(result: MotionResult) -> str:
    """Verdict on a motion in one line, such as `surge: k_q 66.1 +- 0.4, k_l 1.3 +- 0.5`."""
    if not result.identifiable:
        return f"{result.motion}: not identifiable: {'; '.join(result.reasons)}"
    numbers = (f"{name} {measured(one.value, one.std)}" for name, one in result.coefficients.items())
    return f"{result.motion}: {', '.join(numbers)}"


def make_nodes() -> Sequence[Node]:
    """The identifier alone."""
    return [Identifier()]


def main() -> int:
    """Run the identifier until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
