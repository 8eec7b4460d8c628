"""The drivers of the sensors of `hindrax_core.sensor_table`, found by the modules that its rows name."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib import import_module

from hindrax_core.errors import UsageError, cause
from hindrax_core.sensor_table import Wire, row_of
from hindrax_drivers.driver import Driver

PORTS: Mapping[Wire, str] = {"serial": "/dev/ttyUSB0", "i2c": "/dev/i2c-1", "gpio": "gpio:pinctrl-bcm2711"}
"""Default port of a single device."""


@cache
def driver_of(device: str) -> Driver:
    """Driver of a kind of sensor. UsageError for an unknown kind, and where the package of another has none."""
    try:
        row = row_of(device)
    except ValueError as error:
        raise UsageError(f"device: {error}") from error
    try:
        driver: Driver = import_module(row.driver_module).DRIVER
    except (ImportError, AttributeError) as error:
        raise UsageError(f"{device}: {row.driver_module} offers no DRIVER ({cause(error)})") from error
    return replace(driver, wire=row.wire)
