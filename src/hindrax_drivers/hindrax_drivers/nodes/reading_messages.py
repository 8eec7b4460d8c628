"""Messages of readings: for each quantity of the table of topics one function, reading in, message or CDR bytes out.

    for topic, message in messages.of(stamped): ...

The node of a device publishes them, a replay compares them with the record.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from sensor_msgs.msg import Range, Temperature
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
from hindrax_core.topics import TOPICS_OF, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.nodes import marine_acoustic
from hindrax_drivers.nodes.reading_fields import DETAIL, FIELDS, Fields
from hindrax_msgs.msg import PingProfile
from hindrax_ros import convert
from hindrax_ros.fast_serialization import in_place

Write: TypeAlias = Callable[[Stamped[Any]], Any]
"""Message of a reading, or its bytes; None if the reading has no data for the topic."""
Make: TypeAlias = Callable[[str, Vehicle], Write]

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
            readings, make = _MAKERS[quantity]
            self._add(topic, readings, make(frame, vehicle), FIELDS.get(quantity))
            if quantity == "detail" and marine_acoustic.dvl_class() is not None:
                self._add(marine_acoustic.topic_of(device), (BottomVelocity, BottomTrack), _copy(frame, vehicle))

    def _add(self, topic: Topic, readings: tuple[type, ...], make: Write, fields: Fields | None = None) -> None:
        self.topics.append(topic)
        write = make if fields is None else in_place(make, *fields)
        for reading in readings:
            self._writers.setdefault(reading, []).append((topic.name, write))

    def accepts(self, reading: type) -> bool:
        """Whether readings of this kind have messages."""
        return reading in self._writers

    def of(self, stamped: Stamped[Any]) -> Iterator[tuple[str, Any]]:
        """Yield topic name and message, or its CDR bytes, for every topic that the reading has data for."""
        for topic, write in self._writers.get(type(stamped.reading), ()):
            message = write(stamped)
            if message is not None:
                yield topic, message


def _inertial(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.inertial_to_msg(one, frame, SIGMA_FORCE_mps2, SIGMA_RATE_radps)


def _magnetic(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.magnetic_to_msg(one, frame, SIGMA_FIELD_T)


def _pressure(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.pressure_to_msg(one, frame, SIGMA_PRESSURE_Pa)


def _temperature(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.temperature_to_msg(one.stamp, one.reading.temperature_C, frame)


def _humidity(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.humidity_to_msg(one, frame, SIGMA_HUMIDITY)


def _battery(_frame: str, _vehicle: Vehicle) -> Write:
    return convert.battery_to_msg


def _leak(_frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: Bool(data=one.reading.wet)


def _echo(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.echo_to_msg(one, frame, PING_LIMITS_m, PING_VIEW_rad)


def _profile(frame: str, _vehicle: Vehicle) -> Write:
    def write(stamped: Stamped[EchoProfile]) -> PingProfile:
        echo = stamped.reading
        message = PingProfile(
            distance=echo.range_m,
            confidence=echo.confidence,
            ping_number=echo.ping_number,
            scan_start=echo.start_m,
            scan_length=echo.length_m,
            gain_setting=echo.gain,
            profile=echo.strength,
        )
        message.header.stamp, message.header.frame_id = convert.stamp_to_msg(stamped.stamp), frame
        return message

    return write


def _die_temperature(frame: str, _vehicle: Vehicle) -> Write:
    """Write one message a second, with its first sample: whoever began earlier or later writes the same."""
    second: int | None = None

    def write(stamped: Stamped[Inertial]) -> Temperature | None:
        nonlocal second
        before, second = second, stamped.stamp // NS_PER_S
        return None if before in (None, second) else _temperature(frame, _vehicle)(stamped)

    return write


def _supply(_frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.battery_to_msg(Stamped(one.stamp, Battery(one.reading.supply_V)))


def _processor_temperature(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.temperature_to_msg(one.stamp, one.reading.processor_C, frame)


def _board_temperature(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.temperature_to_msg(one.stamp, one.reading.board_C, frame)


def _velocity(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.velocity_to_msg(one, frame)


def _attitude(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.attitude_to_msg(one, frame, SIGMA_ATTITUDE_rad)


def _altitude(frame: str, _vehicle: Vehicle) -> Write:
    """A DVL-75 reports the altitude with its attitude, a Tracker 650 as an echo of its own."""

    def altitude(stamped: Stamped[BottomTrack | Echo]) -> Range | None:
        found = stamped.reading
        altitude_m = found.range_m if isinstance(found, Echo) else found.altitude_m
        if altitude_m is None:
            return None
        return convert.echo_to_msg(Stamped(stamped.stamp, Echo(altitude_m, 1.0)), frame, DVL_LIMITS_m, DVL_VIEW_rad)

    return altitude


def _position(frame: str, _vehicle: Vehicle) -> Write:
    return lambda one: convert.position_to_msg(one, frame)


def _detail(frame: str, vehicle: Vehicle) -> Write:
    sound_mps = vehicle.water.speed_of_sound_mps
    return _with_track(in_place(lambda one, track: convert.dvl_to_msg(one, track, frame, sound_mps), *DETAIL))


def _copy(frame: str, vehicle: Vehicle) -> Write:
    """The detail as marine_acoustic_msgs/Dvl."""
    sound_mps, kind = vehicle.water.speed_of_sound_mps, marine_acoustic.dvl_class()
    return _with_track(
        lambda velocity, track: marine_acoustic.fill(kind(), convert.dvl_to_msg(velocity, track, frame, sound_mps))
    )


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


_MAKERS: dict[str, tuple[tuple[type, ...], Make]] = {
    "data_raw": ((Inertial,), _inertial),
    "mag": ((Magnetic,), _magnetic),
    "pressure": ((Pressure, Air), _pressure),
    "temperature": ((Pressure, Air), _temperature),
    "humidity": ((Air,), _humidity),
    "battery": ((Battery,), _battery),
    "leak": ((Leak,), _leak),
    "range": ((Echo,), _echo),
    "profile": ((EchoProfile,), _profile),
    "die_temperature": ((Inertial,), _die_temperature),
    "supply": ((SonarHealth,), _supply),
    "processor_temperature": ((SonarHealth,), _processor_temperature),
    "board_temperature": ((SonarHealth,), _board_temperature),
    "velocity": ((BottomVelocity,), _velocity),
    "attitude": ((BottomTrack,), _attitude),
    "altitude": ((BottomTrack, Echo), _altitude),
    "position": ((Position,), _position),
    "detail": ((BottomVelocity, BottomTrack), _detail),
}
