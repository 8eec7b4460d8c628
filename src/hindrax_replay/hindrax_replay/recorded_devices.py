"""The sensors process over a bag: recorded wire frames into the real drivers, their readings to messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from hindrax_core.bus_operations import frames_in
from hindrax_core.events import Stamped
from hindrax_core.knobs import build
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.topics import resolved
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.driver_registry import DEVICES
from hindrax_drivers.nodes.reading_messages import ReadingMessages
from hindrax_replay.recorded_wires import RecordedWire, RegisterWire, SerialWire

AddMade = Callable[[str, int, Any], None]
"""Called with everything a device publishes: full topic, stamp, message or its CDR bytes."""
Parameters = Mapping[str, Mapping[str, Any]]


class ReplayedDevice:
    """One device of the vehicle on its recorded wire; its readings become messages."""

    def __init__(self, name: str, mount: Mount, vehicle: Vehicle, parameters: Parameters, add_made: AddMade) -> None:
        self.name, self._add_made = name, add_made
        row = DEVICES[mount.device]
        device = row.make(knobs_of(row.knobs, parameters, name), mount, vehicle)
        self.wire: RecordedWire = SerialWire(device) if row.serial else RegisterWire(name, device)
        self._messages = ReadingMessages(name, vehicle, str(parameters.get(name, {}).get("frame_id", "")))
        # Topics outside the table were not recorded and are not compared.
        self.topics = {topic.name: resolved(topic) for topic in self._messages.topics if topic.recorded}

    def frames(self, batch: Any) -> None:
        """Feed one RawFrames message to the device."""
        for stamp, direction, data in frames_in(batch):
            for output in self.wire.frame(stamp, direction, data):
                if isinstance(output, Stamped):
                    for name, message in self._messages.of(output):
                        if name in self.topics:
                            self._add_made(self.topics[name], output.stamp, message)


def knobs_of(kind: type[Any], parameters: Parameters, name: str) -> Any:
    """Knobs of a node from the parameters of the recorded run; defaults for the others."""
    given = parameters.get(name, {})
    return build(kind, {one.name: given[one.name] for one in fields(kind) if one.name in given}, name)


def parameters_of(text: str) -> dict[str, dict[str, Any]]:
    """Parameters by node, from the text of a ROS parameter file."""
    found: dict[str, dict[str, Any]] = {}
    for node, block in (read_yaml(text, "parameters of the bag") or {}).items():
        name = node.rpartition("/")[2]
        found.setdefault(name, {}).update(block.get("ros__parameters", {}))
    return found
