"""A leak probe on a GPIO line alone: ros2 launch hindrax_drivers sos_leak.launch.py port:=gpio:pinctrl-bcm2711."""

from hindrax_drivers.launch_description import device
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Its node; `--show-args` lists its settings."""
    return device("sos_leak")
