"""The frames of the vehicle on /tf and /tf_static, where tf2_msgs is installed: odom -> base_link -> base_link_fsd."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Navigation
from hindrax_ros.convert import FLU, FSD, odometry_to_msg, stamp_to_msg
from hindrax_ros.optional_messages import optional_class

TYPE = "tf2_msgs/msg/TFMessage"
STATIC = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As tf2_ros wants them: late listeners get what never changes."""
MOVING = QoSProfile(depth=100)


def base_of(odometry: Odometry) -> TransformStamped:
    """Pose of the child frame of an odometry in its parent frame, as a transform of the same stamp."""
    found = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    position = odometry.pose.pose.position
    found.transform.translation.x, found.transform.translation.y = position.x, position.y
    found.transform.translation.z = position.z
    found.transform.rotation = odometry.pose.pose.orientation
    return found


def half_turn_about_x(stamp: Stamp) -> TransformStamped:
    """From base_link (x forward, y left, z up) to base_link_fsd (x forward, y starboard, z down)."""
    found = TransformStamped(child_frame_id=FSD)
    found.header.stamp, found.header.frame_id = stamp_to_msg(stamp), FLU
    found.transform.rotation.x, found.transform.rotation.w = 1.0, 0.0
    return found


class Transforms:
    """Publishes the transforms of a node; does nothing where tf2_msgs is not installed."""

    def __init__(self, node: Node) -> None:
        self._type = optional_class(TYPE)
        self._out: Any = None
        if self._type is not None:
            self._out = Node.create_publisher(node, self._type, "/tf", MOVING)
            self._fixed = Node.create_publisher(node, self._type, "/tf_static", STATIC)
            now = Stamp(node.get_clock().now().nanoseconds)
            self._fixed.publish(self._type(transforms=[half_turn_about_x(now)]))

    def publish(self, found: Stamped[Navigation]) -> None:
        """Publish the pose of base_link."""
        if self._out is not None:
            self._out.publish(self._type(transforms=[base_of(odometry_to_msg(found))]))
