"""The node `teleop`: joystick and velocity messages in, `operator/wrench` out. Run it where the operator sits.

Velocities (geometry_msgs/Twist) carry no time of their own: they get that of their arrival here, so a link with delays
belongs behind this node, not before it. Whatever stops, the vehicle forgets the last wrench half a second later.
"""

import sys
import time

from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy

from hindrax_control.teleop import Teleop, TeleopKnobs
from hindrax_core.events import to_s
from hindrax_core.readings import Vec6
from hindrax_core.topics import JOYSTICK, NAMESPACE, OPERATOR_WRENCH, TWIST
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_from_msg, wrench_to_msg
from hindrax_ros.parameters import CheckedNode, frame_prefix, knobs, text
from hindrax_ros.process import spin


class TeleopNode(CheckedNode):
    """Stamps and publishes the operator's wrench; the vehicle checks it."""

    def __init__(self, vehicle: Vehicle | None = None) -> None:
        super().__init__("teleop", namespace=NAMESPACE)
        file = text(self, "vehicle", "", "vehicle file, for the limits of its wrench [-]")
        limits = (vehicle or load_vehicle(file)).limits.wrench

        def begin(tuned: TeleopKnobs) -> None:
            self._teleop = Teleop(limits, tuned)

        begin(knobs(self, TeleopKnobs, begin))
        self._out, self._prefix = publisher(self, OPERATOR_WRENCH), frame_prefix(self)
        subscription(self, JOYSTICK, self._on_joystick)
        subscription(self, TWIST, self._on_twist)

    def _on_joystick(self, message: Joy) -> None:
        made_s = to_s(stamp_from_msg(message.header.stamp))
        self._publish(self._teleop.joystick(message.axes, message.buttons, made_s, time.monotonic()))

    def _on_twist(self, message: Twist) -> None:
        linear, angular = message.linear, message.angular
        self._publish(self._teleop.twist((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)))

    def _publish(self, wrench: Vec6 | None) -> None:
        if wrench is not None:
            self._out.publish(wrench_to_msg(self.now(), wrench, self._prefix))


def main() -> int:
    """Run until a signal."""
    return spin(lambda: [TeleopNode()])


if __name__ == "__main__":
    sys.exit(main())
