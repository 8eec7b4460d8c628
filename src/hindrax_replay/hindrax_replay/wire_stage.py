"""First stage of a replay: wire frames into the devices, and their messages compared with the recorded ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport, flat
from hindrax_bag.read.bag_reader import BagMessage, stamp_of
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import LEAK, MEASURED, RAW_FRAMES, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_replay.recorded_devices import Parameters, ReplayedDevice
from hindrax_ros.graph import message_class
from hindrax_ros.messages.serialization import deserialized, serialized

WINDOW = 4096
"""Messages processed together: one kind of work at a time is faster than alternating."""
AHEAD_NS = 1 * NS_PER_S
"""Wire frames are recorded in batches, later than the messages made of them, but never by as much as this."""
ACTIVATING_NS = NS_PER_S // 2
"""Longest time from opening the port to the first message of a device that answers at once."""
LOOK_AHEAD_S = 2.0
"""Within this part of a bag every recorded wire has carried frames."""
SAMPLE_NS = NS_PER_S
"""Distance of the samples of a reference."""
COMPARED = frozenset(resolved(topic) for topic in MEASURED.values() if topic is not LEAK)
"""A leak has no stamp by which it could be found again."""
RAW_NAMES = {resolved(topic): source for source, topic in RAW_FRAMES.items()}
AS_RECORDED, NOT_YET = b"", None
Samples = dict[str, dict[str, Any]]
"""Values that a reference keeps, by topic and time."""
Forward = Callable[[BagMessage, bytes | None], None]
"""Called with every input message of the next stages, and its replacement if the device publishes something else."""


class _Stream:
    """One topic of a device: replayed messages not compared yet, by stamp."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.device: ReplayedDevice | None = None
        self.made: dict[int, list[Any]] = {}
        """Lists, for several messages may have one stamp."""
        self.first = self.last = self.next_sample = 0

    def pop(self, stamp: int) -> Any:
        """Remove and return the next replayed message with this stamp; None when there is none."""
        made = self.made.get(stamp)
        if made is None:
            return None
        if len(made) == 1:
            del self.made[stamp]
        return made.pop(0)

    def activating(self, stamp: int) -> bool:
        """Whether the node was just being activated and may not have published yet."""
        opened = self.device.wire.opened if self.device else []
        return any(0 <= stamp - one < ACTIVATING_NS for one in opened)

    def note(self, stamp: int) -> bool:
        """Note the stamp of a recorded message; False for the first."""
        self.last = max(self.last, stamp)
        if not self.first:
            self.first = stamp
        return stamp > self.first


