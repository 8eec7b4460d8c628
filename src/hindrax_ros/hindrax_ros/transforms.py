"""The frames of the vehicle on /tf and /tf_static: odom -> base_link -> everything that is fixed to it."""

from collections.abc import Callable

from geometry_msgs.msg import Quaternion, Transform, TransformStamped
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from hindrax_core.events import Stamped
from hindrax_core.messages.frames import Frame, frames_of, urdf_of
from hindrax_core.rotation import FLU, xyzw
from hindrax_core.signals import Navigation
from hindrax_core.topics import ROBOT_DESCRIPTION, TF, TF_STATIC
from hindrax_core.vehicle import Vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.graph import publisher
from hindrax_ros.messages.convert import header, quaternion_from_sname, vector_to_msg


def base_of(stamped: Stamped[Navigation], prefix: str = "") -> TransformStamped:
    """Pose of `base_link` in `odom`, as the odometry has it."""
    (north, east), depth_m = stamped.reading.position_m, stamped.reading.depth_m
    rotation = quaternion_from_sname(*stamped.reading.attitude_rad)
    pose = Transform(translation=vector_to_msg((east, north, -depth_m)), rotation=rotation)
    return TransformStamped(header=header(stamped.stamp, f"{prefix}odom"), child_frame_id=prefix + FLU, transform=pose)


def fixed(frame: Frame, prefix: str = "") -> TransformStamped:
    """From base_link to a frame that is fixed to it."""
    x, y, z, w = xyzw(*frame.rpy_rad)
    pose = Transform(translation=vector_to_msg(frame.position_m), rotation=Quaternion(x=x, y=y, z=z, w=w))
    return TransformStamped(header=header(0, prefix + FLU), child_frame_id=prefix + frame.name, transform=pose)


def transform_publisher(node: BatchedNode, vehicle: Vehicle, prefix: str = "") -> Callable[[Stamped[Navigation]], None]:
    """Publish the description of a vehicle and its fixed frames.

    Parameters
    ----------
    node
        That publishes.
    vehicle
        Mounts and thrusters.
    prefix
        Of the frames. The links of the description have none: RViz and robot_state_publisher put one before them.

    Returns
    -------
    Callable[[Stamped[Navigation]], None]
        Publishes the pose of base_link.
    """
    publisher(node, ROBOT_DESCRIPTION).publish(String(data=urdf_of(vehicle)))
    publisher(node, TF_STATIC).publish(TFMessage(transforms=[fixed(frame, prefix) for frame in frames_of(vehicle)]))
    moving = publisher(node, TF)
    return lambda found: moving.publish(TFMessage(transforms=[base_of(found, prefix)]))
