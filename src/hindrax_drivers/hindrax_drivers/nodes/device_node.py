"""One lifecycle node per device, as listed by `ros2 node list`.

The wire is served by a thread from the start; the lifecycle shows what it found. A device that has not identified
itself leaves its node unconfigured, with the reason in /diagnostics; once it answers, the node configures and activates
itself, as far as an operator has not asked for another state; when it is lost, the node goes back (see `lifecycle`).
Only an active node publishes readings; a finalized one publishes nothing but its diagnostics.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from itertools import cycle
from typing import TypeVar

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from hindrax_core.driver_interface import Identity, Output, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import DeviceText, Inertial, Leak, Pressure, Reading
from hindrax_core.topics import Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.driver import MeasurementMonitor
from hindrax_drivers.lifecycle import ON_REQUEST, State, Transition, next_transition, requested
from hindrax_drivers.nodes.reading_messages import ReadingMessages, frame_of
from hindrax_ros.batched_node import BatchedNode, PublishQueue
from hindrax_ros.diagnostics import DiagnosticsPublisher, NodeDiagnostics
from hindrax_ros.graph import publisher
from hindrax_ros.parameters import frame_prefix, text
from hindrax_ros.raw_frames import FrameTap

MessageT = TypeVar("MessageT")

LIFECYCLE_PERIOD_S = 0.2
REPORT_EVERY = 5
STALE_S = 1.0
NEEDED: Mapping[type[Reading], str] = {Inertial: "rates", Pressure: "depth"}
"""Measurements without which no maneuver begins: of a sensor that has both, one may be missing while it is well."""
WET = "water in the hull: surface, and open it; nothing is disabled automatically"
WAS_WET = "there was water in the hull, and the probe is dry again: surface, and open it"


class DeviceNode(BatchedNode, LifecycleNode):
    """Publishes the readings of one device; `ready`: whether the expected device was found.

    `device` is its kind in the table of sensors; an output has none.

    The nodes of a process may share a publish queue. The IMU node, which paces the navigation, flushes it with every
    batch of samples; without an IMU the loop of the process flushes it.
    """

    def __init__(
        self, name: str, vehicle: Vehicle, device: str = "", publish_queue: PublishQueue | None = None
    ) -> None:
        super().__init__(name, publish_queue=publish_queue, ros_time=False, enable_logger_service=False)
        self.health = NodeDiagnostics(hardware=name)
        self.tap = FrameTap(self, name)
        frame = None
        if device:
            frame = text(self, "frame_id", frame_prefix(self) + frame_of(name), "frame of its messages [-]")
        self._messages = ReadingMessages(name, device, vehicle, frame)
        rates_Hz = [topic.rate_Hz for topic in self._messages.topics if topic.name.endswith("/pressure")]
        self._pressures_Hz = max(rates_Hz, default=0.0)
        """Every pressure comes with a temperature; only as many temperatures are published as the table says."""
        self._publish = {topic.name: self._publisher(topic) for topic in self._messages.topics}
        self._measured = MeasurementMonitor(NEEDED if all(map(self._messages.accepts, NEEDED)) else {}, STALE_S)
        self._reporter = DiagnosticsPublisher(self)
        self._active = False
        self._wanted = State.ACTIVE
        self._turn = 0
        self.ready: Callable[[], bool] = lambda: False
        self.now: Callable[[], Stamp] = lambda: Stamp(0)
        self.stop: Callable[[], None] = lambda: None
        self.release: Callable[[], None] = lambda: None
        change = next(one for one in self.services if one.srv_name.endswith("/change_state"))
        change.callback = self._on_change_state  # that of rclpy raises at an invalid request
        self._due_s = 0.0

    def drain(self) -> None:
        """Take what waits. The lifecycles of a process are looked after in one turn: a timer each would wake it."""
        super().drain()
        if (now_s := time.monotonic()) >= self._due_s:
            self._due_s = now_s + LIFECYCLE_PERIOD_S
            self._update_lifecycle()

    @property
    def finalized(self) -> bool:
        """Whether an operator has finalized the node."""
        return self._wanted is State.FINALIZED

    def _publisher(self, topic: Topic) -> Callable[[object], None]:
        publish = publisher(self, topic, held=topic.recorded).publish
        many = round(self._pressures_Hz / topic.rate_Hz) if topic.name.endswith("/temperature") else 1
        return one_of_many(many, publish) if many > 1 else publish

    def deliver(self, outputs: Iterable[Output]) -> None:
        """Handle outputs of the device, on the thread of its wire."""
        for output in () if self.finalized else outputs:
            if isinstance(output, Stamped):
                self._reading(output)
            elif isinstance(output, Rejected):
                self.health.reject(output)
            elif isinstance(output, Trouble):
                self.troubled(output.text)
            elif isinstance(output, Identity):
                self.health.identity = output.text
                self.get_logger().info(f"{self.get_name()}: found {output.text}")
        if self._messages.accepts(Inertial):
            self.publish_queue.flush()

    def _reading(self, stamped: Stamped[object]) -> None:
        self.health.reading(stamped.stamp)
        self._measured.received(stamped.reading, stamped.stamp)
        if isinstance(stamped.reading, Leak):
            self._leak(wet=stamped.reading.wet)
        if not self._active:
            return
        if isinstance(stamped.reading, DeviceText):
            self.get_logger().info(stamped.reading.text)
        for topic, message in self._messages.of(stamped):
            self._publish[topic](message)

    def _leak(self, *, wet: bool) -> None:
        """Report water in the hull; the error outlives the water, until an operator deactivates the node."""
        if wet and self.health.alarm != WET:
            self.get_logger().error(WET)
        if wet or self.health.alarm:
            self.health.alarm = WET if wet else WAS_WET

    def troubled(self, text: str) -> None:
        """Report a trouble of the device or its wire."""
        if text != self.health.trouble:
            self.get_logger().warning(text)
        self.health.troubled(text)

    def frame(self, stamp: Stamp, sent: bool, data: bytes) -> None:
        """Record one frame of the wire, on its thread."""
        if not self.finalized:
            self.tap.add(stamp, sent, data)

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Succeed once the device has identified itself."""
        return TransitionCallbackReturn.SUCCESS if self.ready() else TransitionCallbackReturn.FAILURE

    def on_request(self, wanted: State) -> None:
        """Act on a state that an operator requested, beyond publishing."""
        if wanted is State.FINALIZED:
            self.release()

    def close(self) -> None:
        """End the thread of the wire, and publish the frames that it leaves: the last ones tell how a run ended."""
        self.stop()
        self.tap.flush()

    def _on_change_state(self, request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        """Answer the service: a valid transition is performed, and its goal is kept as the wanted state."""
        asked, state = request.transition, self.lifecycle_state
        transition = requested(state, asked.id, asked.label)
        response.success = transition is not None and self._trigger(transition)
        if transition is None or not response.success:
            why = "that does not start here" if transition is None else self.health.trouble or "no device has answered"
            name = asked.label or f"transition {asked.id}"
            self.get_logger().warning(f"{name!r} refused in the state {state.name.lower()}: {why}")
            return response
        self._wanted = transition.goal
        if transition.goal is not State.ACTIVE:
            self.health.alarm = ""
        self.health.withheld = ON_REQUEST[transition.goal]
        self.on_request(transition.goal)
        return response

    def _trigger(self, transition: Transition) -> bool:
        trigger = getattr(self, f"trigger_{transition.label}")
        made: bool = trigger() == TransitionCallbackReturn.SUCCESS
        self._active = self.lifecycle_state is State.ACTIVE
        return made

    @property
    def lifecycle_state(self) -> State:
        """Current state."""
        return State(self._state_machine.current_state[0])

    def _update_lifecycle(self) -> None:
        """Move the lifecycle towards the wanted state as far as the device allows, and report once a second."""
        while (step := next_transition(self.lifecycle_state, self._wanted, found=self.ready())) is not None:
            if not self._trigger(step):
                break
        self._turn = (self._turn + 1) % REPORT_EVERY
        if self._turn == 0:
            now = self.now()
            self.health.missing = self._measured.missing(now, self.health.trouble)
            self._reporter.publish(now, self.health.report(f"hindrax: {self.get_name()}", now, STALE_S))


def one_of_many(many: int, publish: Callable[[MessageT], None]) -> Callable[[MessageT], None]:
    """Publish only the last of every `many` messages."""
    turns = cycle((*[False] * (many - 1), True))

    def sometimes(message: MessageT) -> None:
        if next(turns):
            publish(message)

    return sometimes
