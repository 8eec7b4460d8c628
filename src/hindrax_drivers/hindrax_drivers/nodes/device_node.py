"""One lifecycle node per device, as the operator expects to see it in `ros2 node list`.

The wire is served by a thread from the start; the lifecycle shows what it found. A device that has not identified
itself leaves its node unconfigured, with the reason in /diagnostics; once it answers, the node configures and activates
itself; when it is lost, the node goes back. Only an active node publishes readings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from hindrax_core.device import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Inertial
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.nodes.outlets import Outlets, outlets
from hindrax_ros.frames import FrameTap
from hindrax_ros.health import Health, Reporter
from hindrax_ros.outbox import Outbox
from hindrax_ros.polled import PolledNode

LOOK_AFTER_S = 0.2
REPORT_EVERY = 5
STALE_S = 1.0


class DeviceNode(PolledNode, LifecycleNode):
    """Publishes what one device says; `ready` tells whether the wire has found the device it expects.

    Nodes of one process may share an outbox. The inertial samples, by which navigation ticks, take along what the other
    sensors have said since the last ones; without an IMU the turns of the process do.
    """

    def __init__(
        self, name: str, vehicle: Vehicle, parameters: Iterable[Any] = (), outbox: Outbox | None = None
    ) -> None:
        super().__init__(
            name, outbox=outbox, ros_time=False, parameter_overrides=list(parameters), enable_logger_service=False
        )
        self.health = Health(hardware=name)
        self.tap = FrameTap(self, name)
        self._outlets: Outlets = outlets(self, vehicle)
        self._reporter = Reporter(self)
        self._active = False
        self._turn = 0
        self.ready: Callable[[], bool] = lambda: False
        self.now: Callable[[], Stamp] = lambda: Stamp(0)
        self.stop: Callable[[], None] = lambda: None
        self.every(LOOK_AFTER_S, self._look_after)

    def deliver(self, outputs: Iterable[Output]) -> None:
        """Take what the device said, on the thread of its wire."""
        for output in outputs:
            if isinstance(output, Stamped):
                self._reading(output)
            elif isinstance(output, Rejected):
                self.health.reject(output)
            elif isinstance(output, Trouble):
                self._trouble(output.text)
            elif isinstance(output, Identity):
                self.health.identity = output.text
                self.get_logger().info(f"{self.get_name()}: found {output.text}")
            else:
                assert isinstance(output, Send)
        if Inertial in self._outlets:
            self.outbox.flush()

    def _reading(self, stamped: Stamped[Any]) -> None:
        self.health.reading(stamped.stamp)
        outlet = self._outlets.get(type(stamped.reading))
        if self._active and outlet is not None:
            outlet(stamped)

    def _trouble(self, text: str) -> None:
        if text != self.health.trouble:
            self.get_logger().warning(text)
        self.health.troubled(text)

    def troubled(self, text: str) -> None:
        """Let the wire say what is wrong with it."""
        self._trouble(text)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Succeed once the device has identified itself."""
        del state
        return TransitionCallbackReturn.SUCCESS if self.ready() else TransitionCallbackReturn.FAILURE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish from now on."""
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish no more."""
        self._active = False
        return super().on_deactivate(state)

    def close(self) -> None:
        """End the thread of the wire."""
        self.stop()

    def _look_after(self) -> None:
        """Let the lifecycle follow the device, and report once a second."""
        found = self.ready()
        if found and not self._active:
            self.trigger_configure()
            self.trigger_activate()
        elif self._active and not found:
            self.trigger_deactivate()
            self.trigger_cleanup()
        self._turn = (self._turn + 1) % REPORT_EVERY
        if self._turn == 0:
            now = self.now()
            self._reporter.publish(now, self.health.report(f"hindrax: {self.get_name()}", now, STALE_S))
