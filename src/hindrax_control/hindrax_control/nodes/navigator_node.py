"""The navigator node: messages of the sensors in, odometry and navigation status out at 50 Hz of sensor time."""

import os
from collections.abc import Callable
from dataclasses import replace

from hindrax_control.navigation.attitude_filter import Offset
from hindrax_control.navigation.estimator_health import EstimatorHealthKnobs
from hindrax_control.navigation.navigator import Navigator, NavigatorKnobs
from hindrax_control.sensors import without_velocity
from hindrax_core import topics
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped
from hindrax_core.messages.contents import Read
from hindrax_core.messages.inputs import InputKnobs, Inputs
from hindrax_core.readings import Reading
from hindrax_core.sensor_table import Capability
from hindrax_core.signals import Allocation, Navigation
from hindrax_core.text.refusals import unreadable
from hindrax_core.vehicle import Vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher
from hindrax_ros.graph import optional_class, publisher, subscription
from hindrax_ros.heartbeat import Memory
from hindrax_ros.messages.fast_serialization import navigation_writer, odometry_writer, thrust_from_bytes
from hindrax_ros.messages.reading_fields import reader
from hindrax_ros.messages.serialization import contents_reader
from hindrax_ros.parameters import SETUP, frame_prefix, knobs
from hindrax_ros.transforms import transform_publisher

READ: tuple[Capability, ...] = (
    "field",
    "depth",
    "altitude",
    "range_ahead",
    "range_aside",
    "velocity",
    "attitude",
    "rates",
)
"""In the order of subscription: the inertial samples, which complete a tick, come last."""
OURS = InputKnobs()
HEALTH = EstimatorHealthKnobs()
REPORT_EVERY = 50
SILENT_S = 5.0
"""Time without a state after which that is reported; alignment takes less unless the vehicle is moved [wall time]."""
REMEMBERED = 4
"""Numbers that the navigator of a restarted process begins with: offset of the gyroscope and its deviation [rad/s]."""
TRANSFORM_EVERY = 5
"""States per transform on /tf: 10 Hz, between which its listeners interpolate."""
SETTLE_S = 0.0005
"""Within this time all inertial samples of one fetch, and the messages beside them, have arrived."""


def sources(vehicle: Vehicle, inputs: InputKnobs = OURS) -> dict[topics.Topic, tuple[str, Read[Reading]]]:
    """Topics that the navigator reads, in the order of subscription: name of the sensor, and the reader of each.

    UsageError where a chosen message is of a package that is not installed.
    """
    found: dict[topics.Topic, tuple[str, Read[Reading]]] = {}
    for capability in READ:
        chosen = inputs.of(capability)
        for name, topic in topics.carriers(vehicle, capability).items():
            if chosen is None:
                found[topic] = name, reader(topic)
                continue
            word, row = chosen
            if optional_class(row.type) is None:
                package = row.type.partition("/")[0]
                remedy = f"sudo apt install ros-jazzy-{package.replace('_', '-')}"
                raise UsageError(f"input.{capability}: {word} is a message of {package}, not installed here; {remedy}")
            # Many drivers publish best effort, of which a reliable reader gets nothing.
            quality = replace(topic.quality, reliable=False)
            theirs = replace(topic, name=f"{name}/{word}", type=row.type, quality=quality)
            read = row.together(contents_reader(row.type, row.contents(vehicle.water, inputs)))
            found[theirs] = name, read
    return found


