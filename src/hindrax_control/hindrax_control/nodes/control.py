"""The control process: navigator, estimator health, pilot and allocator pass data by calls and publish all of it."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rclpy.node import Node

from hindrax_control.nodes.allocator_node import AllocatorNode
from hindrax_control.nodes.estimator_health_node import EstimatorHealthNode
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_core.events import Stamped
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.parameters import text
from hindrax_ros.process import spin


def make_nodes() -> Sequence[Node]:
    """Read the vehicle file and make the four nodes."""
    reader = BatchedNode("control", ros_time=False)
    vehicle = load_vehicle(text(reader, "vehicle", "", "vehicle file [-]"))
    allocator = AllocatorNode(vehicle)
    health = EstimatorHealthNode(vehicle, send_wrench=allocator.on_wrench)
    pilot = PilotNode(vehicle, allocator.supply, send_wrench=health.on_wrench)

    def on_state(state: Stamped[Navigation]) -> None:
        health.on_navigation(state)
        pilot.on_navigation(state)

    navigator = NavigatorNode(vehicle, on_state)
    allocator.allocation_listeners += [pilot.on_allocation, navigator.on_allocation]
    return [reader, health, pilot, allocator, navigator]


def main() -> int:
    """Run control until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
