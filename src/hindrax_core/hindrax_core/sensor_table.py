"""Table of all sensors: drivers, emulators, topics, faults, processes and docs read it.

A sensor called NAME is a driver `hindrax_drivers/devices/NAME.py` (which offers DRIVER), an emulator
`hindrax_sim/devices/NAME.py` (which offers EMULATOR), golden cases in `test/golden/NAME/` and a row here. A sensor of
another package is a row too: an entry point of the group `hindrax.sensors` that names its `Sensor`.

Nothing asks for a sensor by the name of its kind. What a node needs is a capability (`Vehicle.measuring("depth")`); any
number of sensors have it, under the names that the vehicle file gives them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Wire: TypeAlias = Literal["serial", "i2c", "gpio"]
Capability: TypeAlias = Literal[
    "velocity", "depth", "altitude", "range", "range_ahead", "range_aside", "attitude", "rates", "field", "supply",
    "leak", "air", "temperature",
]  # fmt: skip
"""What a sensor measures. The mount decides about a `range`: downward it is the altitude, forward the range ahead, to
either side the range aside."""
GROUP = "hindrax.sensors"
"""Group of the entry points of sensors in other packages."""
SHARED = ("battery", "leak")
"""Quantities of the vehicle as a whole: their topics have no name of a sensor."""

QUANTITIES: Mapping[str, tuple[str, str]] = {
    "velocity": ("geometry_msgs/msg/TwistWithCovarianceStamped", "velocity over ground"),
    "attitude": ("sensor_msgs/msg/Imu", "attitude of the DVL's own IMU"),
    "detail": ("hindrax_msgs/msg/Dvl", "lock, beams, confidence, device time"),
    "altitude": ("sensor_msgs/msg/Range", "distance along the DVL axis"),
    "position": ("sensor_msgs/msg/NavSatFix", "position by the DVL's own dead reckoning, and whether a GPS gives it"),
    "range": ("sensor_msgs/msg/Range", "distance along the beam, sonar"),
    "profile": ("hindrax_msgs/msg/PingProfile", "echo profile, on request"),
    "die_temperature": ("sensor_msgs/msg/Temperature", "temperature of the die"),
    "supply": ("sensor_msgs/msg/BatteryState", "supply voltage of the device"),
    "processor_temperature": ("sensor_msgs/msg/Temperature", "temperature of the device's processor"),
    "board_temperature": ("sensor_msgs/msg/Temperature", "temperature of the device's board"),
    "data_raw": ("sensor_msgs/msg/Imu", "specific force and angular rate"),
    "mag": ("sensor_msgs/msg/MagneticField", "magnetic field"),
    "pressure": ("sensor_msgs/msg/FluidPressure", "absolute pressure"),
    "temperature": ("sensor_msgs/msg/Temperature", "temperature at the sensor"),
    "humidity": ("sensor_msgs/msg/RelativeHumidity", "relative humidity, 0 to 1"),
    "battery": ("sensor_msgs/msg/BatteryState", "supply voltage and current, when measured"),
    "leak": ("std_msgs/msg/Bool", "whether there is water in a dry hull, when measured"),
}
"""Quantity that a sensor can publish: type and meaning."""

CARRIERS: Mapping[Capability, tuple[str, ...]] = {
    "velocity": ("detail",),
    "depth": ("pressure",),
    "altitude": ("range", "altitude"),
    "range_ahead": ("range",),
    "range_aside": ("range",),
    "attitude": ("attitude",),
    "rates": ("data_raw",),
    "field": ("mag",),
    "supply": ("battery",),
    "leak": ("leak",),
}
"""Quantity from which the stack reads a capability: the first that a sensor of the vehicle publishes."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One row: kind, wire, what it publishes and how often [Hz], meaning, and what it measures.

    `publishes` has quantities of `QUANTITIES`; a rate of 0 is: now and then. `driver` and `emulator` are modules that
    offer DRIVER and EMULATOR, for a sensor of another package; those of this stack are found by the name.
    """

    name: str
    wire: Wire
    publishes: Mapping[str, float]
    meaning: str
    measures: tuple[Capability, ...] = ()
    driver: str = ""
    emulator: str = ""
    services: tuple[str, ...] = ()
    """Methods of a serial driver that its node offers as services, `NAME/SERVICE`; each returns what to send."""
    coarse: bool = False
    """Whether its steps are larger than its noise: at rest its inertial samples repeat, and are not frozen."""

    def __post_init__(self) -> None:
        """Quantities are those of the table. ValueError names one that is not."""
        for quantity in self.publishes:
            if quantity not in QUANTITIES:
                raise ValueError(f"publishes: found {quantity!r}, wanted some of {', '.join(QUANTITIES)}")

    @property
    def serial(self) -> bool:
        """Whether it is on a line that carries bytes; all others are on a register bus."""
        return self.wire == "serial"

    @property
    def driver_module(self) -> str:
        """Module that offers its DRIVER."""
        return self.driver or f"hindrax_drivers.devices.{self.name}"

    @property
    def emulator_module(self) -> str:
        """Module that offers its EMULATOR."""
        return self.emulator or f"hindrax_sim.devices.{self.name}"


_DVL = dict.fromkeys(("velocity", "attitude", "detail", "altitude", "position"), 20)
_AIR = dict.fromkeys(("pressure", "temperature", "humidity"), 5)
_PING = {"range": 20, "profile": 0, "supply": 0.1, "processor_temperature": 0.1, "board_temperature": 0.1}
_A50 = dict.fromkeys(("velocity", "detail", "altitude"), 10)
_IMU = {"data_raw": 225, "mag": 25, "die_temperature": 1}
_AUTOPILOT = {"data_raw": 100, "mag": 10, "pressure": 20, "temperature": 2, "leak": 1}
_ESTIMATOR = dict.fromkeys(("velocity", "detail"), 20)
_DEPTH = {"pressure": 50, "temperature": 5}

_OWN_WAY = ("reset_dead_reckoning", "calibrate_gyro")

SENSORS: tuple[Sensor, ...] = (
    Sensor("dvl75", "serial", _DVL, "Cerulean DVL-75", ("velocity", "altitude", "attitude")),
    Sensor(
        "a50",
        "serial",
        _A50,
        "Water Linked DVL A50 or A125",
        ("velocity", "altitude"),
        services=_OWN_WAY,
    ),
    Sensor("ping1d", "serial", _PING, "Blue Robotics Ping", ("range",), services=("request_profile",)),
    Sensor("icm20948", "i2c", _IMU, "TDK ICM-20948 with AK09916", ("rates", "field")),
    Sensor("ms5837", "i2c", _DEPTH, "TE MS5837 (Bar30, Bar02)", ("depth", "temperature")),
    Sensor("bme280", "i2c", _AIR, "Bosch BME280 or BMP280, air in the hull", ("air",)),
    Sensor("ina226", "i2c", {"battery": 10}, "TI INA226, supply voltage and current", ("supply",)),
    Sensor("ads1115", "i2c", {"battery": 10}, "TI ADS1115 behind a power sense module", ("supply",)),
    Sensor("sos_leak", "gpio", {"leak": 10}, "Blue Robotics SOS or any leak probe on a GPIO", ("leak",)),
    Sensor(
        "ardusub",
        "serial",
        _AUTOPILOT,
        "ArduSub: IMU, compass, Bar30, leak",
        ("rates", "field", "depth", "leak"),
        coarse=True,
    ),
    Sensor("ardusub_ekf", "serial", _ESTIMATOR, "velocity by ArduSub's estimator, if aided", ("velocity",)),
    Sensor("ardusub_range", "serial", {"range": 10}, "rangefinder of an ArduSub, such as a Ping", ("range",)),
)
"""The sensors of this stack. The first that publishes a quantity gives its usual topic its name (`topics`)."""
_OWN: Mapping[str, Sensor] = {row.name: row for row in SENSORS}


def row_of(device: str) -> Sensor:
    """Row of a kind of sensor, of this stack or of an installed package.

    Other packages are looked for only where a name is none of ours: that costs a vehicle without them nothing.

    Parameters
    ----------
    device
        The kind, as `sensors.NAME.device` of a vehicle file names it.

    Returns
    -------
    Sensor
        What it measures and publishes, and where driver and emulator are.

    Raises
    ------
    ValueError
        Names the kinds that there are, or why the package of this one cannot be used.
    """
    if device in _OWN:
        return _OWN[device]
    rows, unusable = _installed()
    if device in unusable:
        raise ValueError(f"found {device!r}, whose package cannot be used: {unusable[device]}")
    if device not in rows:
        raise ValueError(f"found {device!r}, wanted one of {', '.join((*_OWN, *rows))}")
    return rows[device]


def all_sensors() -> tuple[Sensor, ...]:
    """Rows of this stack, and those of installed packages."""
    return (*SENSORS, *_installed()[0].values())


def unusable_sensors() -> Mapping[str, str]:
    """Entry points of installed packages that give no row, by their name: why."""
    return _installed()[1]


@cache
def _installed() -> tuple[Mapping[str, Sensor], Mapping[str, str]]:
    """Rows of other packages by name, and why an entry point gives none."""
    from importlib.metadata import entry_points  # noqa: PLC0415  # slow, with all of `email`, and rarely needed

    rows: dict[str, Sensor] = {}
    unusable: dict[str, str] = {}
    for point in entry_points(group=GROUP):
        found = _row_in(point)
        if isinstance(found, str):
            unusable[point.name] = found
        else:
            rows[point.name] = found
    return rows, unusable


def _row_in(point: "EntryPoint") -> Sensor | str:
    """Row that an entry point names, or why it is none. A package of somebody else may fail in any way."""
    where = f"entry point {point.name} = {point.value}"
    try:
        row = point.load()
    except Exception as error:  # noqa: BLE001  # whatever it is, it is said to whoever names this sensor
        return f"{where}: {type(error).__name__}: {error}"
    if not isinstance(row, Sensor) or row.name != point.name:
        return f"{where}: found {row!r}, wanted a Sensor of that name"
    return f"{where}: the name belongs to a sensor of this stack" if point.name in _OWN else row
