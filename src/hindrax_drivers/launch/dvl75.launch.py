"""A Cerulean DVL-75 or Tracker 650 alone: ros2 launch hindrax_drivers dvl75.launch.py port:=/dev/ttyUSB0."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("dvl75")
