"""Table of all sensors: drivers, emulators, topics, faults, processes and docs read it.

A sensor called NAME is a driver `hindrax_drivers/devices/NAME.py` (which offers DRIVER), an emulator
`hindrax_sim/devices/NAME.py` (which offers EMULATOR), golden cases in `test/golden/NAME/` and a row here. The name of a
sensor in the vehicle file is that of its row: topics are found by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sensor:
    """One row: name, wire (a serial line, or else I2C), what it publishes and how often [Hz], meaning.

    `publishes` has the quantities of `hindrax_core.topics.QUANTITIES`; a rate of 0 is: now and then.
    """

    name: str
    serial: bool
    publishes: Mapping[str, float]
    meaning: str


SENSORS: tuple[Sensor, ...] = (
    Sensor(
        "dvl75",
        serial=True,
        publishes={"velocity": 20, "attitude": 20, "detail": 20, "altitude": 20, "position": 20},
        meaning="Cerulean DVL-75",
    ),
    Sensor("ping1d", serial=True, publishes={"range": 20, "profile": 0}, meaning="Blue Robotics Ping"),
    Sensor("icm20948", serial=False, publishes={"data_raw": 225, "mag": 25}, meaning="TDK ICM-20948 with AK09916"),
    Sensor("ms5837", serial=False, publishes={"pressure": 50, "temperature": 5}, meaning="TE MS5837 (Bar30, Bar02)"),
)
