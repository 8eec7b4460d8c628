"""The control process: navigator, pilot and allocator, who hand each other the data and publish all of it."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rclpy.node import Node

from hindrax_control.nodes.allocator import AllocatorNode
from hindrax_control.nodes.navigator import NavigatorNode
from hindrax_control.nodes.pilot import PilotNode
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.parameters import text
from hindrax_ros.polled import PolledNode
from hindrax_ros.process import spin


def make_nodes() -> Sequence[Node]:
    """Read the vehicle file and make the three nodes."""
    reader = PolledNode("control", ros_time=False)
    vehicle = load_vehicle(text(reader, "vehicle", "", "vehicle file [-]"))
    allocator = AllocatorNode(vehicle)
    pilot = PilotNode(vehicle, allocator.supply, give=allocator.take)
    navigator = NavigatorNode(vehicle, give=pilot.take)
    allocator.hearers += [pilot.hear, navigator.hear]
    return [reader, pilot, allocator, navigator]


def main() -> int:
    """Run control until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
