"""The recorder: the topics of the vehicle into one bag, CDR bytes untouched.

It runs in a process of its own, so that a slow disk never slows the control loop. Messages arrive as bytes (raw
subscriptions) and are written as they are.
"""

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from hindrax_bag import software_version
from hindrax_bag.metadata import DESCRIPTION, SHORTEST_FOREVER_S, Channel
from hindrax_bag.read.bag_reader import valid_stamp
from hindrax_bag.read.recovery import begin_completion
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits, free_bytes
from hindrax_core.errors import UsageError, cause
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.topics import TOPICS, Quality, Topic, topics_of
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher, status
from hindrax_ros.graph import profile
from hindrax_ros.messages.serialization import message_class
from hindrax_ros.messages.share import share_lookup
from hindrax_ros.parameters import knobs, text
from hindrax_ros.process import spin

MessageInfo = Mapping[str, int]
"""Message info of rclpy."""
FLUSH_S = 0.5
SYNC_EVERY = 2
QUEUE = 4000
"""Queue length of one topic; further messages are lost, and counted."""


class PublicationGaps:
    """Lost messages of one topic, by gaps in the sequence numbers of its publishers.

    A middleware reports messages lost on the wire, but not those dropped from a full queue. A number does not name its
    publisher; it is assigned to the one whose next number it is.
    """

    def __init__(self, publishers: Callable[[], int]) -> None:
        """`publishers`: how many the topic has; asked only when a number is not the next of any."""
        self.lost = 0
        self._publishers = publishers
        self._last: list[int] = []

    def count(self, number: int) -> None:
        """Count the next message by its number."""
        last = self._last
        if number - 1 in last:
            last[last.index(number - 1)] = number
            return
        if last and len(last) >= self._publishers():
            before = [one for one in last if one < number]
            if before:
                self.lost += number - max(before) - 1
            # Without one before it a publisher has restarted.
            last.remove(max(before) if before else min(last))
        last.append(number)


