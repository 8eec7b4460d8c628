"""The emulators of the sensors of `hindrax_core.sensor_table`, found by the names of their files."""

from __future__ import annotations

from importlib import import_module

from hindrax_core.sensor_table import SENSORS
from hindrax_sim.devices.emulator import Emulator


def _emulator(name: str) -> Emulator:
    found: Emulator = import_module(f"hindrax_sim.devices.{name}").EMULATOR
    return found


EMULATORS: dict[str, Emulator] = {sensor.name: _emulator(sensor.name) for sensor in SENSORS}
SERIAL = frozenset(sensor.name for sensor in SENSORS if sensor.serial)
