"""A TE MS5837 (Bar30, Bar02) alone: ros2 launch hindrax_drivers ms5837.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.launch_description import device
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Its node; `--show-args` lists its settings."""
    return device("ms5837")