class WireStage:
    """Processes a bag message by message. Recorded messages wait in order until their replayed counterparts exist."""

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: Parameters,
        ledger: ComparisonReport,
        samples: Samples,
        forward: Forward,
        *,
        followed: frozenset[str],
    ) -> None:
        """`forward` is called with the messages of the topics `followed`."""
        self.begin, self.seconds = 0, 0.0
        self._vehicle, self._parameters = vehicle, parameters
        self._ledger, self._samples, self._forward = ledger, samples, forward
        self._followed, self._ordered = followed, followed | COMPARED
        self._devices: dict[str, ReplayedDevice] = {}
        self._streams: dict[str, _Stream] = {}
        self._window: list[BagMessage] = []
        self._waiting: deque[BagMessage] = deque()
        self._finishing = False

    def feed(self, message: BagMessage) -> None:
        """Feed the next message of the bag."""
        self._window.append(message)
        if len(self._window) >= WINDOW:
            self._process_window()

    def finish(self) -> None:
        """Compare the waiting messages, and report messages that were replayed but never recorded."""
        self._finishing = True
        self._process_window()
        for stream in self._streams.values():
            self._extra(stream)
        for device in self._devices.values():
            for sentence in device.wire.strange[:1]:
                count = len(device.wire.strange)
                self._ledger.unmatched(f"raw/{device.name}", device.wire.stamp, sentence, f"{count} times", "")

    def _process_window(self) -> None:
        window, self._window = self._window, []
        for message in window:
            topic, received = message.topic, message.received
            self.begin = self.begin or received
            self.seconds = max(self.seconds, (received - self.begin) / NS_PER_S)
            device = self._device(RAW_NAMES[topic]) if topic in RAW_NAMES else None
            if device is not None:
                device.frames(message.decoded())
        self._waiting += [one for one in window if one.topic in self._ordered]
        if self.seconds > LOOK_AHEAD_S or self._finishing:
            self._drain()

    def _device(self, name: str) -> ReplayedDevice | None:
        """Device of a wire; None when it is no sensor of the vehicle."""
        if name in self._vehicle.sensors and name not in self._devices:
            mount = self._vehicle.sensors[name]
            device = ReplayedDevice(name, mount, self._vehicle, self._parameters, self._add_made)
            self._devices[name] = device
            for topic in device.topics.values():
                self._stream(topic).device = device
        return self._devices.get(name)

    def _stream(self, topic: str) -> _Stream:
        if topic not in self._streams:
            self._streams[topic] = _Stream(topic)
        return self._streams[topic]

    def _add_made(self, topic: str, stamp: int, made: Any) -> None:
        self._stream(topic).made.setdefault(stamp, []).append(made)

    def _drain(self) -> None:
        """Settle recorded messages in order, as far as their counterparts exist."""
        waiting, streams = self._waiting, self._streams
        settled: list[tuple[BagMessage, bytes | None]] = []
        while waiting:
            message = waiting[0]
            stream = streams.get(message.topic)
            replaced = self._match(stream, message) if stream is not None else AS_RECORDED
            if replaced is NOT_YET:
                break
            if message.topic in self._followed:
                settled.append((message, replaced or None))
            waiting.popleft()
        for message, replaced in settled:
            self._forward(message, replaced)

    def _match(self, stream: _Stream, message: BagMessage) -> bytes | None:
        """Compare a recorded message with its counterpart; returns the counterpart if it differs, or NOT_YET."""
        stamp = stamp_of(message.data)
        made = stream.pop(stamp)
        if made is not None:
            # The first message was made while its node became active, without the history before it.
            same = stream.note(stamp) and self._compare(stream, message, stamp, made)
            return AS_RECORDED if same else serialized(made)
        reached = stream.device.wire.stamp if stream.device else 0
        if reached < stamp + AHEAD_NS and not self._finishing:
            return NOT_YET
        if stamp < reached - AHEAD_NS:
            self._ledger.unmatched(stream.topic, stamp, "recorded, not replayed", "a message", "none")
        return AS_RECORDED

    def _compare(self, stream: _Stream, message: BagMessage, stamp: int, made: Any) -> bool:
        if stamp >= stream.next_sample:
            stream.next_sample = stamp + SAMPLE_NS
            data = serialized(made)
            again = deserialized(data, message_class(message.type)) if message.form.old else message.form.decode(data)
            self._samples.setdefault(stream.topic, {})[str(stamp)] = dict(flat(again))
        return compare_lazily(self._ledger, message, stamp, made)

    def _extra(self, stream: _Stream) -> None:
        """Report messages replayed but not recorded, between the first and the last recorded one."""
        if not self._ledger.rules.of(stream.topic).sampled:
            for stamp in (stamp for stamp, made in stream.made.items() for _ in made):
                if stream.first < stamp < stream.last and not stream.activating(stamp):
                    self._ledger.unmatched(stream.topic, stamp, "replayed, not recorded", "none", "a message")


def compare_lazily(ledger: ComparisonReport, message: BagMessage, stamp: int, made: Any) -> bool:
    """Compare bytes first and fields only when they differ; True when nothing differs."""
    form = message.form
    if form.old:
        # Bytes of different message definitions cannot be compared, only fields.
        again = deserialized(serialized(made), message_class(message.type))
        ledger.compare_messages(message.topic, stamp, message.decoded(), again)
        return False
    return ledger.compare_bytes(message.topic, stamp, message.data, serialized(made), form.decode)
