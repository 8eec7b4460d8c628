"""Table of all sensors: drivers, emulators, topics, faults, processes and docs read it.

A sensor called NAME is a driver `hindrax_drivers/devices/NAME.py` (which offers DRIVER), an emulator
`hindrax_sim/devices/NAME.py` (which offers EMULATOR), golden cases in `test/golden/NAME/` and a row here. The name of a
sensor in the vehicle file is that of its row: topics are found by it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

Wire: TypeAlias = Literal["serial", "i2c", "gpio"]
SHARED = ("battery", "leak")
"""Quantities of the vehicle as a whole: their topics have no name of a sensor, and one sensor measures them."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One row: name, wire, what it publishes and how often [Hz], meaning.

    `publishes` has the quantities of `hindrax_core.topics.QUANTITIES`; a rate of 0 is: now and then.
    """

    name: str
    wire: Wire
    publishes: Mapping[str, float]
    meaning: str

    @property
    def serial(self) -> bool:
        """Whether it is on a serial line; all others are on a register bus."""
        return self.wire == "serial"


_DVL = dict.fromkeys(("velocity", "attitude", "detail", "altitude", "position"), 20)
_AIR = dict.fromkeys(("pressure", "temperature", "humidity"), 5)
_PING = {"range": 20, "profile": 0, "supply": 0.1, "processor_temperature": 0.1, "board_temperature": 0.1}

SENSORS: tuple[Sensor, ...] = (
    Sensor("dvl75", "serial", _DVL, "Cerulean DVL-75"),
    Sensor("ping1d", "serial", _PING, "Blue Robotics Ping"),
    Sensor("icm20948", "i2c", {"data_raw": 225, "mag": 25, "die_temperature": 1}, "TDK ICM-20948 with AK09916"),
    Sensor("ms5837", "i2c", {"pressure": 50, "temperature": 5}, "TE MS5837 (Bar30, Bar02)"),
    Sensor("bme280", "i2c", _AIR, "Bosch BME280 or BMP280, air in the hull"),
    Sensor("ina226", "i2c", {"battery": 10}, "TI INA226, supply voltage and current"),
    Sensor("ads1115", "i2c", {"battery": 10}, "TI ADS1115 behind a power sense module"),
    Sensor("sos_leak", "gpio", {"leak": 10}, "Blue Robotics SOS or any leak probe on a GPIO"),
)