class NavigatorNode(BatchedNode):
    """Turns readings into `navigation/status` and `navigation/odometry`; calls `on_state` before it publishes.

    An allocator of the same process calls `on_allocation`, one elsewhere publishes `control/allocation`.
    """

    def __init__(self, vehicle: Vehicle, on_state: Callable[[Stamped[Navigation]], None] = lambda _: None) -> None:
        super().__init__("navigator", ros_time=False)
        self.settle_s = SETTLE_S
        self.on_state = on_state
        self._thrusters = len(vehicle.thrusters)
        self._unlocked = without_velocity(vehicle) if vehicle.measuring("velocity") else ""
        self._navigator = Navigator(vehicle, knobs(self, NavigatorKnobs, fixed={"": "the state would restart"}))
        self.confirm_position = self._navigator.confirm_position
        self._memory = Memory(os.environ)
        if known := self._memory.recall(REMEMBERED):
            self._navigator.set_gyroscope_offset(Offset((known[0], known[1], known[2]), known[3]))
        self._status = publisher(self, topics.NAVIGATION)
        self._odometry = publisher(self, topics.ODOMETRY)
        prefix = frame_prefix(self)
        self._status_bytes, self._odometry_bytes = navigation_writer(prefix), odometry_writer(prefix)
        self._publish_transform = transform_publisher(self, vehicle, prefix)
        self._reporter = DiagnosticsPublisher(self, self._navigator.refusals)
        self._turn = 0
        self._heard, self._spoke = Stamp(0), True
        subscription(self, topics.ALLOCATION, self._on_allocation_message, raw=True)
        inputs = knobs(self, Inputs, fixed={"": SETUP}).input
        for topic, (source, read) in sources(vehicle, inputs).items():
            self.lead = subscription(self, topic, self._callback(source, read), raw=True)
        self.every(SILENT_S, self._report_silence)

    def _callback(self, source: str, read: Read[Reading]) -> Callable[[bytes], None]:
        step = self._navigator.step

        def on_message(data: bytes) -> None:
            try:
                stamped = read(data)
            except ValueError as error:
                self._navigator.refusals.add(source, unreadable(error))
                return
            self._heard = stamped.stamp
            found = step(stamped, source)
            if found is not None:
                self._publish(found)

        return on_message

    def on_allocation(self, _: Stamp, allocation: Allocation) -> None:
        """Use the thrusters' forces for the compass correction."""
        self._navigator.thrust(allocation.forces_N)

    def _on_allocation_message(self, data: bytes) -> None:
        try:
            thrust = thrust_from_bytes(data)
        except ValueError as error:
            self._navigator.refusals.add(topics.ALLOCATION.name, unreadable(error))
            return
        if len(thrust.reading.forces_N) == self._thrusters:
            self._navigator.thrust(thrust.reading.forces_N)

    def _publish(self, found: Stamped[Navigation]) -> None:
        self._spoke = True
        self.on_state(found)
        self._status.publish(self._status_bytes(found))
        self._odometry.publish(self._odometry_bytes(found))
        self._turn = (self._turn + 1) % REPORT_EVERY
        if self._turn % TRANSFORM_EVERY == 0:
            self._publish_transform(found)
        if self._turn == 0:
            self._report(found)

    def _report_silence(self) -> None:
        """Say why there is no state; the reports of a state come with it."""
        spoke, self._spoke = self._spoke, False
        if not spoke:
            self._reporter.report(self._heard, ["no state: it takes samples of an inertial sensor"], "", {})

    def _report(self, found: Stamped[Navigation]) -> None:
        if offset := self._navigator.gyroscope_offset:
            self._memory.write((*offset.rate_radps, offset.sigma_radps))
        values = {f"age of {source} [s]": f"{age:.3f}" for source, age in found.reading.ages_s.items()}
        self._reporter.report(found.stamp, self._wrong(found.reading), "navigating", values)

    def _wrong(self, reading: Navigation) -> list[str]:
        """Sensors that contradict the accelerometer by the pilot's limits, or the lack of a velocity."""
        contradicting = {
            "velocities": (reading.consistency.refused_velocities, HEALTH.refused_velocities),
            "depths": (reading.consistency.refused_depths, HEALTH.refused),
        }
        remedy = "contradict the accelerometer: check rotation_deg of both, and the rotation that the sensor was told"
        wrong = [f"{found} {what} {remedy}" for what, (found, most) in contradicting.items() if found >= most]
        lost = "" if reading.dvl_locked else self._unlocked
        return wrong or ([f"{lost}: position is dead reckoned without a velocity"] if lost else [])
