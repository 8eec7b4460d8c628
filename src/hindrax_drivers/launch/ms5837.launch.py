"""A TE MS5837 (Bar30, Bar02) alone: ros2 launch hindrax_drivers ms5837.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ms5837")
