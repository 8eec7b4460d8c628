"""The drivers of the sensors of `hindrax_core.sensor_table`, found by the names of their files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from hindrax_core.sensor_table import SENSORS, Sensor, Wire
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.driver import Driver

PORTS: Mapping[Wire, str] = {"serial": "/dev/ttyUSB0", "i2c": "/dev/i2c-1", "gpio": "gpio:pinctrl-bcm2711"}
"""Port of a device that stands alone, where nobody names one."""


@dataclass(frozen=True, slots=True)
class Row:
    """Constructor of a device from its knobs, mount and vehicle, and its kind of wire."""

    knobs: type[Any]
    make: Callable[[Any, Mount, Vehicle], Any]
    wire: Wire
    meaning: str

    @property
    def serial(self) -> bool:
        """Whether it is on a serial line; all others are on a register bus."""
        return self.wire == "serial"


def _row(sensor: Sensor) -> Row:
    driver: Driver = import_module(f"hindrax_drivers.devices.{sensor.name}").DRIVER
    return Row(driver.knobs, driver.make, sensor.wire, sensor.meaning)


DEVICES: dict[str, Row] = {sensor.name: _row(sensor) for sensor in SENSORS}
