"""Forces [N] to the thrusters of ros2_control: an array for a forward command controller, or a number for each."""

from collections.abc import Sequence

from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray

from hindrax_core.topics import Quality, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.output.force_output import NAME_FIELD, topics_of
from hindrax_ros.graph import publisher

ARRAY, NUMBER = "std_msgs/msg/Float64MultiArray", "std_msgs/msg/Float64"
QUALITY = Quality(depth=1)
"""Reliable, as a subscription of the system's default wants it; only the last force matters."""


class ForcePublishers:
    """Publishers of one node, which send at once: safety does not wait for a turn."""

    def __init__(self, node: Node, vehicle: Vehicle, port: str) -> None:
        self._names = names = topics_of(vehicle, port)
        kind = NUMBER if NAME_FIELD in port else ARRAY
        self._each = kind == NUMBER
        self._publishers = [publisher(node, Topic(name, kind, QUALITY, 0, "force [N]"), held=False) for name in names]

    def send(self, forces_N: Sequence[float]) -> None:
        """Publish one force per thruster, in the order of the vehicle file."""
        if not self._each:
            self._publishers[0].publish(Float64MultiArray(data=list(forces_N)))
            return
        for one, force_N in zip(self._publishers, forces_N, strict=True):
            one.publish(Float64(data=force_N))

    def unheard(self) -> str:
        """Topics without a subscriber; empty when somebody hears every force."""
        pairs = zip(self._names, self._publishers, strict=True)
        found = [name for name, one in pairs if not one.get_subscription_count()]
        return f"{found[0]} and {len(found) - 1} more" if len(found) > 1 else "".join(found)
