"""What readings become that only some devices of a kind give, and what is published of them."""

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")


from hindrax_bringup.share_files import default_vehicle
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Position
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.device_node import one_of_many
from hindrax_drivers.nodes.reading_messages import ReadingMessages

TRACK = BottomTrack(True, 0.0, 0.0, 0.0, 1.5, (0.0, 0.0), (), "3333", 0)


def messages_of_dvl() -> ReadingMessages:
    return ReadingMessages("dvl75", load_vehicle(default_vehicle()))


def test_the_altitude_of_either_dvl_is_published() -> None:
    made = messages_of_dvl()
    said = [*made.of(Stamped(Stamp(0), TRACK)), *made.of(Stamped(Stamp(0), Echo(1.25, 0.9)))]
    told = [message for name, message in said if name == "dvl75/altitude"]
    assert [one.range for one in told] == [1.5, 1.25]


def test_a_dvl_without_lock_tells_its_detail_and_no_velocity() -> None:
    lost = Stamped(Stamp(0), BottomVelocity(None, 0.0, 0.0, 0.05, 77))
    assert [name for name, _ in messages_of_dvl().of(lost)] == ["dvl75/detail"]


def test_every_topic_has_a_name_that_messages_come_under() -> None:
    made = messages_of_dvl()
    moving = Stamped(Stamp(0), BottomVelocity((0.1, 0.0, 0.0), 0.01, 1.0, 0.05, 77))
    place = Stamped(Stamp(0), Position(44.96, -93.51, fixed=True))
    said = {name for reading in (Stamped(Stamp(0), TRACK), moving, place) for name, _ in made.of(reading)}
    assert said == {topic.name for topic in made.topics}
    assert made.accepts(BottomVelocity)
    assert not made.accepts(str)


def test_of_many_messages_one_in_so_many_is_published() -> None:
    said: list[int] = []
    publish = one_of_many(3, said.append)
    for number in range(1, 8):
        publish(number)
    assert said == [3, 6]