class Recorder(BatchedNode):
    """Subscribes to the recorded topics of the table and writes their messages."""

    def __init__(self) -> None:
        super().__init__("recorder")
        folder = Path(text(self, "bag", "", "folder of the bag [-]"))
        vehicle = text(self, "vehicle", "", "vehicle file, stored in the bag [-]")
        notes = text(self, "notes", "", "description of this run, stored in the bag [-]")
        truth = text(self, "truth", "", "true coefficients of a mock vehicle as JSON, stored in the bag [-]")
        self._bag = BagWriter(folder, share_lookup)
        self._bag.limits = knobs(self, BagLimits, partial(setattr, self._bag, "limits"))
        unfinished = self._bag.open(resume=True)
        self._describe({"notes": notes, "truth": truth}, vehicle)
        self._completion = begin_completion(unfinished)
        if self._bag.path.stem != f"{folder.name}_0":
            self.get_logger().warning(f"{folder} exists already; recording continues in {self._bag.path.name}")
        self._reporter = DiagnosticsPublisher(self)
        self._gaps: dict[str, PublicationGaps] = {}
        self._invalid_stamps: Counter[str] = Counter()
        self._early: list[tuple[Channel, bytes, int]] = []
        self._received = Stamp(0)
        self._flushes = 0
        for topic in self._topics(vehicle):
            publishers = partial(self.count_publishers, self.resolve_topic_name(topic.name))
            self._gaps[topic.name] = PublicationGaps(publishers)
            deep = profile(replace(topic.quality, depth=QUEUE, deadline_s=0.0, lifespan_s=0.0))
            self.create_subscription(message_class(topic.type), topic.name, self._writer(topic), deep, raw=True)
        # In wall time, whatever the mock's clock does: a power cut follows no clock.
        self.every(FLUSH_S, self._flush)

    def _topics(self, vehicle: str) -> Iterable[Topic]:
        """Topics of the vehicle, and those of the usual names: a sensor beside the stack is in no vehicle file."""
        named: tuple[Topic, ...] = ()
        try:
            named = topics_of(load_vehicle(vehicle)) if vehicle else ()
        except UsageError as error:  # what can be recorded is
            self.get_logger().error(f"sensors whose names differ from their kinds are not recorded: {error}")
        return {one.name: one for one in (*TOPICS, *named)}.values()

    def _describe(self, values: dict[str, str], vehicle: str) -> None:
        rmw = os.environ.get("RMW_IMPLEMENTATION", "")
        values |= {"version": software_version(), "rmw": rmw, "namespace": self.get_namespace()}
        self._bag.describe(DESCRIPTION, values)
        files = {"vehicle.yaml": vehicle, "parameters.yaml": parameter_file(sys.argv)}
        for name, path in files.items():
            if path:
                self._bag.attach(name, "application/yaml", Path(path).read_bytes(), self.now())

    def _writer(self, topic: Topic) -> Callable[[bytes, MessageInfo], None]:
        fields = message_class(topic.type).get_fields_and_field_types()
        stamped = next(iter(fields.values()), "") == "std_msgs/Header"
        write, now, early = self._bag.write, self.now, self._early
        count, invalid = self._gaps[topic.name].count, self._invalid_stamps
        channel: Channel | None = None

        def write_message(data: bytes, info: MessageInfo) -> None:
            nonlocal channel
            if channel is None:
                channel = self._channel(topic)
            number = info["publication_sequence_number"]
            if number is not None:
                count(number)
            sent = valid_stamp(data) if stamped else None
            if stamped and sent is None:
                invalid[topic.name] += 1
            received = self._received = self._received or now()
            if not received:
                # No /clock message yet: these messages wait for the first one.
                early.append((channel, data, sent or 0))
                return
            if early:
                self._write_early(received)
            write(channel, data, received, received if sent is None else sent)

        return write_message

    def drain(self) -> None:
        """Write every waiting message; all that waited have one time of receipt, read after /clock."""
        self._received = Stamp(0)
        super().drain()

    def _write_early(self, received: int) -> None:
        for channel, data, sent in self._early:
            self._bag.write(channel, data, received, sent or received)
        self._early.clear()

    def _channel(self, topic: Topic) -> Channel:
        """Describe a topic as its publishers offer it; without a publisher, as in the table."""
        name = self.resolve_topic_name(topic.name)
        found = self.get_publishers_info_by_topic(name)
        offered = dict.fromkeys(offered_quality(one.qos_profile, topic.quality) for one in found)
        found_hash = next(filter(None, (type_hash(one.topic_type_hash) for one in found)), "")
        return Channel(name, topic.type, tuple(offered) or (topic.quality,), found_hash)

    def _flush(self) -> None:
        self._flushes += 1
        sync = self._flushes % SYNC_EVERY == 0
        for sentence in self._bag.flush(sync=sync):
            self.get_logger().warning(sentence)
        if sync:
            self._report()

    def _report(self) -> None:
        bag, lost = self._bag, Counter({name: gaps.lost for name, gaps in self._gaps.items() if gaps.lost})
        invalid = self._invalid_stamps
        values = {
            "messages": str(bag.counts.total()),
            "lost": str(lost.total()),
            "size [MB]": f"{bag.size_bytes / 1e6:.1f}",
            "free [MB]": _free_MB(bag.folder),
            "bag": str(bag.path),
            **{f"lost: {topic}": str(count) for topic, count in sorted(lost.items())},
            **{f"invalid stamps: {topic}": str(count) for topic, count in sorted(invalid.items())},
        }
        level = DiagnosticStatus.ERROR if bag.stopped else DiagnosticStatus.WARN if lost else DiagnosticStatus.OK
        message = bag.stopped or (f"recording; {lost.total()} messages lost" if lost else "recording")
        self._reporter.publish(self.now(), status("hindrax: recorder", level, message, values))

    def close(self) -> None:
        """Write what has arrived, and finish the bag with its index."""
        try:
            self.drain()
        finally:
            if self._early:
                self._write_early(max(sent for _, _, sent in self._early))
            self._bag.close()
            if self._bag.stopped:
                self.get_logger().error(self._bag.stopped)
            if self._completion is not None:
                self._completion.wait()
                self._bag.index()


def _free_MB(folder: Path) -> str:
    try:
        return f"{free_bytes(folder) / 1e6:.0f}"
    except OSError as error:  # the folder is gone, or its disk
        return cause(error)


def offered_quality(found: QoSProfile, declared: Quality) -> Quality:
    """Quality that a publisher offers; the graph has no queue depth, so it is that of the table."""
    return Quality(
        reliable=found.reliability == ReliabilityPolicy.RELIABLE,
        depth=found.depth or declared.depth,
        latched=found.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        deadline_s=_limited_s(found.deadline),
        lifespan_s=_limited_s(found.lifespan),
    )


def _limited_s(found: Duration) -> float:
    """Seconds of a duration; 0 for an infinite one."""
    return 0.0 if found.nanoseconds >= SHORTEST_FOREVER_S * NS_PER_S else found.nanoseconds / NS_PER_S


def type_hash(found: object) -> str:
    """Format a type hash as rosbag2 does: RIHS01_ and the digits; empty if the middleware gives none."""
    version, value = getattr(found, "version", 0), getattr(found, "value", b"")
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
