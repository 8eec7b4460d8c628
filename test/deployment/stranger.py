"""A foreign process that tries to see and command a vehicle: prints after some seconds, as JSON, how far it got."""

import json
import sys
import time

import rclpy

from hindrax_core.topics import OPERATOR_WRENCH, THRUSTER_STATE
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, subscription

rclpy.init()
node = rclpy.create_node("stranger", namespace="/hindrax")
received: list[object] = []
subscription(node, THRUSTER_STATE, received.append)
push = publisher(node, OPERATOR_WRENCH)
arm = node.create_client(Arm, "thrusters/arm")
deadline = time.monotonic() + float(sys.argv[1])
while time.monotonic() < deadline and not (received and push.get_subscription_count() and arm.service_is_ready()):
    rclpy.spin_once(node, timeout_sec=0.1)
found = {
    "nodes": sorted(set(node.get_node_names()) - {"stranger"}),
    "heard": len(received),
    "readers": push.get_subscription_count(),
    "arm": arm.service_is_ready(),
}
json.dump(found, sys.stdout)
