"""The frames of the vehicle on /tf and /tf_static: odom -> base_link -> everything that is fixed to it."""

from __future__ import annotations

from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from hindrax_core.events import Stamped
from hindrax_core.rotation import FLU
from hindrax_core.signals import Navigation
from hindrax_core.topics import ROBOT_DESCRIPTION, TF, TF_STATIC
from hindrax_core.vehicle import Vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.graph import publisher
from hindrax_ros.messages.convert import odometry_to_msg, xyzw
from hindrax_ros.messages.frames import Frame, frames_of, urdf_of


def base_of(odometry: Odometry) -> TransformStamped:
    """Pose of the child frame of an odometry in its parent frame, as a transform of the same stamp."""
    found = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    position = odometry.pose.pose.position
    found.transform.translation.x, found.transform.translation.y = position.x, position.y
    found.transform.translation.z = position.z
    found.transform.rotation = odometry.pose.pose.orientation
    return found


def fixed(frame: Frame) -> TransformStamped:
    """From base_link to a frame that is fixed to it."""
    found = TransformStamped(child_frame_id=frame.name)
    found.header.frame_id = FLU
    place = found.transform.translation
    place.x, place.y, place.z = frame.position_m
    x, y, z, w = xyzw(*frame.rpy_rad)
    found.transform.rotation = Quaternion(x=x, y=y, z=z, w=w)
    return found


class Transforms:
    """Publishes the transforms and the description of a vehicle."""

    def __init__(self, node: BatchedNode, vehicle: Vehicle) -> None:
        self._moving = publisher(node, TF)
        self._fixed = publisher(node, TF_STATIC)
        self._fixed.publish(TFMessage(transforms=[fixed(frame) for frame in frames_of(vehicle)]))
        self._description = publisher(node, ROBOT_DESCRIPTION)
        self._description.publish(String(data=urdf_of(vehicle)))

    def publish(self, found: Stamped[Navigation]) -> None:
        """Publish the pose of base_link."""
        self._moving.publish(TFMessage(transforms=[base_of(odometry_to_msg(found))]))
