"""The node `safety_monitor` of a running stack: watches node health, the operator link and the thrusters out of use.

The pilot owns the list of thrusters out of use and loses it when its process dies. The safety monitor stores it for as
long as the stack runs, so that a restarted control process does not use a broken thruster.

If the operator works over a tether, the safety monitor ends the maneuver when the heartbeat is lost; manual wrenches
have expired by then.
"""

from __future__ import annotations

import time
from typing import Any, Self

import rclpy
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from hindrax_bringup.link_monitor import LinkMonitor
from hindrax_core.events import Stamp
from hindrax_core.refusal_counts import Refusals
from hindrax_core.stamp_window import TIMELESS, order_window
from hindrax_core.topics import DIAGNOSTICS, HEARTBEAT, NAMESPACE, THRUSTER_HEALTH, THRUSTER_HEALTH_ORDER, Topic
from hindrax_msgs.srv import Arm
from hindrax_ros.checked_node import CheckedNode
from hindrax_ros.convert import stamp_from_msg, stamp_to_msg
from hindrax_ros.diagnostics import DiagnosticsPublisher, status
from hindrax_ros.graph import publisher, subscription

HOLD, NEUTRAL, STAY = "hold", "neutral", "stay"
"""Reaction to a lost operator: end the maneuver and hold, disarm as well, or nothing (a stack without a tether)."""
REPORT_S = 1.0
LINK = "link"


class SafetyMonitor:
    """One light node; use it as a context manager and call `spin` often."""

    def __init__(self, *, mock: bool, without_operator: str = STAY) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        overrides = [Parameter("use_sim_time", Parameter.Type.BOOL, mock)]
        self.node = CheckedNode("safety_monitor", namespace=NAMESPACE, parameter_overrides=overrides)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._order = publisher(self.node, THRUSTER_HEALTH_ORDER)
        self._listed_at = Stamp(0)
        self._window = order_window(mock=mock)
        self._refusals = Refusals()
        self._untimed_list: Any = None
        self.troubles: dict[str, str] = {}
        """Problem that each node reports; empty when it is well."""
        subscription(self.node, THRUSTER_HEALTH, self._on_health)
        subscription(self.node, DIAGNOSTICS, self._on_diagnostics)
        self._without_operator = without_operator
        self._link = LinkMonitor()
        self._messages: list[str] = []
        if without_operator != STAY:
            self._set_up_link()

    def _set_up_link(self) -> None:
        self._cancel = self.node.create_client(CancelGoal, "maneuver/fly/_action/cancel_goal")
        self._arm = self.node.create_client(Arm, "thrusters/arm")
        self._reporter, self._report_s = DiagnosticsPublisher(self.node), 0.0
        subscription(self.node, HEARTBEAT, self._on_heartbeat)

    def __enter__(self) -> Self:
        """Nothing to open: the node is up when it is made."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def spin(self, seconds: float = 0.1) -> None:
        """Spin once."""
        self._executor.spin_once(timeout_sec=seconds)
        if self._untimed_list is not None and self._now() > 0:
            message, self._untimed_list = self._untimed_list, None
            self._on_health(message)
        if self._without_operator != STAY:
            self._check_link(time.monotonic())

    def new_messages(self) -> list[str]:
        """Return the messages for the operator since the last call, one sentence each."""
        messages, self._messages = self._messages, []
        return messages

    def _on_heartbeat(self, beat: Any) -> None:
        """Accept a heartbeat unless it is stale (queued on a dead link) or its clock is wrong."""
        untimely = self._window.judge(stamp_from_msg(beat.header.stamp), self._now())
        if untimely is None:
            message = self._link.beat(time.monotonic())
            self._messages += [message] if message else []
        elif untimely.kind != TIMELESS:
            self._refuse(HEARTBEAT, f"the heartbeat is {untimely.sentence}")

    def _refuse(self, topic: Topic, why: str) -> None:
        """Count a refused message; the first one of a topic is reported at once, diagnostics show the count."""
        known = topic.name in self._refusals.counts
        sentence = self._refusals.add(topic.name, why)
        self._messages += [] if known else [f"refused: {sentence}"]

    def _check_link(self, now_s: float) -> None:
        allowed_s = self._link.allowed_s
        if self._link.step(now_s):
            self._act_on_lost_link(allowed_s)
            self._report_s = 0.0  # report a loss at once
        if now_s - self._report_s >= REPORT_S:
            self._report_s = now_s
            refused = self._refusals.new_refusals()
            level = DiagnosticStatus.WARN if self._link.lost or refused else DiagnosticStatus.OK
            words = "; ".join([self._link.status_text(now_s), *refused])
            values = {"age [s]": f"{self._link.silent_s(now_s):.1f}"} | self._refusals.values()
            found = status(f"hindrax: {LINK}", level, words, values)
            self._reporter.publish(self._now(), found)

    def _act_on_lost_link(self, silent_s: float) -> None:
        """Put the vehicle into the state chosen for a lost link, without waiting for the answers."""
        # A request without an id and without a stamp means all goals (action_msgs/srv/CancelGoal).
        self._cancel.call_async(CancelGoal.Request())
        if self._without_operator == NEUTRAL:
            request = Arm.Request(arm=False, reason=f"no operator for {silent_s:g} s")
            request.stamp = stamp_to_msg(self._now())
            self._arm.call_async(request)
        what = "disarming" if self._without_operator == NEUTRAL else "maneuvers end, holds stay"
        self._messages.append(f"link: no operator for {silent_s:g} s; {what}")

    def _now(self) -> Stamp:
        return Stamp(self.node.get_clock().now().nanoseconds)

    def _on_health(self, message: Any) -> None:
        """Latch the newest list as an order, for a pilot that restarts without one."""
        stamp, now = stamp_from_msg(message.header.stamp), self._now()
        if now <= 0:
            self._untimed_list = message
            return
        # A pilot that has received no list publishes one stamped zero.
        untimely = self._window.of_lists.judge(stamp, Stamp(max(now, self._listed_at))) if stamp != 0 else None
        if untimely is not None:
            self._refuse(THRUSTER_HEALTH, f"the list is {untimely.sentence}")
        elif stamp > self._listed_at:
            self._listed_at = stamp
            self._order.publish(message)

    def _on_diagnostics(self, message: Any) -> None:
        for one in message.status:
            name = one.name.removeprefix("hindrax: ")
            if name == LINK:  # reported by `new_messages`; a lost operator is no fault of the vehicle
                continue
            self.troubles[name] = "" if one.level == b"\x00" else one.message
