"""A Blue Robotics Ping1D or Ping2 alone: ros2 launch hindrax_drivers ping1d.launch.py port:=/dev/ttyUSB0."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ping1d")
