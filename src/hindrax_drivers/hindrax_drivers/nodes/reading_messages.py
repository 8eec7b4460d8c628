"""Messages of readings: for each quantity of the table of topics one function, reading in, message or CDR bytes out.

    for topic, message in messages.of(stamped): ...

The node of a device publishes them, a replay compares them with the record.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeAlias

from sensor_msgs.msg import Range
from std_msgs.msg import Bool

from hindrax_core.events import NS_PER_S, Stamped
from hindrax_core.readings import (
    Air,
    Battery,
    BottomTrack,
    BottomVelocity,
    Echo,
    EchoProfile,
    Inertial,
    Leak,
    Magnetic,
    Position,
    Pressure,
    SonarHealth,
)
from hindrax_core.topics import SENSOR, TOPICS_OF, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.nodes.reading_fields import DETAIL, FIELDS
from hindrax_msgs.msg import PingProfile
from hindrax_ros.graph import optional_class
from hindrax_ros.messages import convert
from hindrax_ros.messages.fast_serialization import in_place

Write: TypeAlias = Callable[[Stamped[Any]], Any]
"""Message of a reading, or its bytes; None if the reading has no data for the topic."""
Make: TypeAlias = Callable[[Stamped[Any], str], Any]
"""Message of a reading in a frame; None as above."""

# ICM-20948 datasheet table 1 and 2: 0.015 dps/sqrt(Hz) and 230 ug/sqrt(Hz), over the noise bandwidth of a 50 Hz filter.
SIGMA_RATE_radps = math.radians(0.015) * math.sqrt(1.57 * 50.0)
SIGMA_FORCE_mps2 = 230e-6 * 9.80665 * math.sqrt(1.57 * 50.0)
SIGMA_FIELD_T = 0.3e-6
SIGMA_PRESSURE_Pa = 20.0
SIGMA_HUMIDITY = 0.03
"""BME280 data sheet, table 2: absolute accuracy."""
SIGMA_ATTITUDE_rad = math.radians(1.0)
PING_LIMITS_m = (0.3, 100.0)
PING_VIEW_rad = math.radians(25.0)
DVL_LIMITS_m = (0.15, 75.0)
DVL_VIEW_rad = math.radians(22.5)

MARINE_ACOUSTIC = "marine_acoustic_msgs/msg/Dvl"
"""Definition: github apl-ocean-engineering/marine_msgs, marine_acoustic_msgs/msg/Dvl.msg."""
ALIKE = (
    *("header", "velocity_mode", "dvl_type", "velocity", "velocity_covar", "altitude", "course_gnd", "speed_gnd"),
    *("num_good_beams", "sound_speed", "beam_ranges_valid", "beam_velocities_valid"),
)
OF_BEAMS = {
    "beam_unit_vec": "unit_vec",
    "range": "range",
    "range_covar": "range_covar",
    "beam_quality": "quality",
    "beam_velocity": "velocity",
    "beam_velocity_covar": "velocity_covar",
}
"""Array of theirs, field of our beam."""


def frame_of(device: str) -> str:
    """Frame of the messages of a device, unless a parameter names another."""
    return f"{device}_link"


class ReadingMessages:
    """Messages of the readings of one device; `topics` are all `DEVICE/...` rows of the table that it can make.

    Equal readings give equal messages, except the DVL's detail: it has the beams of the previous sentence.
    """

    def __init__(self, device: str, vehicle: Vehicle, frame: str = "") -> None:
        self.topics: list[Topic] = []
        self._writers: dict[type, list[tuple[str, Write]]] = {}
        frame = frame or frame_of(device)
        for quantity, topic in TOPICS_OF.get(device, {}).items():
            if quantity == "detail":
                self._add_detail(topic, frame, vehicle.water.speed_of_sound_mps)
                continue
            readings, make = MAKERS[quantity]
            write = _in_frame(make, frame)
            if quantity == "die_temperature":
                write = _first_of_second(write)
            self._add(topic, readings, in_place(write, *FIELDS[quantity]) if quantity in FIELDS else write)

    def _add(self, topic: Topic, readings: tuple[type, ...], write: Write) -> None:
        self.topics.append(topic)
        for reading in readings:
            self._writers.setdefault(reading, []).append((topic.name, write))

    def _add_detail(self, topic: Topic, frame: str, sound_mps: float) -> None:
        """Add the DVL's detail, and its copy as marine_acoustic_msgs/Dvl where that package is installed."""
        make = partial(convert.dvl_to_msg, frame=frame, sound_mps=sound_mps)
        self._add(topic, (BottomVelocity, BottomTrack), _with_track(in_place(make, *DETAIL)))
        kind = optional_class(MARINE_ACOUSTIC)
        if kind is not None:
            copy = _with_track(lambda velocity, track: fill(kind(), make(velocity, track)))
            name, meaning = topic.name.replace("/detail", "/dvl"), "detail as marine_acoustic_msgs"
            its = Topic(name, MARINE_ACOUSTIC, SENSOR, 0.0, meaning, recorded=False)
            self._add(its, (BottomVelocity, BottomTrack), copy)

    def accepts(self, reading: type) -> bool:
        """Whether readings of this kind have messages."""
        return reading in self._writers

    def of(self, stamped: Stamped[Any]) -> Iterator[tuple[str, Any]]:
        """Yield topic name and message, or its CDR bytes, for every topic that the reading has data for."""
        for topic, write in self._writers.get(type(stamped.reading), ()):
            message = write(stamped)
            if message is not None:
                yield topic, message


