"""A Blue Robotics Ping1D or Ping2 alone: ros2 launch hindrax_drivers ping1d.launch.py port:=/dev/ttyUSB0."""

from hindrax_drivers.launch_description import device
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Its node; `--show-args` lists its settings."""
    return device("ping1d")
