"""What an ArduSub measures, alone: ros2 launch hindrax_drivers ardusub.launch.py port:=udpin:0.0.0.0:14550."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ardusub")
