"""Readings written in place against the message objects of the same readings."""

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Beam, BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Position, Pressure
from hindrax_drivers.nodes.reading_fields import DETAIL, FIELDS
from hindrax_drivers.nodes.reading_messages import MAKERS
from hindrax_ros.messages import convert
from hindrax_ros.messages.fast_serialization import in_place

number = st.floats(width=32, allow_nan=False)
three = st.tuples(*[number] * 3)
maybe = st.none() | number
beams = st.lists(st.builds(Beam, st.booleans(), number, maybe, number), min_size=4, max_size=4).map(tuple)
tracks = st.builds(
    BottomTrack,
    *(st.booleans(), *[st.floats(-3, 3)] * 3, maybe, st.just((0.0, 0.0)), beams | st.just(())),
    *(st.just(""), st.just(0)),
)
speeds = st.builds(BottomVelocity, st.none() | three, st.floats(0, 1e3), number, number, st.integers(0, 2**63))
READINGS = {
    Inertial: st.builds(Inertial, three, three, number),
    Magnetic: st.builds(Magnetic, three),
    Pressure: st.builds(Pressure, number, number),
    Echo: st.builds(Echo, number, number),
    BottomTrack: tracks,
    BottomVelocity: speeds,
    Position: st.builds(Position, number, number, st.booleans()),
}


def stamped(reading: Any) -> Any:
    return st.builds(Stamped, st.integers(0, 2**31 * 10**9 - 1).map(Stamp), reading)


def same(data: bytes | None, message: Any) -> bool:
    """Whether bytes say what a message says; padding may hold anything."""
    if data is None or message is None:
        return data is message
    wanted = serialize_message(message)
    read, expected = (deserialize_message(one, type(message)) for one in (data, wanted))
    return repr(read) == repr(expected) and len(data) == len(wanted)


@pytest.mark.parametrize("quantity", FIELDS)
@settings(max_examples=30)
@given(st.data())
def test_every_quantity_in_place_says_what_its_message_says(quantity: str, data: st.DataObject) -> None:
    kinds, maker = MAKERS[quantity]

    def make(one: Stamped[Any]) -> Any:
        return maker(one, "link")

    write = in_place(make, *FIELDS[quantity])
    of_kinds = [READINGS[kind] for kind in kinds if kind in READINGS]
    for one in data.draw(st.lists(stamped(st.one_of(of_kinds)), min_size=1, max_size=3)):
        assert same(write(one), make(one))


@settings(max_examples=30)
@given(st.lists(st.tuples(stamped(speeds), st.none() | tracks), min_size=1, max_size=3))
def test_the_detail_in_place_says_what_its_message_says(pairs: list[tuple[Any, Any]]) -> None:
    def make(velocity: Stamped[BottomVelocity], track: BottomTrack | None) -> Any:
        return convert.dvl_to_msg(velocity, track, "link", 1500.0)

    write = in_place(make, *DETAIL)
    for velocity, track in pairs:
        assert same(write(velocity, track), make(velocity, track))
