"""The drivers of the sensors of `hindrax_core.sensor_table`, found by the names of their files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

from hindrax_core.sensor_table import SENSORS, Sensor, Wire
from hindrax_drivers.driver import Driver

PORTS: Mapping[Wire, str] = {"serial": "/dev/ttyUSB0", "i2c": "/dev/i2c-1", "gpio": "gpio:pinctrl-bcm2711"}
"""Port of a device that stands alone, where nobody names one."""


@dataclass(frozen=True, slots=True)
class SensorDriver(Driver):
    """The driver behind a row of the table of sensors, and the wire that the row names."""

    wire: Wire
    serial: bool


def _of(sensor: Sensor) -> SensorDriver:
    driver: Driver = import_module(f"hindrax_drivers.devices.{sensor.name}").DRIVER
    return SensorDriver(driver.knobs, driver.make, sensor.wire, sensor.serial)


DEVICES: dict[str, SensorDriver] = {sensor.name: _of(sensor) for sensor in SENSORS}
