"""Cameras of the graph: who publishes sensor_msgs/CompressedImage, and the last frame of those that are looked at."""

import time
from functools import partial

from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage

from hindrax_core.topics import BY_HAND
from hindrax_operator.snapshot import CameraFrame
from hindrax_ros.graph import profile

TYPE = "sensor_msgs/msg/CompressedImage"
LOOK_S = 2.0
"""Time between two queries of the graph."""
WANTED_S = 3.0
"""A camera without a viewer for this long is unsubscribed: video is most of a tether's traffic."""


class Cameras:
    """Cameras as a node sees them. `frame` may be called from any thread, `step` by the thread of the node."""

    def __init__(self, node: Node) -> None:
        self.names: tuple[str, ...] = ()
        self._node, self._looked_s = node, float("-inf")
        self._wanted_s: dict[str, float] = {}
        self._subscribed: dict[str, Subscription] = {}
        self._frames: dict[str, CameraFrame] = {}

    def frame(self, name: str) -> CameraFrame | None:
        """Return the last frame of a camera, None before the first; from now on it is wanted."""
        self._wanted_s[name] = time.monotonic()
        return self._frames.get(name)

    def update(self) -> None:
        """Look at the graph, subscribe what is wanted, leave the rest."""
        now = time.monotonic()
        if now - self._looked_s > LOOK_S:
            self._looked_s = now
            found = self._node.get_topic_names_and_types()
            self.names = tuple(sorted(name for name, types in found if TYPE in types))
        wanted = {name for name in self.names if now - self._wanted_s.get(name, float("-inf")) < WANTED_S}
        for name in wanted - self._subscribed.keys():
            on_frame = partial(self._on_frame, name)
            self._subscribed[name] = self._node.create_subscription(CompressedImage, name, on_frame, profile(BY_HAND))
        for name in self._subscribed.keys() - wanted:
            self._node.destroy_subscription(self._subscribed.pop(name))
            self._frames.pop(name, None)

    def _on_frame(self, name: str, message: CompressedImage) -> None:
        self._frames[name] = CameraFrame(time.monotonic_ns(), bytes(message.data))
