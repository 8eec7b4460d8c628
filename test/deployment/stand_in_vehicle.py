"""What a stranger would look for: thrusters that say their state and can be armed, and somebody who takes wrenches.

The graph is that of `up`: this machine, or the tether that is named.
"""

import rclpy

from hindrax_bringup.network.tether import tether_setting
from hindrax_bringup.stack import adopted, environment
from hindrax_core.topics import OPERATOR_WRENCH, THRUSTER_STATE
from hindrax_msgs.msg import ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, subscription

with adopted(environment(mock=False, domain=None, tether=tether_setting())):
    rclpy.init()
    node = rclpy.create_node("thrusters", namespace="/hindrax")
    state = publisher(node, THRUSTER_STATE)
    subscription(node, OPERATOR_WRENCH, lambda _message: None)
    node.create_service(Arm, "thrusters/arm", lambda _request, response: response)

    def say() -> None:
        message = ThrusterState()
        message.header.stamp = node.get_clock().now().to_msg()
        state.publish(message)

    node.create_timer(0.1, say)
    rclpy.spin(node)
