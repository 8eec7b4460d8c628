"""A Cerulean DVL-75 or Tracker 650 alone: ros2 launch hindrax_drivers dvl75.launch.py port:=/dev/ttyUSB0."""

from hindrax_drivers.launch_description import device
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Its node; `--show-args` lists its settings."""
    return device("dvl75")
