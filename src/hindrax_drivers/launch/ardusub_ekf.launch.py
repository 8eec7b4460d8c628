"""Velocity by ArduSub's estimator alone: ros2 launch hindrax_drivers ardusub_ekf.launch.py port:=udpin:0.0.0.0:14550."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ardusub_ekf")
