"""A Bosch BME280 or BMP280 alone: ros2 launch hindrax_drivers bme280.launch.py port:=/dev/i2c-1."""

from hindrax_drivers.nodes.launch_description import device

generate_launch_description = device("bme280")
