"""One sensor alone, without a vehicle file: `ros2 run hindrax_drivers device dvl75 --ros-args -p port:=/dev/ttyUSB0`.

The same node as in the process of all sensors; port, address and frame come from its parameters. The folder `launch`
has a file for each device.
"""

import sys
from collections.abc import Sequence
from functools import partial

from rclpy.node import Node

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Mount
from hindrax_drivers.driver_registry import PORTS, driver_of
from hindrax_drivers.nodes.sensors import WireHosts
from hindrax_drivers.nodes.thruster_settings import NO_VEHICLE
from hindrax_ros.process import spin


def make_nodes(kind: str) -> Sequence[Node]:
    """Make the node of one device."""
    wires = WireHosts()
    wires.add(kind, Mount(kind, PORTS[driver_of(kind).wire]), NO_VEHICLE)
    wires.open_buses()
    return wires.nodes


def main() -> int:
    """Run one device until a signal."""
    kind = sys.argv[1] if len(sys.argv) > 1 else ""
    try:
        driver_of(kind)
    except UsageError as error:
        print(error, file=sys.stderr)  # noqa: T201  # wrong use
        return UsageError.exit_code
    return spin(partial(make_nodes, kind))


if __name__ == "__main__":
    sys.exit(main())
