"""A leak probe on a GPIO line alone: ros2 launch hindrax_drivers sos_leak.launch.py port:=gpio:pinctrl-bcm2711."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("sos_leak")
