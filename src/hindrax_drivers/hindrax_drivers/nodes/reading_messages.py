"""Messages of readings: for each quantity of the table of topics one function, reading in, message or CDR bytes out.

    for topic, message in messages.of(stamped): ...

The node of a device publishes them, a replay compares them with the record.
"""

from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from std_msgs.msg import Bool

from hindrax_core.events import NS_PER_S, Stamped
from hindrax_core.readings import (
    Air,
    Battery,
    BottomTrack,
    BottomVelocity,
    EchoProfile,
    Inertial,
    Leak,
    Pressure,
    SonarHealth,
)
from hindrax_core.topics import SENSOR, TOPICS_OF, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.nodes.reading_fields import FIELDS, detail_writer
from hindrax_msgs.msg import Dvl, PingProfile
from hindrax_ros.graph import optional_class
from hindrax_ros.messages import convert
from hindrax_ros.messages.fast_serialization import in_place
from hindrax_ros.messages.serialization import deserialized

Write: TypeAlias = Callable[[Stamped[Any]], Any]
"""Message of a reading, or its bytes; None if the reading has no data for the topic."""
Make: TypeAlias = Callable[[Stamped[Any], str], Any]
"""Message of a reading in a frame; None as above."""

SIGMA_HUMIDITY = 0.03
"""BME280 data sheet, table 2: absolute accuracy."""

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
            elif quantity in FIELDS:
                readings, like, paths, values = FIELDS[quantity]
                self._add(topic, readings, in_place(like(frame), paths, values))
            else:
                readings, make = MAKERS[quantity]
                write = _in_frame(make, frame)
                self._add(topic, readings, _first_of_second(write) if quantity == "die_temperature" else write)

    def _add(self, topic: Topic, readings: tuple[type, ...], write: Write) -> None:
        self.topics.append(topic)
        for reading in readings:
            self._writers.setdefault(reading, []).append((topic.name, write))

    def _add_detail(self, topic: Topic, frame: str, sound_mps: float) -> None:
        """Add the DVL's detail, and its copy as marine_acoustic_msgs/Dvl where that package is installed."""
        write = detail_writer(frame, sound_mps)
        self._add(topic, (BottomVelocity, BottomTrack), _with_track(write))
        kind = optional_class(MARINE_ACOUSTIC)
        if kind is not None:
            copy = _with_track(lambda velocity, track: fill(kind(), deserialized(write(velocity, track), Dvl)))
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
    "temperature": ((Pressure, Air), _temperature("temperature_C")),
    "humidity": ((Air,), lambda one, frame: convert.humidity_to_msg(one, frame, SIGMA_HUMIDITY)),
    "battery": ((Battery,), lambda one, _: convert.battery_to_msg(one)),
    "leak": ((Leak,), lambda one, _: Bool(data=one.reading.wet)),
    "profile": ((EchoProfile,), _profile),
    "die_temperature": ((Inertial,), _temperature("temperature_C")),
    "supply": (
        (SonarHealth,),
        lambda one, _: convert.battery_to_msg(Stamped(one.stamp, Battery(one.reading.supply_V))),
    ),
    "processor_temperature": ((SonarHealth,), _temperature("processor_C")),
    "board_temperature": ((SonarHealth,), _temperature("board_C")),
}
"""Kinds of readings behind each slower quantity, and its message."""
