"""Simulators of others that can move the vehicle in place of the mock's own plant: their topics and their axes.

The odometry must be that of the center of mass, as our exports place the link.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from hindrax_core.errors import UsageError
from hindrax_core.text.nearest import found_in
from hindrax_core.topics import ros_name

UP, DOWN = (1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
"""Signs from the axes of a simulator into SNAME: z up with y to the left, or z down."""


@dataclass(frozen=True, slots=True)
class Simulator:
    """Topics of one kind of simulator, with {name} for the vehicle and {thruster} for one of its thrusters."""

    prefix: str
    odometry: str
    thrust: str
    signs: tuple[float, float, float] = UP
    start: str = ""
    """How it is started, for the sentence about its silence."""


SIMULATORS: Mapping[str, Simulator] = {
    "mujoco": Simulator("/{name}", "odometry", "thrusters", start="python ros_vehicle.py in the exported folder"),
    "gz": Simulator(
        "/model/{name}", "odometry", "joint/{thruster}_joint/cmd_thrust",
        start="gz sim -r world.sdf and the bridge in the exported folder",
    ),
    "stonefish": Simulator("/{name}", "odometry", "thruster_setpoints", DOWN, "the scenario with its ROS interface"),
}  # fmt: skip


EXAMPLE = "gz:/model/rov"


def simulator_of(text: str, name: str) -> Simulator:
    """Row of `KIND` or `KIND:/PREFIX`, its topics filled in for a vehicle; UsageError for an unknown kind."""
    kind, _, prefix = text.partition(":")
    row = SIMULATORS.get(kind)
    if row is None:
        raise UsageError(f"--simulator {text}: {found_in(kind, SIMULATORS)}, or one with its prefix, as in {EXAMPLE}")
    if prefix and not prefix.startswith("/"):
        found = f"found the prefix {prefix!r}, wanted one that begins with /, as in {EXAMPLE}"
        raise UsageError(f"--simulator {text}: {found}")
    place = (prefix or row.prefix.format(name=ros_name(name))).rstrip("/")
    return replace(row, prefix=place, odometry=f"{place}/{row.odometry}", thrust=f"{place}/{row.thrust}")
