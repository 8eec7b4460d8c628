"""The safety monitor: watches the operator's link and the health of all nodes, and keeps the thrusters out of use.

The pilot owns the list of thrusters out of use and loses it when its process dies. The safety monitor stores it, so
that a restarted control process does not use a broken thruster; if the safety monitor dies, it gets the list back from
the pilot.

If the operator works over a tether, the safety monitor ends the maneuver when the heartbeat is lost; manual wrenches
have expired by then. It disarms an armed vehicle when the wall clock is set. What happens is reported on stderr, and to
`hindrax health`.
"""

import sys
import time

from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hindrax_bringup.liveness import LivenessFile, health_change, nodes_liveness
from hindrax_bringup.network.link_monitor import NEUTRAL, STAY, LinkMonitor, SafetyMonitorKnobs
from hindrax_core.events import Stamp
from hindrax_core.input_checks import Refusals, StampFault, order_window
from hindrax_core.stack_time import STEP_S
from hindrax_core.text.refusals import Refusal, unreadable
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import DIAGNOSTICS, HEARTBEAT, THRUSTER_HEALTH, THRUSTER_HEALTH_ORDER, THRUSTER_STATE, Topic
from hindrax_msgs.msg import Heartbeat, ThrusterHealth
from hindrax_msgs.srv import Arm
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher, status
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_from_msg, stamp_to_msg
from hindrax_ros.messages.fast_serialization import applied_from_bytes
from hindrax_ros.parameters import SAFETY, knobs
from hindrax_ros.process import spin

CHECK_S, AGAIN_S, REPORT_S = 0.1, 0.5, 1.0
TURN_S = 0.1
"""Its inputs change within seconds; its timers start urgent actions."""
LINK = "link"


