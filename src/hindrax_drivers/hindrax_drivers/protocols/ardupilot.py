"""MAVLink messages between a ground station and ArduPilot: those that are read, and those that are sent.

Fields: message sets common and ardupilotmega, https://mavlink.io/en/messages/. Values are in SI units here.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3
from hindrax_drivers.protocols import mavlink
from hindrax_drivers.protocols.mavlink import AUTOPILOT, READ, Readers, Sent

GROUND_STATION, NO_AUTOPILOT, ACTIVE = 6, 8, 4
"""MAV_TYPE_GCS, MAV_AUTOPILOT_INVALID, MAV_STATE_ACTIVE: what a ground station says of itself."""
SET_MODE, ARM, MOTOR_TEST, SET_INTERVAL, REQUEST = 176, 400, 209, 511, 512
"""MAV_CMD_DO_SET_MODE, COMPONENT_ARM_DISARM, DO_MOTOR_TEST, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE."""
SYS_STATUS, RAW_IMU, SCALED_PRESSURE, ATTITUDE, LOCAL_POSITION, SERVO_OUTPUT, RC_CHANNELS = 1, 27, 29, 30, 32, 36, 65
DISTANCE, SCALED_PRESSURE2, VERSION, SCALED_PRESSURE3, EKF_STATUS, NAMED_FLOAT = 132, 137, 148, 143, 193, 251
UNKNOWN_TEMPERATURE = 0
MILLI_G = 1e-3 * GRAVITY_mps2


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """PARAM_VALUE."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Attitude:
    """ATTITUDE: roll, pitch, yaw [rad] and body rates [rad/s], SNAME axes; time since power-up."""

    boot_ms: int
    angles_rad: Vec3
    rates_radps: Vec3


@dataclass(frozen=True, slots=True)
class RawImu:
    """RAW_IMU: specific force [m/s^2], rate [rad/s] and field [T] in SNAME body axes; time since power-up.

    Calibrated and turned by the autopilot, whatever the name says (ArduPilot, GCS_MAVLINK::send_raw_imu).
    """

    boot_us: int
    force_mps2: Vec3
    rate_radps: Vec3
    field_T: Vec3
    temperature_C: float


