"""What readings become that only some devices of a kind give, and what is published of them."""

import math
from collections.abc import Iterable
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")


from sensor_msgs.msg import Range

from hindrax_bringup.share_files import default_vehicle, hindrax_with
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Air, Battery, BottomTrack, BottomVelocity, Echo, Inertial, Leak, Position, Reading
from hindrax_core.topics import TOPICS_OF
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.device_node import one_of_many
from hindrax_drivers.nodes.reading_messages import ReadingMessages
from hindrax_ros.messages.serialization import deserialized, message_class, serialized

TRACK = BottomTrack(True, 0.0, 0.0, 0.0, 1.5, (0.0, 0.0), (), "3333", 0)


def messages_of_dvl() -> ReadingMessages:
    return ReadingMessages("dvl75", "dvl75", load_vehicle(default_vehicle()))


def test_the_altitude_of_either_dvl_is_published() -> None:
    made = messages_of_dvl()
    published = [*made.of(Stamped(Stamp(0), TRACK)), *made.of(Stamped(Stamp(0), Echo(1.25, 0.9)))]
    messages = [deserialized(serialized(data), Range) for name, data in published if name == "dvl75/altitude"]
    assert [one.range for one in messages] == [1.5, 1.25]


def test_a_dvl_without_lock_shows_its_detail_and_no_velocity() -> None:
    lost = Stamped(Stamp(0), BottomVelocity(None, 0.0, 0.0, 0.05, 77))
    published = {name for name, _ in messages_of_dvl().of(lost)}
    assert published - {"dvl75/dvl"} == {"dvl75/detail"}, "a copy where marine_acoustic_msgs is installed"


def test_every_topic_has_a_name_that_messages_come_under() -> None:
    made = messages_of_dvl()
    moving = Stamped(Stamp(0), BottomVelocity((0.1, 0.0, 0.0), 0.01, 1.0, 0.05, 77))
    place = Stamped(Stamp(0), Position(44.96, -93.51, fixed=True))
    published = {name for reading in (Stamped(Stamp(0), TRACK), moving, place) for name, _ in made.of(reading)}
    assert published == {topic.name for topic in made.topics}
    assert made.accepts(BottomVelocity)
    assert not made.accepts(str)


def messages_of(device: str, reading: Reading) -> dict[str, Any]:
    return read(ReadingMessages(device, device, hindrax_with(device)).of(Stamped(Stamp(0), reading)))


def read(published: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """The messages by topic, made of their bytes."""
    kinds = {topic.name: message_class(topic.type) for of in TOPICS_OF.values() for topic in of.values()}
    return {name: deserialized(serialized(one), kinds[name]) for name, one in published}


def test_the_battery_is_that_of_the_vehicle_and_discharges_below_zero() -> None:
    messages = messages_of("ina226", Battery(14.8, 12.5))
    assert list(messages) == ["battery"], "the topic that the allocator listens to"
    assert messages["battery"].voltage == pytest.approx(14.8)
    assert messages["battery"].current == -12.5
    assert math.isnan(messages["battery"].percentage)


def test_the_air_in_the_hull_and_a_leak() -> None:
    messages = messages_of("bme280", Air(101_325.0, 30.0, 0.4))
    assert list(messages) == ["bme280/pressure", "bme280/temperature", "bme280/humidity"]
    assert messages["bme280/humidity"].relative_humidity == 0.4
    assert "bme280/humidity" not in messages_of("bme280", Air(101_325.0, 30.0))
    assert messages_of("sos_leak", Leak(wet=True))["leak"].data


def test_of_many_messages_one_in_so_many_is_published() -> None:
    published: list[int] = []
    publish = one_of_many(3, published.append)
    for number in range(1, 8):
        publish(number)
    assert published == [3, 6]


def test_the_temperature_of_the_die_comes_once_a_second() -> None:
    made = ReadingMessages("icm20948", "icm20948", load_vehicle(default_vehicle()))
    samples = [Stamped(Stamp(index * 10_000_000), Inertial((0.0,) * 3, (0.0,) * 3, 24.5)) for index in range(250)]
    published = [read(made.of(one)) for one in samples]
    messages = [one["icm20948/die_temperature"] for one in published if "icm20948/die_temperature" in one]
    assert [message.header.stamp.sec for message in messages] == [1, 2]
    assert {message.temperature for message in messages} == {24.5}
