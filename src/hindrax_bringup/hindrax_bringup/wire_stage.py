"""First stage of a replay: wire frames into the devices, and what they publish held against what was recorded."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hindrax_bag.compare import Ledger, flat
from hindrax_bag.reader import BagMessage
from hindrax_bag.stamps import stamp_of
from hindrax_bringup.state_stage import HEARD
from hindrax_bringup.wire_replay import Parameters, ReplayedDevice
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import RAW_FRAMES, TOPICS, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ros.graph import message_class
from hindrax_ros.serialized import deserialized, serialized

WINDOW = 4096
"""Messages that are worked off together: one kind of work at a time is faster than all in turn."""
AHEAD_NS = 1 * NS_PER_S
"""Wire frames travel in batches: what is published of them is recorded earlier, but never by as much as this."""
ACTIVATING_NS = NS_PER_S // 2
"""A node publishes at the latest so long after its port was opened, if its device answers at once."""
LOOK_AHEAD_S = 2.0
"""In so much of a bag every device has been heard on its wire, if its frames were recorded at all."""
SAMPLE_NS = NS_PER_S
"""Distance of the samples of a reference."""
COMPARED = {resolved(topic) for topic in TOPICS if "/" in topic.name and not topic.name.startswith(("raw/", "/"))}
RAW_NAMES = {resolved(topic): topic.name.partition("/")[2] for topic in RAW_FRAMES}
AS_RECORDED, NOT_YET = b"", None
Samples = dict[str, dict[str, Any]]
"""Values that a reference keeps, by topic and time."""
Tell = Callable[[BagMessage, bytes | None], None]
"""Told of every message that the next stage hears, and of what the device says now instead."""


class _Stream:
    """One topic that a device makes: what was made and not compared yet, by its stamp."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.device: ReplayedDevice | None = None
        self.made: dict[int, list[Any]] = {}
        """Lists, for what arrives together may have one stamp."""
        self.first = self.last = self.next_sample = 0

    def take(self, stamp: int) -> Any:
        """Take the next that was made with this stamp; None when there is none."""
        made = self.made.get(stamp)
        if made is None:
            return None
        if len(made) == 1:
            del self.made[stamp]
        return made.pop(0)

    def activating(self, stamp: int) -> bool:
        """Whether the node was only just becoming active (again), and may not have published yet."""
        opened = self.device.wire.opened if self.device else []
        return any(0 <= stamp - one < ACTIVATING_NS for one in opened)

    def note(self, stamp: int) -> bool:
        """Note the stamp of a recorded message; False for the first."""
        self.last = max(self.last, stamp)
        if not self.first:
            self.first = stamp
        return stamp > self.first


