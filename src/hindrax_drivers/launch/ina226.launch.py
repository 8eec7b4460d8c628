"""A TI INA226 alone: ros2 launch hindrax_drivers ina226.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ina226")
