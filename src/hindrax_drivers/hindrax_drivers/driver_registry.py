"""The drivers of the sensors of `hindrax_core.sensor_table`, found by the names of their files."""

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module

from hindrax_core.sensor_table import SENSORS, Wire
from hindrax_drivers.driver import Driver

PORTS: Mapping[Wire, str] = {"serial": "/dev/ttyUSB0", "i2c": "/dev/i2c-1", "gpio": "gpio:pinctrl-bcm2711"}
"""Default port of a single device."""


DEVICES: dict[str, Driver] = {
    one.name: replace(import_module(f"hindrax_drivers.devices.{one.name}").DRIVER, wire=one.wire) for one in SENSORS
}
