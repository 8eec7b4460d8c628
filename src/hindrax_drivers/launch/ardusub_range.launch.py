"""The rangefinder of an ArduSub alone: ros2 launch hindrax_drivers ardusub_range.launch.py port:=tcp:HOST:PORT."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ardusub_range")