@dataclass(frozen=True, slots=True)
class Barometer:
    """SCALED_PRESSURE, 2 or 3: number of the barometer from 1, absolute pressure; NaN for no temperature."""

    boot_ms: int
    number: int
    pressure_Pa: float
    temperature_C: float


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """SERVO_OUTPUT_RAW: pulses of the first sixteen outputs, 0 for none [us]; time since power-up, of 32 bits."""

    boot_us: int
    pulses_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RcChannels:
    """RC_CHANNELS: what the sticks are at, whoever moves them [us]; 65535 for a channel without a value."""

    boot_ms: int
    pulses_us: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class NamedFloat:
    """NAMED_VALUE_FLOAT: such as ArduSub's PilotGain, InputHold, RollPitch."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Version:
    """AUTOPILOT_VERSION: major, minor and patch of the firmware."""

    firmware: tuple[int, int, int]

    def __str__(self) -> str:
        """As releases are called."""
        return ".".join(map(str, self.firmware))


@dataclass(frozen=True, slots=True)
class Supply:
    """SYS_STATUS: voltage and current of the battery, NaN where it is not measured; sensors that are not healthy."""

    voltage_V: float
    current_A: float
    unhealthy: int = 0
    """MAV_SYS_STATUS_SENSOR of those that are enabled."""


@dataclass(frozen=True, slots=True)
class Distance:
    """DISTANCE_SENSOR: distance, and the direction it looks in (MAV_SENSOR_ORIENTATION; 25 is down, 0 ahead)."""

    boot_ms: int
    range_m: float
    orientation: int
    quality: float
    """0 to 1; NaN where it is unknown."""


@dataclass(frozen=True, slots=True)
class EstimatorStatus:
    """EKF_STATUS_REPORT: EKF_STATUS_FLAGS."""

    flags: int


@dataclass(frozen=True, slots=True)
class LocalPosition:
    """LOCAL_POSITION_NED: north, east, down of the origin [m] and velocities [m/s]; time since power-up."""

    boot_ms: int
    position_m: Vec3
    velocity_mps: Vec3


def _text(data: bytes) -> str:
    return data.partition(b"\x00")[0].decode(errors="replace")


def _raw_imu(v: tuple[int, ...]) -> RawImu:
    """Units on the wire: mg, mrad/s, mG, and hundredths of a degree, 0 where there is none."""
    force, rate, field = (_scaled(v[at : at + 3], unit) for at, unit in ((1, MILLI_G), (4, 1e-3), (7, 1e-7)))
    return RawImu(v[0], force, rate, field, math.nan if v[11] == UNKNOWN_TEMPERATURE else v[11] / 100.0)


def _scaled(v: tuple[int, ...], unit: float) -> Vec3:
    x, y, z = v
    return unit * x, unit * y, unit * z


def _barometer(number: int) -> tuple[struct.Struct, Callable[[tuple[float, ...]], Barometer]]:
    def read(v: tuple[float, ...]) -> Barometer:
        return Barometer(int(v[0]), number, 100.0 * v[1], math.nan if v[3] == UNKNOWN_TEMPERATURE else v[3] / 100.0)

    return struct.Struct("<Iffhh"), read


def _servo_output(v: tuple[int, ...]) -> ServoOutput | None:
    """None for the outputs from 17 on: a board with so many sends them right behind the others, as those of port 1."""
    port = v[9]
    return None if port else ServoOutput(v[0], tuple(map(float, (*v[1:9], *v[10:]))))


def _distance(v: tuple[float, ...]) -> Distance:
    """Current distance [cm]; quality of 0 is unknown, 1 is invalid, 100 is perfect."""
    quality = v[14]
    return Distance(int(v[0]), v[3] / 100.0, int(v[6]), math.nan if quality == 0 else (quality - 1) / 99.0)


FROM_AUTOPILOT: Readers = {
    0: READ[0],
    SYS_STATUS: (
        struct.Struct("<IIIHHh"),
        lambda v: Supply(
            math.nan if v[4] == 0xFFFF else v[4] / 1e3, math.nan if v[5] < 0 else v[5] / 100.0, v[0] & v[1] & ~v[2]
        ),
    ),
    22: (struct.Struct("<fHH16sB"), lambda v: ParameterValue(_text(v[3]), v[0])),
    RAW_IMU: (struct.Struct("<Q9hBh"), _raw_imu),
    SCALED_PRESSURE: _barometer(1),
    ATTITUDE: (struct.Struct("<I6f"), lambda v: Attitude(v[0], v[1:4], v[4:7])),
    LOCAL_POSITION: (struct.Struct("<I6f"), lambda v: LocalPosition(v[0], v[1:4], v[4:7])),
    SERVO_OUTPUT: (struct.Struct("<I8HB8H"), _servo_output),
    RC_CHANNELS: (struct.Struct("<I18H"), lambda v: RcChannels(v[0], v[1:])),
    77: READ[77],
    DISTANCE: (struct.Struct("<IHHHBBBBff4fB"), _distance),
    SCALED_PRESSURE2: _barometer(2),
    SCALED_PRESSURE3: _barometer(3),
    VERSION: (struct.Struct("<QQI"), lambda v: Version((v[2] >> 24, v[2] >> 16 & 0xFF, v[2] >> 8 & 0xFF))),
    EKF_STATUS: (struct.Struct("<5fHf"), lambda v: EstimatorStatus(v[5])),
    NAMED_FLOAT: (struct.Struct("<If10s"), lambda v: NamedFloat(_text(v[2]), v[1])),
    253: READ[253],
}  # fmt: skip
"""What is read of an autopilot: the first fields of a message, where the others are of no use."""


def read_parameter(name: str, system: int) -> Sent:
    """PARAM_REQUEST_READ by name."""
    return 20, struct.pack("<hBB16s", -1, system, AUTOPILOT, name.encode())


def manual_control(sticks: Sequence[int], system: int) -> Sent:
    """MANUAL_CONTROL without buttons: forward, starboard, up (0 to 1000, 500 is neutral), clockwise, pitch, roll."""
    x, y, z, r, s, t = sticks
    both_extensions = 0b11
    return 69, struct.pack("<4hHBHB8h", x, y, z, r, 0, system, 0, both_extensions, s, t, *(0,) * 6)


def beat(kind: int) -> Sent:
    """HEARTBEAT, such as of a ground station: without one of those an autopilot takes its failsafe."""
    return mavlink.heartbeat(kind, NO_AUTOPILOT, ACTIVE)
