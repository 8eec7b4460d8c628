"""A Water Linked DVL A50 or A125 alone: ros2 launch hindrax_drivers a50.launch.py port:=tcp://192.168.2.95:16171."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("a50")