class SafetyMonitor(BatchedNode):
    """One light node in a process of its own; `report` gets a sentence about everything that happens."""

    turn_s = TURN_S

    def __init__(self, beating: LivenessFile) -> None:
        super().__init__("safety_monitor")
        nodes, self.armed, self._step_s = f"nodes in {self.get_namespace()}", False, 0.0
        self.every(REPORT_S, lambda: beating.beat(nodes, self._troubles, armed=self.armed))
        self._order = publisher(self, THRUSTER_HEALTH_ORDER)
        self._listed_at = Stamp(0)
        self._window = order_window(mock=bool(self.get_parameter("use_sim_time").value))
        self._refusals = Refusals()
        self._untimed_list: ThrusterHealth | None = None
        self._troubles: dict[str, str] = {}
        """Problem that each node reports; empty when it is well."""
        subscription(self, THRUSTER_HEALTH, self._on_health)
        subscription(self, DIAGNOSTICS, self._on_diagnostics)
        self._without_operator = knobs(self, SafetyMonitorKnobs, fixed={"": SAFETY}).without_operator
        self._link = LinkMonitor()
        self._arm = self.create_client(Arm, "thrusters/arm")
        self._reporter = DiagnosticsPublisher(self)
        self._disarming = ""
        """Reason why the thrusters are to be disarmed, until they are."""
        subscription(self, THRUSTER_STATE, self._on_thrusters, raw=True)
        self.every(AGAIN_S, self.repeat_disarm)
        if self.stack_time.epoch_ns is not None:
            self.every(REPORT_S, self._check_clock)
        if self._without_operator != STAY:
            self._cancel = self.create_client(CancelGoal, "maneuver/fly/_action/cancel_goal")
            self._report_s = 0.0
            subscription(self, HEARTBEAT, self._on_heartbeat)
            self.every(CHECK_S, lambda: self._check_link(time.monotonic()))

    def report(self, sentence: str) -> None:
        """Write a sentence for the operator."""
        print_stderr(sentence)

    def drain(self) -> None:
        """Read what waits; then the list that came before the time was known."""
        super().drain()
        if self._untimed_list is not None and self.now() > 0:
            message, self._untimed_list = self._untimed_list, None
            self._on_health(message)

    def _on_heartbeat(self, beat: Heartbeat) -> None:
        """Accept a heartbeat unless it is stale (queued on a dead link) or its clock is wrong."""
        wrong_stamp = self._window.judge(stamp_from_msg(beat.header.stamp), self.now())
        if wrong_stamp is None:
            message = self._link.beat(time.monotonic())
            if message:
                self.report(message)
        elif wrong_stamp.kind is not StampFault.TIMELESS:
            self._refuse(HEARTBEAT, wrong_stamp.refusal.within("the heartbeat is "))

    def _refuse(self, topic: Topic, why: Refusal) -> None:
        """Count a refused message; the first one of a topic is reported at once, diagnostics show the count."""
        known = topic.name in self._refusals.counts
        sentence = self._refusals.add(topic.name, why)
        if not known:
            self.report(f"refused: {sentence}")

    def _check_link(self, now_s: float) -> None:
        allowed_s, lost = self._link.allowed_s, self._link.step(now_s)
        if lost:
            self._act_on_lost_link(allowed_s)
        if lost or now_s - self._report_s >= REPORT_S:
            self._report_s = now_s
            refused = self._refusals.new_refusals()
            level = DiagnosticStatus.WARN if self._link.lost or refused else DiagnosticStatus.OK
            words = "; ".join([self._link.status_text(now_s), *refused])
            values = {"age [s]": f"{self._link.silent_s(now_s):.1f}"} | self._refusals.values()
            found = status(f"hindrax: {LINK}", level, words, values)
            self._reporter.publish(self.now(), found)

    def _act_on_lost_link(self, silent_s: float) -> None:
        """Put the vehicle into the state chosen for a lost link, without waiting for the answers."""
        # A request without an id and without a stamp means all goals (action_msgs/srv/CancelGoal).
        self._cancel.call_async(CancelGoal.Request())
        if self._without_operator == NEUTRAL:
            self._disarm(f"no operator for {silent_s:g} s")
        what = "disarming" if self._without_operator == NEUTRAL else "maneuvers end, holds stay"
        self.report(f"link: no operator for {silent_s:g} s; {what}")

    def _disarm(self, reason: str) -> None:
        """Request to disarm, until the thrusters report it; a reason marks it as no request of an operator."""
        self._disarming = reason
        self._arm.call_async(Arm.Request(arm=False, reason=reason, stamp=stamp_to_msg(self.now())))

    def repeat_disarm(self) -> None:
        """Ask again: a request may be lost."""
        if not self.armed:
            self._disarming = ""
        elif self._disarming:
            self._disarm(self._disarming)

    def _on_thrusters(self, data: bytes) -> None:
        try:
            self.armed = applied_from_bytes(data).armed
        except ValueError as error:
            self._refuse(THRUSTER_STATE, unreadable(error))

    def _check_clock(self) -> None:
        """Disarm when the wall clock is set: orders of those who stamp with it would be refused from now on."""
        step, step_s = self.stack_time.step_reason(), self.stack_time.step_s()
        if abs(step_s - self._step_s) > STEP_S:
            self._step_s = step_s
            if step and self.armed:
                self._disarm(step)
        level = DiagnosticStatus.WARN if step else DiagnosticStatus.OK
        text = f"{step}; stamps do not follow until the stack restarts" if step else "as the wall clock"
        values = {"wall clock ahead [s]": f"{step_s:.3f}"}
        self._reporter.publish(self.now(), status("hindrax: clock", level, text, values))

    def _on_health(self, message: ThrusterHealth) -> None:
        """Latch the newest list as an order, for a pilot that restarts without one."""
        stamp, now = stamp_from_msg(message.header.stamp), self.now()
        if now <= 0:
            self._untimed_list = message
            return
        # A pilot that has received no list publishes one stamped zero.
        wrong_stamp = self._window.of_lists.judge(stamp, Stamp(max(now, self._listed_at))) if stamp != 0 else None
        if wrong_stamp is not None:
            self._refuse(THRUSTER_HEALTH, wrong_stamp.refusal.within("the list is "))
        elif stamp > self._listed_at:
            self._listed_at = stamp
            self._order.publish(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for one in message.status:
            name = one.name.removeprefix("hindrax: ")
            if name == LINK:  # reported here; a lost operator is no fault of the vehicle
                continue
            trouble = "" if one.level == b"\x00" else one.message
            if change := health_change(name, self._troubles.get(name), trouble):
                self.report(change)
            self._troubles[name] = trouble


def main() -> int:
    """Watch until a signal."""
    with nodes_liveness() as beating:
        return spin(lambda: [SafetyMonitor(beating)])


if __name__ == "__main__":
    sys.exit(main())