class WireStage:
    """Takes a bag message by message. Recorded messages wait in their order until their counterparts are made."""

    def __init__(self, vehicle: Vehicle, parameters: Parameters, ledger: Ledger, samples: Samples, tell: Tell) -> None:
        self.begin, self.seconds = 0, 0.0
        self._vehicle, self._parameters = vehicle, parameters
        self._ledger, self._samples, self._tell = ledger, samples, tell
        self._devices: dict[str, ReplayedDevice] = {}
        self._streams: dict[str, _Stream] = {}
        self._window: list[BagMessage] = []
        self._waiting: deque[BagMessage] = deque()
        self._finishing = False

    def hear(self, message: BagMessage) -> None:
        """Take the next message of the bag."""
        self._window.append(message)
        if len(self._window) >= WINDOW:
            self._work()

    def finish(self) -> None:
        """Compare what still waits, and look for what was made but never recorded."""
        self._finishing = True
        self._work()
        for stream in self._streams.values():
            self._extra(stream)
        for device in self._devices.values():
            for sentence in device.wire.strange[:1]:
                count = len(device.wire.strange)
                self._ledger.unmatched(f"raw/{device.get_name()}", device.wire.stamp, sentence, f"{count} times", "")

    def _work(self) -> None:
        window, self._window = self._window, []
        for message in window:
            topic, received = message.topic, message.received
            self.begin = self.begin or received
            self.seconds = max(self.seconds, (received - self.begin) / NS_PER_S)
            device = self._device(RAW_NAMES[topic]) if topic in RAW_NAMES else None
            if device is not None:
                device.frames(message.decoded())
        self._waiting += [one for one in window if one.topic in COMPARED]
        if self.seconds > LOOK_AHEAD_S or self._finishing:
            self._drain()

    def _device(self, name: str) -> ReplayedDevice | None:
        """Device of a wire; None when it is no sensor of the vehicle."""
        if name in self._vehicle.sensors and name not in self._devices:
            mount = self._vehicle.sensors[name]
            device = ReplayedDevice(name, mount, self._vehicle, self._parameters, self._take)
            self._devices[name] = device
            for topic in device.topics:
                self._stream(topic).device = device
        return self._devices.get(name)

    def _stream(self, topic: str) -> _Stream:
        if topic not in self._streams:
            self._streams[topic] = _Stream(topic)
        return self._streams[topic]

    def _take(self, topic: str, stamp: int, made: Any) -> None:
        self._stream(topic).made.setdefault(stamp, []).append(made)

    def _drain(self) -> None:
        """Settle recorded messages in their order, as far as their counterparts are made."""
        waiting, streams = self._waiting, self._streams
        settled: list[tuple[BagMessage, bytes | None]] = []
        while waiting:
            message = waiting[0]
            stream = streams.get(message.topic)
            said = self._settle(stream, message) if stream is not None else AS_RECORDED
            if said is NOT_YET:
                break
            if message.topic in HEARD:
                settled.append((message, said or None))
            waiting.popleft()
        for message, said in settled:
            self._tell(message, said)

    def _settle(self, stream: _Stream, message: BagMessage) -> bytes | None:
        """Compare a recorded message with its counterpart; returns that where it differs, or NOT_YET."""
        stamp = stamp_of(message.data)
        made = stream.take(stamp)
        if made is not None:
            # The first message was made while its node became active: it did not know what came before.
            same = stream.note(stamp) and self._compare(stream, message, stamp, made)
            return AS_RECORDED if same else serialized(made)
        heard = stream.device.wire.stamp if stream.device else 0
        if heard < stamp + AHEAD_NS and not self._finishing:
            return NOT_YET
        if stamp < heard - AHEAD_NS:
            self._ledger.unmatched(stream.topic, stamp, "recorded, not replayed", "a message", "none")
        return AS_RECORDED

    def _compare(self, stream: _Stream, message: BagMessage, stamp: int, made: Any) -> bool:
        if stamp >= stream.next_sample:
            stream.next_sample = stamp + SAMPLE_NS
            data = serialized(made)
            again = deserialized(data, message_class(message.type)) if message.form.old else message.form.decode(data)
            self._samples.setdefault(stream.topic, {})[str(stamp)] = dict(flat(again))
        return weigh(self._ledger, message, stamp, made)

    def _extra(self, stream: _Stream) -> None:
        """Messages that were made but not recorded, between the first and the last that were."""
        if not self._ledger.rules.of(stream.topic).sampled:
            for stamp in (stamp for stamp, made in stream.made.items() for _ in made):
                if stream.first < stamp < stream.last and not stream.activating(stamp):
                    self._ledger.unmatched(stream.topic, stamp, "replayed, not recorded", "none", "a message")


def weigh(ledger: Ledger, message: BagMessage, stamp: int, made: Any) -> bool:
    """Compare with a message, or its bytes, unpacking fields only when something differs; True when nothing does."""
    form = message.form
    if form.old:
        # Bytes of different forms cannot be compared, only what they say.
        again = deserialized(serialized(made), message_class(message.type))
        ledger.compare_messages(message.topic, stamp, message.decoded(), again)
        return False
    if not isinstance(made, bytes) and form.same(message.data, made):
        ledger.agree(message.topic, message.data, form.decode)
        return True
    return ledger.compare_bytes(message.topic, stamp, message.data, serialized(made), form.decode)
