"""A TI ADS1115 behind a power sense module alone: ros2 launch hindrax_drivers ads1115.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.launch_description import device
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Its node; `--show-args` lists its settings."""
    return device("ads1115")
