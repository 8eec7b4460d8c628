"""First stage of a replay: wire frames into the devices, and their messages compared with the recorded ones."""

from collections import deque
from collections.abc import Callable
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport, flat
from hindrax_bag.read.bag_reader import BagMessage, stamp_of
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import LEAK, raw_topic, resolved, sensor_topics
from hindrax_core.vehicle import Vehicle
from hindrax_replay.recorded_devices import Parameters, ReplayedDevice
from hindrax_ros.messages.serialization import deserialized, message_class, serialized

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
AS_RECORDED, NOT_YET = b"", None


def compared(vehicle: Vehicle) -> frozenset[str]:
    """Topics of the sensors; a leak has no stamp by which it could be found again."""
    topics = (one for name, mount in vehicle.sensors.items() for one in sensor_topics(name, mount.device).values())
    return frozenset(resolved(topic) for topic in topics if topic != LEAK)


class ReferenceSamples(dict[str, dict[str, Any]]):
    """Values that a reference keeps, by topic and time: a message of each topic a second."""

    def __init__(self) -> None:
        super().__init__()
        self._next: dict[str, int] = {}

    def due(self, topic: str, stamp: int) -> bool:
        """Whether the next sample of a topic is due; if so, the one after it counts from now on."""
        if stamp < self._next.get(topic, 0):
            return False
        self._next[topic] = stamp + SAMPLE_NS
        return True

    def keep(self, topic: str, key: object, message: object) -> None:
        """Keep the values of a message.

        Parameters
        ----------
        topic, key
            Where they are kept.
        message
            Decoded.
        """
        self.setdefault(topic, {})[str(key)] = dict(flat(message))


class _Stream:
    """One topic of a device: replayed messages not compared yet, by stamp."""

    def __init__(self, topic: str, device: ReplayedDevice) -> None:
        self.topic, self.device = topic, device
        self.made: dict[int, list[object]] = {}
        """Lists, for several messages may have one stamp."""
        self.first = self.last = 0

    def pop(self, stamp: int) -> object:
        """Remove and return the next replayed message with this stamp; None when there is none."""
        made = self.made.pop(stamp, [None])
        if len(made) > 1:
            self.made[stamp] = made[1:]
        return made[0]

    def activating(self, stamp: int) -> bool:
        """Whether the node was just being activated and may not have published yet."""
        return any(0 <= stamp - one < ACTIVATING_NS for one in self.device.wire.opened)

    def note(self, stamp: int) -> bool:
        """Note the stamp of a recorded message; False for the first."""
        self.first, self.last = self.first or stamp, max(self.last, stamp)
        return stamp > self.first


class WireStage:
    """Processes a bag message by message. Recorded messages wait in order until their replayed counterparts exist."""

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: Parameters,
        ledger: ComparisonReport,
        samples: ReferenceSamples,
        forward: Callable[[bytes | None], None],
        *,
        followed: frozenset[str],
    ) -> None:
        """`forward` is called for each message of `followed`, with the replacement if the device gives another."""
        self.begin, self.seconds = 0, 0.0
        self._vehicle, self._parameters = vehicle, parameters
        self._ledger, self._samples, self._forward = ledger, samples, forward
        self._followed, self._ordered = followed, followed | compared(vehicle)
        self._raw = {resolved(raw_topic(name)): name for name in vehicle.sensors}
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
        """Compare the waiting messages, and report those replayed, but not recorded between the first and the last."""
        self._finishing = True
        self._process_window()
        for stream in self._streams.values():
            if self._ledger.rules.of(stream.topic).sampled:
                continue
            for stamp in (stamp for stamp, made in stream.made.items() for _ in made):
                if stream.first < stamp < stream.last and not stream.activating(stamp):
                    self._ledger.unmatched(stream.topic, stamp, "replayed, not recorded", "none", "a message")
        for device in self._devices.values():
            for sentence in device.wire.mismatches[:1]:
                count = len(device.wire.mismatches)
                self._ledger.unmatched(f"raw/{device.name}", device.wire.stamp, sentence, f"{count} times", "")

    def _process_window(self) -> None:
        window, self._window = self._window, []
        for message in window:
            topic, received = message.topic, message.received
            self.begin = self.begin or received
            self.seconds = max(self.seconds, (received - self.begin) / NS_PER_S)
            if topic in self._raw and (device := self._device(self._raw[topic])) is not None:
                device.frames(message.decoded())
        self._waiting += [one for one in window if one.topic in self._ordered]
        if self.seconds > LOOK_AHEAD_S or self._finishing:
            self._drain()

    def _device(self, name: str) -> ReplayedDevice | None:
        """Device of a wire; None when it is no sensor of the vehicle."""
        if name in self._vehicle.sensors and name not in self._devices:
            device = ReplayedDevice(name, self._vehicle, self._parameters, self._add_made)
            self._devices[name] = device
            self._streams |= {topic: _Stream(topic, device) for topic in device.topics.values()}
        return self._devices.get(name)

    def _add_made(self, topic: str, stamp: int, made: object) -> None:
        self._streams[topic].made.setdefault(stamp, []).append(made)

    def _drain(self) -> None:
        """Settle recorded messages in order, as far as their counterparts exist."""
        waiting, streams = self._waiting, self._streams
        while waiting:
            message = waiting[0]
            stream = streams.get(message.topic)
            replaced = self._match(stream, message) if stream is not None else AS_RECORDED
            if replaced is NOT_YET:
                break
            if message.topic in self._followed:
                self._forward(replaced or None)
            waiting.popleft()

    def _match(self, stream: _Stream, message: BagMessage) -> bytes | None:
        """Compare a recorded message with its counterpart; returns the counterpart if it differs, or NOT_YET."""
        stamp = stamp_of(message.data)
        made = stream.pop(stamp)
        if made is not None:
            if not stream.note(stamp):  # made while its node became active, without the history before it
                return serialized(made)
            if self._samples.due(stream.topic, stamp):
                data, form = serialized(made), message.form
                again = deserialized(data, message_class(message.type)) if form.old else form.decode(data)
                self._samples.keep(stream.topic, stamp, again)
            return AS_RECORDED if compare_lazily(self._ledger, message, stamp, made) else serialized(made)
        reached = stream.device.wire.stamp
        if reached < stamp + AHEAD_NS and not self._finishing:
            return NOT_YET
        if stamp < reached - AHEAD_NS:
            self._ledger.unmatched(stream.topic, stamp, "recorded, not replayed", "a message", "none")
        return AS_RECORDED


def compare_lazily(ledger: ComparisonReport, message: BagMessage, stamp: int, made: object) -> bool:
    """Compare bytes first, and fields only when they differ.

    Parameters
    ----------
    ledger
        Gets what differs.
    message
        As it was recorded.
    stamp : [ns]
        Of the message.
    made
        The message of now.

    Returns
    -------
    bool
        True when nothing differs.
    """
    form = message.form
    if form.old:
        # Bytes of different message definitions cannot be compared, only fields.
        again = deserialized(serialized(made), message_class(message.type))
        ledger.compare_messages(message.topic, stamp, message.decoded(), again)
        return False
    return ledger.compare_bytes(message.topic, stamp, message.data, serialized(made), form.decode)
