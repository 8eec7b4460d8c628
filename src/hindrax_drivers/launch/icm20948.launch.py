"""A TDK ICM-20948 alone: ros2 launch hindrax_drivers icm20948.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("icm20948")
