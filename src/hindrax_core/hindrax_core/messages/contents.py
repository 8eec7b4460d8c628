"""What messages hold: for each kind the paths of its fields, and the reading, state or phase that their values are.

The same rows read live bytes, by the definitions of the installed messages, and recorded ones, by those in the bag.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.messages.cdr import CdrReader
from hindrax_core.messages.definition import Definition
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading
from hindrax_core.rotation import sname_from_xyzw
from hindrax_core.signals import Navigation, Phase, Supply, Thrust
from hindrax_core.topics import Topic

ContentT_co = TypeVar("ContentT_co", covariant=True)
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
BEAMS = 4
NOT_MEASURED = -1.0
UNKNOWN = (math.nan, math.nan, math.nan)
_BEAM = ("range", "range_covar", "quality", "velocity", "velocity_covar", "locked")


def parts(path: str, names: str = "xyz") -> tuple[str, ...]:
    """Paths of the fields of a vector or quaternion."""
    return tuple(f"{path}.{name}" for name in names)


class Contents(NamedTuple, Generic[ContentT_co]):
    """Fields of a kind of message: their paths, in the order of the definition, and what their values make."""

    paths: Sequence[str]
    made: Callable[..., ContentT_co]

    def of_values(self, values: Sequence[Any]) -> Stamped[ContentT_co]:
        """Make it of seconds and nanoseconds of the stamp and of the values at `paths`, arrays flattened."""
        return Stamped(Stamp(values[0] * NS_PER_S + values[1]), self.made(*values[2:]))


Read: TypeAlias = Callable[[bytes], Stamped[ContentT_co]]
"""Reads the bytes of a message; ValueError for bytes of another kind."""


def bytes_reader(definition: Definition, contents: Contents[ContentT_co]) -> Read[ContentT_co]:
    """Make the reader of CDR bytes of messages of this definition."""
    read, made = CdrReader(definition, *STAMP, *contents.paths).read, contents.made

    def stamped(data: bytes) -> Stamped[ContentT_co]:
        found = read(data)
        return Stamped(Stamp(found[0] * NS_PER_S + found[1]), made(*found[2:]))

    return stamped


def of_message(message: object, contents: Contents[ContentT_co]) -> Stamped[ContentT_co]:
    """Read a decoded message, an object with the fields of its type; arrays of messages are not read."""
    values: list[object] = []
    for path in (*STAMP, *contents.paths):
        found = attrgetter(path)(message)
        many = not isinstance(found, str) and hasattr(found, "__len__")
        values.extend(found) if many else values.append(found)
    return contents.of_values(values)


def _bottom_velocity(u: float, v: float, w: float, variance: float, *others: float) -> BottomVelocity:
    *_, confidence, device_us, interval_s = others
    velocity = None if variance < 0.0 else (u, v, w)
    return BottomVelocity(velocity, math.sqrt(max(0.0, variance)), confidence, interval_s, int(device_us))


def _inertial(p: float, q: float, r: float, *others: float) -> Reading:
    """NaN for what the message says it does not have: element 0 of its covariance is -1 (sensor_msgs/Imu)."""
    rates_known, (x, y, z), forces_known = others[0] != NOT_MEASURED, others[9:12], others[12] != NOT_MEASURED
    if not (rates_known or forces_known):
        return Reading()  # an orientation alone
    return Inertial((x, y, z) if forces_known else UNKNOWN, (p, q, r) if rates_known else UNKNOWN, math.nan)


def _echo(range_m: float) -> Echo:
    """Only confident echoes travel; infinity stands for what is out of range, or too close (REP-117)."""
    return Echo(0.0, 0.0) if math.isinf(range_m) else Echo(range_m, 1.0)


def _altitude(range_m: float) -> BottomTrack:
    altitude_m = None if math.isinf(range_m) else range_m
    return BottomTrack(True, *UNKNOWN, altitude_m, (math.nan, math.nan), (), "", 0)


SENSORS: Mapping[str, Contents[Reading]] = {
    "data_raw": Contents(
        (
            *(*parts("angular_velocity"), "angular_velocity_covariance"),
            *(*parts("linear_acceleration"), "linear_acceleration_covariance"),
        ),
        _inertial,
    ),
    "mag": Contents(parts("magnetic_field"), lambda x, y, z: Magnetic((x, y, z))),
    "pressure": Contents(("fluid_pressure",), lambda pressure_Pa: Pressure(pressure_Pa, math.nan)),
    "range": Contents(("range",), _echo),
    "altitude": Contents(("range",), _altitude),
    "attitude": Contents(
        parts("orientation", "xyzw"),
        lambda *xyzw: BottomTrack(True, *sname_from_xyzw(*xyzw), None, (math.nan, math.nan), (), "", 0),
    ),
    "detail": Contents(
        (
            *(*parts("velocity"), "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
            *("num_good_beams", "sound_speed", "beam_ranges_valid", "beam_velocities_valid"),
            *(f"beams.{index}.{name}" for index in range(BEAMS) for name in _BEAM),
            *("confidence", "device_time", "interval"),
        ),
        _bottom_velocity,
    ),
}
"""By quantity of the table of topics: what its messages hold of a reading, NaN for the rest."""


def of_sensor(topic: Topic) -> Contents[Reading]:
    """Contents of the messages of a sensor, by the last word of its topic."""
    return SENSORS[topic.name.rpartition("/")[2]]


def _navigation(*found: float) -> Navigation:
    depth_m, depth_s, _, altitude_m, altitude_s, _, w, _, _, *rest = found
    yaw, roll, pitch, u, v, su, sv, sw, p, q, r, north, east, locked = rest
    return Navigation(
        attitude_rad=(roll, pitch, yaw),
        rate_radps=(p, q, r),
        velocity_mps=(u, v, w),
        depth_m=depth_m,
        altitude_m=altitude_m,
        position_m=(north, east),
        dvl_locked=bool(locked),
        velocity_sigma_mps=(su, sv, sw),
        depth_age_s=depth_s,
        altitude_age_s=altitude_s,
    )


def _thrust(*found: float) -> Thrust:
    X, Y, Z, K, M, N, *forces_N, measured = found
    return Thrust((X, Y, Z, K, M, N), tuple(forces_N), Supply.MEASURED if measured else Supply.ASSUMED)


NAVIGATION = Contents(
    (
        *("depth", "depth_age", "depth_valid", "altitude", "altitude_age", "altitude_valid"),
        *("heave_velocity", "heave_velocity_age", "heave_velocity_valid", "heading", "roll", "pitch"),
        *("surge_velocity", "sway_velocity", "surge_velocity_sigma", "sway_velocity_sigma", "heave_velocity_sigma"),
        *("roll_rate", "pitch_rate", "yaw_rate", "position_north", "position_east", "dvl_locked"),
    ),
    _navigation,
)
"""NavigationStatus: full navigation state, SNAME, but for the ages of single sensors."""
THRUST = Contents(("achieved", "forces", "supply_measured"), _thrust)
"""AllocationStatus: the achieved wrench and the forces behind it."""
PHASE = Contents(("motion", "phase"), Phase)
"""ManeuverStatus."""
