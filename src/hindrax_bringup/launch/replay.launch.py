"""A recorded run on the real nodes: `ros2 launch hindrax_bringup replay.launch.py bag:=runs/today/bag`.

Its wire frames come to the ports of the devices again, in their own time. To compare the outcome with the record, use
`./hindrax replay --ros`; this one is for inspection with any ROS tool. The maneuver is the recorded one.
"""

from hindrax_bringup.launch_actions import stack
from hindrax_bringup.stack import ReplayOptions
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The record, and the nodes that compute on it; everything ends with it."""
    arguments = {
        "bag": (None, "folder of a bag, or one of its files"),
        "rate": ("1", "times real time; 0: as fast as possible"),
    }
    return stack(arguments, ReplayOptions)
