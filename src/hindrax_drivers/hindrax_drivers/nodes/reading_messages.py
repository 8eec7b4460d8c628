"""Messages of the readings of one device: for each of its topics one function, reading in, message or CDR bytes out.

    for topic, message in messages.of(stamped): ...

The node of a device publishes them, a replay compares them with the record.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeAlias, TypeVar

from std_msgs.msg import Bool

from hindrax_core.events import NS_PER_S, Stamped
from hindrax_core.readings import BottomTrack, BottomVelocity, EchoProfile, Leak
from hindrax_core.topics import SENSOR, Topic, sensor_topics
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.msg import Dvl, PingProfile
from hindrax_ros.graph import optional_class
from hindrax_ros.messages.convert import header
from hindrax_ros.messages.reading_fields import FIELDS, writer
from hindrax_ros.messages.serialization import deserialized

TheirsT = TypeVar("TheirsT")
Write: TypeAlias = Callable[[Stamped[Any]], object]
"""Message of a reading, or its bytes; None if the reading has no data for the topic."""
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


def frame_of(name: str) -> str:
    """Frame of the messages of a sensor, unless a parameter names another."""
    return f"{name}_link"


class ReadingMessages:
    """Messages of the readings of one device; `topics` are all `NAME/...` that a sensor of its kind can make.

    Equal readings give equal messages, except the DVL's detail: it has the beams of the previous sentence.
    """

    def __init__(self, name: str, device: str, vehicle: Vehicle, frame: str | None = None) -> None:
        self.topics: list[Topic] = []
        self._writers: dict[type, list[tuple[str, Write]]] = {}
        frame = frame_of(name) if frame is None else frame
        for quantity, topic in (sensor_topics(name, device) if device else {}).items():
            if quantity == "detail":
                self._add_detail(topic, frame, vehicle.water.speed_of_sound_mps)
            elif quantity == "leak":
                self._add(topic, (Leak,), lambda one: Bool(data=one.reading.wet))
            elif quantity == "profile":
                self._add(topic, (EchoProfile,), partial(_profile, frame=frame))
            else:
                write: Write = writer(quantity, frame)
                write = _first_of_second(write) if quantity == "die_temperature" else write
                self._add(topic, FIELDS[quantity].kinds, write)

    def _add(self, topic: Topic, readings: tuple[type, ...], write: Write) -> None:
        self.topics.append(topic)
        for reading in readings:
            self._writers.setdefault(reading, []).append((topic.name, write))

    def _add_detail(self, topic: Topic, frame: str, sound_mps: float) -> None:
        """Add the DVL's detail, and its copy as marine_acoustic_msgs/Dvl where that package is installed."""
        write = writer("detail", frame)
        self._add(topic, FIELDS["detail"].kinds, _with_track(write, sound_mps))
        kind = optional_class(MARINE_ACOUSTIC)
        if kind is not None:
            copy = _with_track(lambda *moving: fill(kind(), deserialized(write(*moving) or b"", Dvl)), sound_mps)
            name, meaning = topic.name.replace("/detail", "/dvl"), "detail as marine_acoustic_msgs"
            its = Topic(name, MARINE_ACOUSTIC, SENSOR, 0.0, meaning, recorded=False)
            self._add(its, FIELDS["detail"].kinds, copy)

    def accepts(self, reading: type) -> bool:
        """Whether readings of this kind have messages."""
        return reading in self._writers

    def of(self, stamped: Stamped[object]) -> Iterator[tuple[str, object]]:
        """Yield topic name and message, or its CDR bytes, for every topic that the reading has data for."""
        for topic, write in self._writers.get(type(stamped.reading), ()):
            message = write(stamped)
            if message is not None:
                yield topic, message


def fill(theirs: TheirsT, ours: Dvl) -> TheirsT:
    """Fill a marine_acoustic_msgs/Dvl from a hindrax_msgs/Dvl, field for field, and return it."""
    for name in ALIKE:
        setattr(theirs, name, getattr(ours, name))
    for name, field in OF_BEAMS.items():
        setattr(theirs, name, [getattr(beam, field) for beam in ours.beams])
    return theirs


def _profile(one: Stamped[EchoProfile], frame: str) -> PingProfile:
    echo = one.reading
    return PingProfile(
        header=header(one.stamp, frame),
        distance=echo.range_m,
        confidence=echo.confidence,
        ping_number=echo.ping_number,
        scan_start=echo.start_m,
        scan_length=echo.length_m,
        gain_setting=echo.gain,
        profile=echo.strength,
    )


def _first_of_second(write: Write) -> Write:
    """Write one message a second, with its first sample: a process that started earlier or later writes the same."""
    second: int | None = None

    def sometimes(stamped: Stamped[object]) -> object:
        nonlocal second
        before, second = second, stamped.stamp // NS_PER_S
        return None if before in (None, second) else write(stamped)

    return sometimes


def _with_track(
    write: Callable[[Stamped[BottomVelocity], BottomTrack | None, float], object], sound_mps: float
) -> Write:
    """Combine every velocity with the last sentence about the beams."""
    latest: BottomTrack | None = None

    def detail(stamped: Stamped[BottomVelocity] | Stamped[BottomTrack]) -> object:
        nonlocal latest
        if isinstance(stamped.reading, BottomTrack):
            latest = stamped.reading
            return None
        return write(stamped, latest, sound_mps)

    return detail
