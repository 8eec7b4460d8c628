"""Thrusters on an NXP PCA9685 alone: ros2 launch hindrax_drivers pca9685.launch.py channels:=[0,1,2,3]."""

from hindrax_drivers.nodes.launch_description import thrusters as generate_launch_description  # noqa: F401  # read by launch
