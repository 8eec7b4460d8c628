"""Velocity by ArduSub's estimator alone: ros2 launch hindrax_drivers ardusub_ekf.launch.py port:=tcp:HOST:PORT."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ardusub_ekf")
