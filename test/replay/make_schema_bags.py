"""Make a small bag of every version of our messages, as the recorder of that day would have written it.

    python test/replay/make_schema_bags.py [VERSION ...]

When a message changes: write its step into `hindrax_bag/definitions.py`, and make the bag of the new version
here. Those of earlier versions stay as they are, unless the reference bag that they are made of was changed.
"""

import sys
from pathlib import Path
from typing import Any

from mcap_ros2._dynamic import serialize_dynamic

from hindrax_bag.definitions import STEPS, VERSION, definition
from hindrax_bag.metadata import Channel
from hindrax_bag.read.bag_reader import attachments, messages
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import TOPICS, resolved
from hindrax_ros.messages.share import share_lookup

HERE = Path(__file__).parent
SPAN_NS = 12 * NS_PER_S
NOW = {"uint16": "float32"}
"""Kinds of today, by those of before, of the fields that were turned."""


def before(package: str, name: str, version: int) -> str:
    """Text of a definition of ours as it was in a version: today's, with every later step taken back."""
    lines = share_lookup(package, name).splitlines(keepends=True)
    for step in STEPS:
        if step.version > version and step.type == f"{package}/msg/{name}":
            lines = [line for line in lines if not set(line.split()[1:2]) & set(step.added)]
            for field, (kind, _) in step.turned.items():
                lines = [line.replace(NOW[kind], kind) if line.split()[1:2] == [field] else line for line in lines]
    return "".join(lines)


def make(version: int) -> None:
    """Write a few seconds of the messages of a reference bag in the form of a version."""

    def lookup(package: str, name: str) -> str:
        return before(package, name, version)

    source = HERE / "bags" / "surge"
    bag = BagWriter(HERE / "schemas" / str(version), lookup, limits=BagLimits(keep_free_MB=0.0))
    bag.open()
    bag.describe("hindrax", {"notes": f"messages of version {version} in mock"})
    bag.attach("vehicle.yaml", "application/yaml", attachments(source)["vehicle.yaml"], 0)
    qualities = {resolved(topic): topic.quality for topic in TOPICS}
    begin = 0
    for message in messages(source):
        begin = begin or message.received
        if "raw/" not in message.topic and message.received - begin < SPAN_NS:
            data = _encoded(message.type, definition(message.type, lookup), message.decoded())
            bag.write(
                Channel(message.topic, message.type, (qualities[message.topic],)), data, message.received, message.sent
            )
    bag.close()


def _encoded(type_name: str, text: str, message: Any) -> bytes:
    for name in ("pulses", "lights"):
        if f"uint16[] {name}" in text:
            setattr(message, name, [round(value) for value in getattr(message, name)])
    data: bytes = serialize_dynamic(type_name, text)[type_name](message)
    return data


if __name__ == "__main__":
    for wanted in sys.argv[1:] or range(1, VERSION + 1):
        make(int(wanted))
