"""The watchman of a stack that is kept up: sees its health, its operator, and which thrusters are out of use.

The list of thrusters out of use is the pilot's, and dies with it. The keeper holds it for as long as the stack runs, so
that a control process that is started again does not use a broken thruster.

Where the operator is at the other end of a tether, the keeper ends what is being flown once the heartbeat is gone; what
an operator had ordered by hand has expired by then.
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

from hindrax_bringup.link_watch import LinkWatch
from hindrax_core.events import Stamp
from hindrax_core.topics import DIAGNOSTICS, HEARTBEAT, NAMESPACE, THRUSTER_HEALTH, THRUSTER_HEALTH_ORDER
from hindrax_msgs.srv import Arm
from hindrax_ros.convert import stamp_from_msg, stamp_to_msg
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.health import Reporter, status

HOLD, NEUTRAL, STAY = "hold", "neutral", "stay"
"""What to do without an operator: end the maneuver and hold, disarm as well, or nothing (a stack without a tether)."""
REPORT_S = 1.0
LINK = "link"


class Keeper:
    """One light node; use it as a context manager and turn it often."""

    def __init__(self, *, mock: bool, without_operator: str = STAY) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        overrides = [Parameter("use_sim_time", Parameter.Type.BOOL, mock)]
        self.node = rclpy.create_node("keeper", namespace=NAMESPACE, parameter_overrides=overrides)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._order = publisher(self.node, THRUSTER_HEALTH_ORDER)
        self._listed_at = Stamp(0)
        self.troubles: dict[str, str] = {}
        """What each node says is wrong; empty text when all is well."""
        subscription(self.node, THRUSTER_HEALTH, self._on_health)
        subscription(self.node, DIAGNOSTICS, self._on_diagnostics)
        self._without_operator = without_operator
        self._link = LinkWatch()
        self._news: list[str] = []
        if without_operator != STAY:
            self._look_after_link()

    def _look_after_link(self) -> None:
        self._cancel = self.node.create_client(CancelGoal, "maneuver/fly/_action/cancel_goal")
        self._arm = self.node.create_client(Arm, "thrusters/arm")
        self._reporter, self._report_s = Reporter(self.node), 0.0
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
        """Turn once."""
        self._executor.spin_once(timeout_sec=seconds)
        if self._without_operator != STAY:
            self._watch_link(time.monotonic())

    def news(self) -> list[str]:
        """Return what is to be said since the last time, one sentence each."""
        said, self._news = self._news, []
        return said

    def _on_heartbeat(self, _message: Any) -> None:
        news = self._link.beat(time.monotonic())
        self._news += [news] if news else []

    def _watch_link(self, now_s: float) -> None:
        if self._link.step(now_s):
            self._leave_alone()
            self._report_s = 0.0  # a loss is told at once
        if now_s - self._report_s >= REPORT_S:
            self._report_s = now_s
            level = DiagnosticStatus.WARN if self._link.lost else DiagnosticStatus.OK
            words = self._link.words(now_s)
            found = status(f"hindrax: {LINK}", level, words, {"age [s]": f"{self._link.silent_s(now_s):.1f}"})
            self._reporter.publish(self._now(), found)

    def _leave_alone(self) -> None:
        """Bring the vehicle into the state that was chosen for a lost link; the answers are not waited for."""
        # A request without an id and without a stamp means all goals (action_msgs/srv/CancelGoal).
        self._cancel.call_async(CancelGoal.Request())
        if self._without_operator == NEUTRAL:
            request = Arm.Request(arm=False, sequence=time.time_ns() // 1_000_000 % (1 << 32))
            request.stamp = stamp_to_msg(self._now())
            self._arm.call_async(request)
        what = "disarming" if self._without_operator == NEUTRAL else "maneuvers end, holds stay"
        self._news.append(f"link: no operator for {self._link.patience_s:g} s; {what}")

    def _now(self) -> Stamp:
        return Stamp(self.node.get_clock().now().nanoseconds)

    def _on_health(self, message: Any) -> None:
        """Keep the newest list as a latched order, for a pilot that starts anew with none."""
        stamp = stamp_from_msg(message.header.stamp)
        if stamp > self._listed_at:
            self._listed_at = stamp
            self._order.publish(message)

    def _on_diagnostics(self, message: Any) -> None:
        for one in message.status:
            name = one.name.removeprefix("hindrax: ")
            if name == LINK:  # said by `news`; a vehicle without an operator is not ill
                continue
            self.troubles[name] = "" if one.level == b"\x00" else one.message