def fill(theirs: Any, ours: Any) -> Any:
    """Fill a marine_acoustic_msgs/Dvl from a hindrax_msgs/Dvl, field for field, and return it."""
    for name in ALIKE:
        setattr(theirs, name, getattr(ours, name))
    for name, field in OF_BEAMS.items():
        setattr(theirs, name, [getattr(beam, field) for beam in ours.beams])
    return theirs


def _profile(one: Stamped[EchoProfile], frame: str) -> PingProfile:
    echo = one.reading
    message = PingProfile(
        distance=echo.range_m,
        confidence=echo.confidence,
        ping_number=echo.ping_number,
        scan_start=echo.start_m,
        scan_length=echo.length_m,
        gain_setting=echo.gain,
        profile=echo.strength,
    )
    message.header.stamp, message.header.frame_id = convert.stamp_to_msg(one.stamp), frame
    return message


def _altitude(one: Stamped[BottomTrack | Echo], frame: str) -> Range | None:
    """A DVL-75 reports the altitude with its attitude, a Tracker 650 as an echo of its own."""
    altitude_m = one.reading.range_m if isinstance(one.reading, Echo) else one.reading.altitude_m
    if altitude_m is None:
        return None
    return convert.echo_to_msg(Stamped(one.stamp, Echo(altitude_m, 1.0)), frame, DVL_LIMITS_m, DVL_VIEW_rad)


def _temperature(of: str) -> Make:
    """Message of the temperature that a field of the reading holds."""
    return lambda one, frame: convert.temperature_to_msg(one.stamp, getattr(one.reading, of), frame)


def _in_frame(make: Make, frame: str) -> Write:
    return lambda stamped: make(stamped, frame)


def _first_of_second(write: Write) -> Write:
    """Write one message a second, with its first sample: whoever began earlier or later writes the same."""
    second: int | None = None

    def sometimes(stamped: Stamped[Any]) -> Any:
        nonlocal second
        before, second = second, stamped.stamp // NS_PER_S
        return None if before in (None, second) else write(stamped)

    return sometimes


def _with_track(write: Callable[[Stamped[BottomVelocity], BottomTrack | None], Any]) -> Write:
    """Combine every velocity with the last sentence about the beams."""
    latest: BottomTrack | None = None

    def detail(stamped: Stamped[Any]) -> Any:
        nonlocal latest
        if isinstance(stamped.reading, BottomTrack):
            latest = stamped.reading
            return None
        return write(stamped, latest)

    return detail


MAKERS: dict[str, tuple[tuple[type, ...], Make]] = {
    "data_raw": (
        (Inertial,),
        lambda one, frame: convert.inertial_to_msg(one, frame, SIGMA_FORCE_mps2, SIGMA_RATE_radps),
    ),
    "mag": ((Magnetic,), lambda one, frame: convert.magnetic_to_msg(one, frame, SIGMA_FIELD_T)),
    "pressure": ((Pressure, Air), lambda one, frame: convert.pressure_to_msg(one, frame, SIGMA_PRESSURE_Pa)),
    "temperature": ((Pressure, Air), _temperature("temperature_C")),
    "humidity": ((Air,), lambda one, frame: convert.humidity_to_msg(one, frame, SIGMA_HUMIDITY)),
    "battery": ((Battery,), lambda one, _: convert.battery_to_msg(one)),
    "leak": ((Leak,), lambda one, _: Bool(data=one.reading.wet)),
    "range": ((Echo,), lambda one, frame: convert.echo_to_msg(one, frame, PING_LIMITS_m, PING_VIEW_rad)),
    "profile": ((EchoProfile,), _profile),
    "die_temperature": ((Inertial,), _temperature("temperature_C")),
    "supply": (
        (SonarHealth,),
        lambda one, _: convert.battery_to_msg(Stamped(one.stamp, Battery(one.reading.supply_V))),
    ),
    "processor_temperature": ((SonarHealth,), _temperature("processor_C")),
    "board_temperature": ((SonarHealth,), _temperature("board_C")),
    "velocity": ((BottomVelocity,), convert.velocity_to_msg),
    "attitude": ((BottomTrack,), lambda one, frame: convert.attitude_to_msg(one, frame, SIGMA_ATTITUDE_rad)),
    "altitude": ((BottomTrack, Echo), _altitude),
    "position": ((Position,), convert.position_to_msg),
}
"""Kinds of readings behind each quantity, and its message; the DVL's detail is added by itself."""
