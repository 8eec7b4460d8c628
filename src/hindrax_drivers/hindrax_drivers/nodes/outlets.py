"""Where each kind of reading is published: one small function per reading."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

from rclpy.node import Node

from hindrax_core.events import Stamped
from hindrax_core.readings import (
    BottomTrack,
    BottomVelocity,
    DeviceText,
    Echo,
    EchoProfile,
    Inertial,
    Magnetic,
    Pressure,
)
from hindrax_core.topics import TOPICS, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.nodes import marine_acoustic
from hindrax_msgs.msg import PingProfile
from hindrax_ros import convert
from hindrax_ros.graph import publisher
from hindrax_ros.swift import (
    attitude_writer,
    dvl_writer,
    echo_writer,
    inertial_writer,
    magnetic_writer,
    pressure_writer,
    temperature_writer,
    velocity_writer,
)

Outlets: TypeAlias = dict[type, Callable[[Stamped[Any]], None]]

# ICM-20948 datasheet table 1 and 2: 0.015 dps/sqrt(Hz) and 230 ug/sqrt(Hz), over the noise bandwidth of a 50 Hz filter.
SIGMA_RATE_radps = math.radians(0.015) * math.sqrt(1.57 * 50.0)
SIGMA_FORCE_mps2 = 230e-6 * 9.80665 * math.sqrt(1.57 * 50.0)
SIGMA_FIELD_T = 0.3e-6
SIGMA_PRESSURE_Pa = 20.0
SIGMA_ATTITUDE_rad = math.radians(1.0)
PING_LIMITS_m = (0.3, 100.0)
PING_VIEW_rad = math.radians(25.0)
DVL_LIMITS_m = (0.15, 75.0)
DVL_VIEW_rad = math.radians(22.5)
TEMPERATURE_EVERY = 10


def outlets(node: Node, vehicle: Vehicle) -> Outlets:
    """Publishers for every kind of reading the device of this node can make; topics are `DEVICE/...` of the table."""
    name = node.get_name()
    made: Outlets = {DeviceText: lambda text: node.get_logger().info(text.reading.text)}
    for topic in TOPICS:
        device, _, quantity = topic.name.partition("/")
        if device == name and quantity in _OUTLETS:
            readings, make = _OUTLETS[quantity]
            outlet = make(node, topic, vehicle)
            for reading in readings:
                made[reading] = _both(made.get(reading), outlet)
    return made


def _both(
    first: Callable[[Stamped[Any]], None] | None, second: Callable[[Stamped[Any]], None]
) -> Callable[[Stamped[Any]], None]:
    if first is None:
        return second

    def publish(stamped: Stamped[Any]) -> None:
        first(stamped)
        second(stamped)

    return publish


def _frame(node: Node) -> str:
    return f"{node.get_name()}_link"


def _inertial(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[Inertial]], None]:
    out, write = publisher(node, topic), inertial_writer(_frame(node), SIGMA_FORCE_mps2, SIGMA_RATE_radps)
    return lambda one: out.publish(write(one))


def _magnetic(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[Magnetic]], None]:
    out, write = publisher(node, topic), magnetic_writer(_frame(node), SIGMA_FIELD_T)
    return lambda one: out.publish(write(one))


def _pressure(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[Pressure]], None]:
    out, write = publisher(node, topic), pressure_writer(_frame(node), SIGMA_PRESSURE_Pa)
    return lambda one: out.publish(write(one))


def _temperature(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[Pressure]], None]:
    out, write = publisher(node, topic), temperature_writer(_frame(node))
    turn = 0

    def publish(stamped: Stamped[Pressure]) -> None:
        nonlocal turn
        turn = (turn + 1) % TEMPERATURE_EVERY
        if turn == 0:
            out.publish(write(stamped))

    return publish


def _echo(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[Echo]], None]:
    out, write = publisher(node, topic), echo_writer(_frame(node), PING_LIMITS_m, PING_VIEW_rad)
    return lambda one: out.publish(write(one.stamp, one.reading.range_m))


def _profile(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[EchoProfile]], None]:
    out, frame = publisher(node, topic), _frame(node)

    def publish(stamped: Stamped[EchoProfile]) -> None:
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
        out.publish(message)

    return publish


def _velocity(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[BottomVelocity]], None]:
    out, write = publisher(node, topic), velocity_writer(_frame(node))

    def publish(stamped: Stamped[BottomVelocity]) -> None:
        message = write(stamped)
        if message is not None:
            out.publish(message)

    return publish


def _attitude(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[BottomTrack]], None]:
    out, write = publisher(node, topic), attitude_writer(_frame(node), SIGMA_ATTITUDE_rad)
    return lambda one: out.publish(write(one))


def _altitude(node: Node, topic: Topic, _vehicle: Vehicle) -> Callable[[Stamped[BottomTrack | Echo]], None]:
    """A DVL-75 tells it beside its attitude, a Tracker 650 by itself."""
    out, write = publisher(node, topic), echo_writer(_frame(node), DVL_LIMITS_m, DVL_VIEW_rad)

    def publish(stamped: Stamped[BottomTrack | Echo]) -> None:
        found = stamped.reading
        altitude_m = found.range_m if isinstance(found, Echo) else found.altitude_m
        if altitude_m is not None:
            out.publish(write(stamped.stamp, altitude_m))

    return publish


def _detail(node: Node, topic: Topic, vehicle: Vehicle) -> Callable[[Stamped[BottomVelocity | BottomTrack]], None]:
    out, frame, also = publisher(node, topic), _frame(node), marine_acoustic.outlet(node)
    sound_mps = vehicle.water.speed_of_sound_mps
    write = dvl_writer(frame, sound_mps)
    latest: BottomTrack | None = None

    def publish(stamped: Stamped[BottomVelocity | BottomTrack]) -> None:
        nonlocal latest
        if isinstance(stamped.reading, BottomTrack):
            latest = stamped.reading
            return
        velocity = Stamped(stamped.stamp, stamped.reading)
        out.publish(write(velocity, latest))
        if also is not None:
            also(convert.dvl_to_msg(velocity, latest, frame, sound_mps))

    return publish


_OUTLETS: dict[str, tuple[tuple[type, ...], Callable[[Node, Topic, Vehicle], Callable[[Stamped[Any]], None]]]] = {
    "data_raw": ((Inertial,), _inertial),
    "mag": ((Magnetic,), _magnetic),
    "pressure": ((Pressure,), _pressure),
    "temperature": ((Pressure,), _temperature),
    "range": ((Echo,), _echo),
    "profile": ((EchoProfile,), _profile),
    "velocity": ((BottomVelocity,), _velocity),
    "attitude": ((BottomTrack,), _attitude),
    "altitude": ((BottomTrack, Echo), _altitude),
    "detail": ((BottomVelocity, BottomTrack), _detail),
}
