"""The sensors process over a bag: recorded wire frames into the real devices, their readings to the real outlets."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from typing import Any

import yaml

from hindrax_bag.compare import Loader
from hindrax_bag.frames import RegisterWire, SerialWire, Wire
from hindrax_bag.stamps import stamp_of
from hindrax_core.events import Stamp, Stamped
from hindrax_core.knobs import build
from hindrax_core.readings import Pressure
from hindrax_core.topics import NAMESPACE, TOPICS, WATER_TEMPERATURE, resolved
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.nodes.outlets import outlets
from hindrax_drivers.registry import DEVICES
from hindrax_ros.convert import stamp_from_msg
from hindrax_ros.swift import temperature_writer

Take = Callable[[str, int, Any], None]
"""Told of everything a device publishes: full topic, stamp, message or its CDR bytes."""
Parameters = Mapping[str, Mapping[str, Any]]
IN_TABLE = frozenset(map(resolved, TOPICS))


class ReplayedDevice:
    """One device of the vehicle on its recorded wire. It stands in for the device's node towards the outlets."""

    def __init__(self, name: str, mount: Mount, vehicle: Vehicle, parameters: Parameters, take: Take) -> None:
        self._name, self._take = name, take
        row = DEVICES[mount.device]
        device = row.make(knobs_of(row.knobs, parameters, name), mount, vehicle)
        self.wire: Wire = SerialWire(device) if row.serial else RegisterWire(name, device)
        self.topics: set[str] = set()
        self._outlets = outlets(self, vehicle)
        if Pressure in self._outlets and resolved(WATER_TEMPERATURE) in self.topics:
            self._every_temperature()

    def frames(self, batch: Any) -> None:
        """Take one RawFrames message."""
        for stamp, direction, data in unpack(batch):
            for output in self.wire.frame(stamp, direction, data):
                if isinstance(output, Stamped):
                    outlet = self._outlets.get(type(output.reading))
                    if outlet is not None:
                        outlet(output)

    def get_name(self) -> str:
        """Name of the device, as its node is called."""
        return self._name

    def get_logger(self) -> logging.Logger:
        """Where the device's own words go."""
        return logging.getLogger(f"replay.{self._name}")

    def create_publisher(self, _message_type: object, name: str, _quality: object) -> ReplayedPublisher:
        """Make the publisher of one topic; what the topics table does not name was not recorded and is not compared."""
        topic = f"{NAMESPACE}/{name}"
        if topic not in IN_TABLE:
            return ReplayedPublisher(topic, _nothing)
        self.topics.add(topic)
        # The outlet counts readings since its node became active, which is not in the bag: every one is made instead.
        quiet = topic == resolved(WATER_TEMPERATURE)
        return ReplayedPublisher(topic, _nothing if quiet else self._take)

    def _every_temperature(self) -> None:
        publish, write = self._outlets[Pressure], temperature_writer(f"{self._name}_link")
        temperature = ReplayedPublisher(resolved(WATER_TEMPERATURE), self._take)

        def both(stamped: Stamped[Pressure]) -> None:
            publish(stamped)
            temperature.publish(write(stamped))

        self._outlets[Pressure] = both


def _nothing(_topic: str, _stamp: int, _message: object) -> None:
    return


class ReplayedPublisher:
    """Takes what an outlet publishes."""

    def __init__(self, topic: str, take: Take) -> None:
        self._topic, self._take = topic, take

    def publish(self, message: Any) -> None:
        """Hand a message, or its bytes, on."""
        stamp = stamp_of(message) if isinstance(message, bytes) else stamp_from_msg(message.header.stamp)
        self._take(self._topic, stamp, message)


def unpack(batch: Any) -> Iterator[tuple[Stamp, int, bytes]]:
    """Stamp, direction and bytes of every frame of a decoded RawFrames message."""
    start, data = 0, bytes(batch.data)
    for stamp, direction, length in zip(batch.stamps, bytes(batch.directions), batch.lengths, strict=True):
        yield Stamp(int(stamp)), direction, data[start : start + length]
        start += length


def knobs_of(kind: type[Any], parameters: Parameters, name: str) -> Any:
    """Knobs of a node as the parameters of the recorded run had them; defaults for what they do not name."""
    given = parameters.get(name, {})
    return build(kind, {one.name: given[one.name] for one in fields(kind) if one.name in given}, name)


def parameters_of(text: str) -> dict[str, dict[str, Any]]:
    """Parameters by node, out of the text of a ROS parameter file."""
    found: dict[str, dict[str, Any]] = {}
    for node, block in (yaml.load(text, Loader) or {}).items():  # noqa: S506  # a safe one
        name = node.rpartition("/")[2]
        found.setdefault(name, {}).update(block.get("ros__parameters", {}))
    return found
