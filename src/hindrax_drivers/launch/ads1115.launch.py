"""A TI ADS1115 behind a power sense module alone: ros2 launch hindrax_drivers ads1115.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("ads1115")
