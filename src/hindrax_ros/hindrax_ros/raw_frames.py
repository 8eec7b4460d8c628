"""Raw wire frames in batches, byte for byte as on the port, for the bag."""

from rclpy.node import Node

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.topics import raw_topic
from hindrax_msgs.msg import RawFrames
from hindrax_ros.graph import publisher
from hindrax_ros.messages.fast_serialization import raw_frames_bytes

RECEIVED, SENT = RawFrames.RECEIVED, RawFrames.SENT
READER_WAIT_S = 10.0
"""Wait of the first frames for a subscriber: a replay needs those with which a device was set up."""


class FrameTap:
    """Collects the frames of one source and publishes them as one message every `period_s`.

    The first message waits until there is a subscriber, or for `READER_WAIT_S`: on a busy machine the recorder may be
    discovered later than the first frames arrive. The owner flushes the last one, once no more frames come.
    """

    def __init__(self, node: Node, source: str, period_s: float = 0.1) -> None:
        self._publisher = publisher(node, raw_topic(source))
        self._source, self._period_s = source, period_s
        self._begin: Stamp | None = None
        self._publishing = False
        self._stamps: list[int] = []
        self._directions = bytearray()
        self._lengths: list[int] = []
        self._data = bytearray()

    def add(self, stamp: Stamp, sent: bool, data: bytes) -> None:
        """Add one frame; publish the batch when it is old enough.

        Parameters
        ----------
        stamp
            Of the frame.
        sent
            Whether it went to the device.
        data
            Its bytes.
        """
        if self._begin is None:
            self._begin = stamp
        self._stamps.append(stamp)
        self._directions.append(SENT if sent else RECEIVED)
        self._lengths.append(len(data))
        self._data += data
        age_s = seconds_between(self._begin, stamp)
        self._publishing = self._publishing or age_s >= READER_WAIT_S or self._publisher.get_subscription_count() > 0
        if self._publishing and age_s >= self._period_s:
            self.flush()

    def flush(self) -> None:
        """Publish the batch, with the stamp of its last frame."""
        if not self._stamps:
            return
        self._publisher.publish(
            raw_frames_bytes(
                Stamp(self._stamps[-1]),
                self._source,
                stamps=self._stamps,
                directions=self._directions,
                lengths=self._lengths,
                data=self._data,
            )
        )
        self._begin = None
        self._stamps, self._lengths = [], []
        self._directions, self._data = bytearray(), bytearray()
