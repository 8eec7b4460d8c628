"""Sensor readings in SI units. One dataclass per kind of reading; a reading does not carry its time."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

Vec3: TypeAlias = tuple[float, float, float]
Vec6: TypeAlias = tuple[float, float, float, float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
"""w, x, y, z; rotates a vector from the body into the reference frame."""


def vec6(values: Iterable[float]) -> Vec6:
    """Six values as a tuple; ValueError if there are more or fewer."""
    X, Y, Z, K, M, N = values
    return (X, Y, Z, K, M, N)


@dataclass(frozen=True, slots=True)
class Reading:
    """One of the readings below."""


@dataclass(frozen=True, slots=True)
class Inertial(Reading):
    """Specific force (at rest and level: +g on the axis that points up) and angular rate, in the sensor's own axes."""

    specific_force_mps2: Vec3
    rate_radps: Vec3
    temperature_C: float


@dataclass(frozen=True, slots=True)
class Magnetic(Reading):
    """Magnetic flux density in the axes of the inertial sensor it is packaged with."""

    field_T: Vec3


@dataclass(frozen=True, slots=True)
class Pressure(Reading):
    """Absolute pressure and water temperature."""

    pressure_Pa: float
    temperature_C: float


@dataclass(frozen=True, slots=True)
class Thermal(Reading):
    """Temperature alone, of whatever the sensor is in."""

    temperature_C: float


@dataclass(frozen=True, slots=True)
class Air(Reading):
    """Air in a dry hull: absolute pressure, temperature and relative humidity (0 to 1; NaN where not measured)."""

    pressure_Pa: float
    temperature_C: float
    humidity: float = float("nan")


@dataclass(frozen=True, slots=True)
class Leak(Reading):
    """Whether the probe of a leak sensor is wet."""

    wet: bool


@dataclass(frozen=True, slots=True)
class Echo(Reading):
    """Distance to the strongest echo along the beam, and the instrument's own confidence in it (0 to 1)."""

    range_m: float
    confidence: float
    ping_number: int = 0


@dataclass(frozen=True, slots=True)
class EchoProfile(Reading):
    """Echo strength along the beam: `strength` holds equally spaced samples from `start_m` over `length_m`."""

    range_m: float
    confidence: float
    ping_number: int
    start_m: float
    length_m: float
    gain: int
    strength: bytes


@dataclass(frozen=True, slots=True)
class SonarHealth(Reading):
    """Number, supply and temperatures of an echo sounder; None or NaN where it is not reported."""

    device_id: int | None
    supply_V: float
    processor_C: float
    board_C: float


@dataclass(frozen=True, slots=True)
class BottomVelocity(Reading):
    """Velocity over ground of the DVL in its own frame (x forward, y starboard, z down), mean over the interval.

    While the instrument is unlocked the velocity is None, never zero.
    """

    velocity_mps: Vec3 | None
    sigma_mps: float
    confidence: float
    interval_s: float
    device_us: int


@dataclass(frozen=True, slots=True)
class Beam:
    """One acoustic beam of a DVL; None where the instrument has no value."""

    locked: bool
    velocity_mps: float
    range_m: float | None
    gain_dB: float


@dataclass(frozen=True, slots=True)
class BottomTrack(Reading):
    """Lock, attitude, altitude along the sensor axis and the four beams, as the DVL reports them.

    Roll, pitch and heading are SNAME angles (z down, heading clockwise from north). Altitude is None when unlocked.
    """

    locked: bool
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    altitude_m: float | None
    velocity_north_east_mps: tuple[float, float]
    beams: tuple[Beam, ...]
    imu_calibration: str
    skipped_pings: int


@dataclass(frozen=True, slots=True)
class Position(Reading):
    """Place that a DVL reckons from its start, its last GPS fix or a position that it was given [deg].

    `fixed`: a GPS gives it at the moment. Without one and without a given position, the device starts at 0, 0.
    """

    latitude_deg: float
    longitude_deg: float
    fixed: bool


@dataclass(frozen=True, slots=True)
class KalmanSupport(Reading):
    """Numbers that a DVL offers to a Kalman filter outside: `groups` in their order, NaN for what is no number.

    `version` is the device's bit vector of the groups present.
    """

    version: int
    sequence: int
    interval_s: float
    groups: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class DeviceText(Reading):
    """A text line of a device, for the log."""

    text: str


@dataclass(frozen=True, slots=True)
class Battery(Reading):
    """Supply voltage; current is NaN where it is not measured."""

    voltage_V: float
    current_A: float = float("nan")


@dataclass(frozen=True, slots=True)
class AppliedPulses(Reading):
    """Pulses that an output reports, thrusters then lights in the order of the vehicle file [us]."""

    pulses_us: tuple[float, ...]
