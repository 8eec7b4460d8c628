"""The control process: navigator, estimator health, pilot and allocator, or some of them.

Messages between two of them also go by call, if both have the same name for the
topic; then the graph is not read for it. Remap one end (`-r pilot:control/wrench:=elsewhere`), or leave one of them
out, and the other reads it from the graph.
"""

import sys
from collections.abc import Collection, Sequence
from functools import partial

from rclpy.node import Node

from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.nodes.allocator_node import AllocatorNode
from hindrax_control.nodes.estimator_health_node import EstimatorHealthNode
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_core.topics import ALLOCATION, ODOMETRY, WRENCH
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.parameters import text
from hindrax_ros.process import spin

EVERY = ("allocator", "pilot", "navigator")


def make_nodes(wanted: Collection[str] = EVERY) -> Sequence[Node]:
    """Read the vehicle file, make the nodes, and connect those that have each other. The pilot brings its health."""
    (name,) = wanted if len(wanted) == 1 else ("control",)
    asking = BatchedNode(name, enable_rosout=len(wanted) > 1)
    vehicle = load_vehicle(text(asking, "vehicle", "", "vehicle file [-]"))
    reader = asking if len(wanted) > 1 else None
    if reader is None:  # a launch file gives the parameter to the one node, under its name
        asking.destroy_node()
    allocator = AllocatorNode(vehicle, reader.now if reader else None) if "allocator" in wanted else None
    pilot = navigator = health = None
    if "pilot" in wanted:
        pilot = PilotNode(vehicle, allocator.supply if allocator else SupplyVoltage(vehicle.supply_V))
        pilot.health = health = EstimatorHealthNode(vehicle, (reader or pilot).now)
    if "navigator" in wanted:
        navigator = NavigatorNode(vehicle)
    if allocator and health:
        allocator.inhibited = health.failed
    if allocator and pilot and allocator.bypass(pilot, WRENCH):
        pilot.send_wrench, pilot.send_forces = allocator.on_wrench, allocator.on_forces
        allocator.pilot = pilot.get_fully_qualified_name()
    if navigator and pilot and pilot.bypass(navigator, ODOMETRY):
        navigator.on_state, pilot.navigator = pilot.on_navigation, navigator.get_fully_qualified_name()
        pilot.confirm_position = navigator.confirm_position
    for listener in (pilot, navigator):
        if allocator and listener and listener.bypass(allocator, ALLOCATION):
            allocator.allocation_listeners.append(listener.on_allocation)
    # The navigator comes last: the turn in which it has a state begins with what the others have received.
    return [node for node in (reader, health, pilot, allocator, navigator) if node is not None]


def main(wanted: Collection[str] = EVERY) -> int:
    """Run these nodes until a signal; of a single one, `-r __node:=NAME` is the name."""
    return spin(lambda: make_nodes(wanted), renamed="".join(wanted) if len(wanted) == 1 else "")


allocator, pilot, navigator = (partial(main, (name,)) for name in EVERY)
"""Run one of them alone; the pilot with the health of its state."""


if __name__ == "__main__":
    sys.exit(main())
