"""Any sensor alone, also one of an installed package: ros2 launch hindrax_drivers sensor.launch.py device:=tsys01."""

from hindrax_drivers.nodes.launch_description import any_device

generate_launch_description = any_device
