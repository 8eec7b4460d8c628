"""The recorder: every recorded row of the topics table into one bag, CDR bytes untouched.

It runs in a process of its own, so that a slow disk never slows the control loop. Messages arrive as bytes (raw
subscriptions) and are written as they are.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from hindrax_bag.gaps import Gaps
from hindrax_bag.limits import Limits, free_bytes
from hindrax_bag.metadata import SHORTEST_FOREVER_S
from hindrax_bag.software import software_version
from hindrax_bag.stamps import stamp_of
from hindrax_bag.writer import BagWriter, Channel
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.topics import TOPICS, Quality, Topic, resolved
from hindrax_ros.graph import message_class, profile
from hindrax_ros.health import Reporter, status
from hindrax_ros.parameters import knobs, text
from hindrax_ros.polled import PolledNode
from hindrax_ros.process import spin

MessageInfo = dict[str, Any]
"""What rclpy tells beside a message."""
FLUSH_S = 0.5
SYNC_EVERY = 2
QUEUE = 4000
"""Messages of one topic that may wait for the recorder; more are lost, and counted."""


class Recorder(PolledNode):
    """Subscribes to what the table says is recorded and writes it down."""

    def __init__(self) -> None:
        super().__init__("recorder")
        folder = Path(text(self, "bag", "", "folder of the bag [-]"))
        vehicle = text(self, "vehicle", "", "vehicle file, kept inside the bag [-]")
        notes = text(self, "notes", "", "what this run is, kept inside the bag [-]")
        self._bag = BagWriter(folder, limits=knobs(self, Limits))
        self._bag.open()
        self._describe(notes, vehicle)
        self._reporter = Reporter(self)
        self._gaps: dict[str, Gaps] = {}
        self._early: list[tuple[Channel, bytes, int]] = []
        self._flushes = 0
        for topic in TOPICS:
            if topic.recorded:
                self._listen(topic)
        # In wall time, whatever the mock's clock does: a power cut asks no clock.
        self.every(FLUSH_S, self._flush)

    def _now(self) -> Stamp:
        return Stamp(self.get_clock().now().nanoseconds)

    def _describe(self, notes: str, vehicle: str) -> None:
        rmw = os.environ.get("RMW_IMPLEMENTATION", "")
        self._bag.describe("hindrax", {"notes": notes, "version": software_version(), "rmw": rmw})
        files = {"vehicle.yaml": vehicle, "parameters.yaml": parameter_file(sys.argv)}
        for name, path in files.items():
            if path:
                self._bag.attach(name, "application/yaml", Path(path).read_bytes(), self._now())

    def _listen(self, topic: Topic) -> None:
        """Subscribe with a deep queue of our own."""
        self._gaps[topic.name] = Gaps(partial(self.count_publishers, resolved(topic)))
        quality = replace(topic.quality, depth=QUEUE, deadline_s=0.0, lifespan_s=0.0)
        self.create_subscription(message_class(topic.type), topic.name, self._keeper(topic), profile(quality), raw=True)

    def _keeper(self, topic: Topic) -> Callable[[bytes, MessageInfo], None]:
        stamped = starts_with_stamp(topic)
        write, now, early = self._bag.write, self.get_clock().handle.get_now, self._early
        hear = self._gaps[topic.name].hear
        channel: Channel | None = None

        def keep(data: bytes, info: MessageInfo) -> None:
            nonlocal channel
            if channel is None:
                channel = self._channel(topic)
            number = info["publication_sequence_number"]
            if number is not None:
                hear(number)
            received = now().nanoseconds
            if not received:
                # The mock's clock has not been heard yet: these messages wait for its first word.
                early.append((channel, data, stamp_of(data) if stamped else 0))
                return
            if early:
                self._place(received)
            write(channel, data, received, stamp_of(data) if stamped else received)

        return keep

    def _place(self, received: int) -> None:
        for channel, data, sent in self._early:
            self._bag.write(channel, data, received, sent or received)
        self._early.clear()

    def _channel(self, topic: Topic) -> Channel:
        """Describe a topic as its publishers do, once there is one; as the table does where none is seen."""
        name = resolved(topic)
        found = self.get_publishers_info_by_topic(name)
        offered = dict.fromkeys(offered_quality(one.qos_profile, topic.quality) for one in found)
        told = next(filter(None, (type_hash(one.topic_type_hash) for one in found)), "")
        return Channel(name, topic.type, tuple(offered) or (topic.quality,), told)

    def _flush(self) -> None:
        self._flushes += 1
        for sentence in self._bag.flush(sync=self._flushes % SYNC_EVERY == 0):
            self.get_logger().warning(sentence)
        if self._flushes % SYNC_EVERY == 0:
            self._report()

    def _report(self) -> None:
        bag, lost = self._bag, Counter({name: gaps.lost for name, gaps in self._gaps.items() if gaps.lost})
        values = {
            "messages": str(bag.counts.total()),
            "lost": str(lost.total()),
            "size [MB]": f"{bag.size_bytes / 1e6:.1f}",
            "free [MB]": f"{free_bytes(bag.folder) / 1e6:.0f}",
            "bag": str(bag.path),
            **{f"lost: {topic}": str(count) for topic, count in sorted(lost.items())},
        }
        level = DiagnosticStatus.ERROR if bag.stopped else DiagnosticStatus.WARN if lost else DiagnosticStatus.OK
        said = bag.stopped or (f"recording; {lost.total()} messages lost" if lost else "recording")
        self._reporter.publish(self._now(), status("hindrax: recorder", level, said, values))

    def close(self) -> None:
        """Finish the bag with its index."""
        if self._early:
            self._place(max(sent for _, _, sent in self._early))
        self._bag.close()


def starts_with_stamp(topic: Topic) -> bool:
    """Whether the first field of the type is a std_msgs/Header."""
    fields = message_class(topic.type).get_fields_and_field_types()
    return next(iter(fields.values()), "") == "std_msgs/Header"


def offered_quality(found: QoSProfile, said: Quality) -> Quality:
    """Quality that a publisher offers; how deep its queue is the graph does not tell: as the table has it."""
    return Quality(
        reliable=found.reliability == ReliabilityPolicy.RELIABLE,
        depth=found.depth or said.depth,
        latched=found.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        deadline_s=_limited_s(found.deadline),
        lifespan_s=_limited_s(found.lifespan),
    )


def _limited_s(found: Duration) -> float:
    """Seconds of a duration; 0 where it is without end."""
    return 0.0 if found.nanoseconds >= SHORTEST_FOREVER_S * NS_PER_S else found.nanoseconds / NS_PER_S


def type_hash(found: object) -> str:
    """Write a type hash of the graph as rosbag2 does: RIHS01_ and the digits; empty when the middleware tells none."""
    version, value = getattr(found, "version", -1), getattr(found, "value", b"")
    return f"RIHS{version:02d}_{bytes(value).hex()}" if version > 0 and any(value) else ""


def parameter_file(words: Sequence[str]) -> str:
    """Name of the parameter file among the arguments of the process; empty without one."""
    names = [value for word, value in pairwise(words) if word == "--params-file"]
    return names[-1] if names else ""


def main() -> int:
    """Run the recorder until a signal."""
    return spin(lambda: [Recorder()])


if __name__ == "__main__":
    sys.exit(main())
