"""The node `estimator_health`: checks each state before the pilot uses it, and disarms on an implausible one."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticStatus

from hindrax_control.navigation.estimator_health import EstimatorHealth, EstimatorHealthKnobs
from hindrax_control.navigation.velocity_gain import described
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import Allocation, AppliedOutput, Navigation
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.msg import ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.serialization import deserialized
from hindrax_ros.parameters import SAFETY, knobs

REPORT_EVERY = 50
ASK_AGAIN_S = 0.1


class EstimatorHealthNode(BatchedNode):
    """Checks every state before it is used; while the state is implausible (`failed`), arming is undone.

    The pilot, in the same process, calls it with states of the vehicle and of the thrusters.
    """

    def __init__(self, vehicle: Vehicle, now: Callable[[], Stamp]) -> None:
        """`now`: the clock of its requests."""
        super().__init__("estimator_health", ros_time=False)
        self._health = EstimatorHealth(vehicle, knobs(self, EstimatorHealthKnobs, fixed={"": SAFETY}))
        self._now = now
        self._failed: tuple[str, ...] = ()
        self._forces_N: tuple[float, ...] = ()
        self._armed = False
        self._asked = Stamp(0)
        self._turn = 0
        self._arm = self.create_client(Arm, "thrusters/arm")
        self._reporter = DiagnosticsPublisher(self)

    def on_navigation(self, stamped: Stamped[Navigation]) -> None:
        """Check a state, before the pilot receives it."""
        before = self._failed
        self._failed = self._health.step(stamped.reading, stamped.stamp, self._forces_N, armed=self._armed)
        if self._failed and not before:
            self.get_logger().error(f"the state of the vehicle is not plausible: {'; '.join(self._failed)}")
        self._turn += 1
        if bool(self._failed) != bool(before) or self._turn % REPORT_EVERY == 0:
            self._report(stamped)

    def on_allocation(self, allocation: Allocation) -> None:
        """Keep the forces that the applied pulses should give."""
        self._forces_N = allocation.forces_N

    def failed(self) -> bool:
        """Whether the last state is not plausible."""
        return bool(self._failed)

    def on_thrusters(self, applied: AppliedOutput, data: bytes) -> None:
        """Disarm thrusters that are armed while the state is implausible; `data`: the whole ThrusterState."""
        self._armed = applied.armed
        if not self._failed:
            return
        # Arming is rare, and its text is slow to decode.
        state = deserialized(data, ThrusterState)
        self._armed = state.armed or state.state == "arming"
        if self._armed and abs(seconds_between(self._asked, now := self._now())) >= ASK_AGAIN_S:
            self._asked = now
            # The thrusters' state is the answer. A reason keeps the request from outranking an operator.
            request = Arm.Request(arm=False, sequence=0, reason=self._failed[0], stamp=stamp_to_msg(now))
            self._arm.call_async(request)

    def _report(self, stamped: Stamped[Navigation]) -> None:
        found = stamped.reading.consistency
        values = {
            "tilt sigma [rad]": f"{found.tilt_sigma_rad:.4f}",
            "gravity off [rad]": f"{found.gravity_off_rad:.4f}",
            "refused depths": str(found.refused_depths),
            "refused velocities": str(found.refused_velocities),
            "velocity gain of the DVL": described(found.velocity_gain),
            "sunk off [m]": f"{found.sunk_off_m:.3f}",
            "depth drifted [m]": f"{found.drifted_off_m:.3f}",
            "inertial sensor frozen [s]": f"{found.frozen_s:.2f}",
        }
        well = "the state is plausible"
        self._reporter.report(stamped.stamp, self._failed, well, values, DiagnosticStatus.ERROR)
