"""Topics of the identification, and the measurement in each message; used live and over a bag."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from hindrax_core.events import Stamped
from hindrax_core.signals import Phase, Thrust
from hindrax_core.topics import ALLOCATION, DVL_DETAIL, MANEUVER, NAVIGATION, PRESSURE, Topic
from hindrax_ident.records.feed import Measurement
from hindrax_ros.convert import dvl_from_msg, navigation_from_msg, pressure_from_msg, stamp_from_msg
from hindrax_ros.fast_serialization import dvl_from_bytes, navigation_from_bytes, pressure_from_bytes, thrust_from_bytes

Listen: TypeAlias = Callable[[Any], Stamped[Measurement]]


def _thrust(message: Any) -> Stamped[Measurement]:
    X, Y, Z, K, M, N = (float(value) for value in message.achieved)
    forces = tuple(float(value) for value in message.forces)
    return Stamped(stamp_from_msg(message.header.stamp), Thrust((X, Y, Z, K, M, N), forces))


def _phase(message: Any) -> Stamped[Measurement]:
    return Stamped(stamp_from_msg(message.header.stamp), Phase(message.motion, message.phase))


AS_BYTES: dict[Topic, Callable[[bytes], Stamped[Measurement]]] = {
    DVL_DETAIL: dvl_from_bytes,
    PRESSURE: pressure_from_bytes,
    NAVIGATION: navigation_from_bytes,
    ALLOCATION: thrust_from_bytes,
}
"""High-rate topics of `LISTENERS`, decoded without message objects."""

LISTENERS: dict[Topic, Listen] = {
    DVL_DETAIL: dvl_from_msg,
    PRESSURE: pressure_from_msg,
    NAVIGATION: navigation_from_msg,
    ALLOCATION: _thrust,
    MANEUVER: _phase,
}
