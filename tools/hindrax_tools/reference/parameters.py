"""Page of the parameters of every node, from the knobs they are declared with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.network.link_monitor import SafetyMonitorKnobs
from hindrax_control.allocation.allocator import AllocationKnobs
from hindrax_control.allocation.supply_voltage import SupplyKnobs
from hindrax_control.allocation.wrench_guard import WrenchGuardKnobs
from hindrax_control.navigation.estimator_health import EstimatorHealthKnobs
from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_control.teleop import TeleopKnobs
from hindrax_drivers.driver_registry import DEVICES
from hindrax_drivers.nodes.thruster_settings import OutputAlone
from hindrax_drivers.output.output_guard import OutputGuardKnobs
from hindrax_ident.tuning import Tuning
from hindrax_tools.reference.knob_table import knob_table
from hindrax_tools.reference.markdown import head

ABOUT = """How the nodes are tuned. Each parameter is declared once, with its range; a value outside of it stops the
node with an error that names it. Set them in a ROS parameter file:

    /**/pilot:
      ros__parameters:
        holds.turn_radps: 0.3

and start the node with `--ros-args --params-file FILE`; `./hindrax up` and `pool-test` take `--params FILE` and
`--set pilot.holds.turn_radps:=0.3`, launch files `params_file:=FILE`. A whole number is accepted for a float.

Holds, maneuvers, pool, allocation, identification, teleoperation and limits of the bag can be changed while the node
runs (`ros2 param set /hindrax/pilot holds.turn_radps 0.2`); a maneuver in flight keeps what it began with. What guards
the vehicle (`guards`, `operator_wrench`, wrench limits of the allocator, thrusters, estimator health, safety monitor)
and what a node uses only as it starts (devices, navigator) is refused with the reason. Every node also has `vehicle`
(the vehicle file); sensors and thrusters have `port` and `clock`, which override those of the vehicle file in mock. A
node logs a warning for each given parameter that it does not declare."""

NODES: Mapping[str, tuple[type[Any], ...]] = {
    **{name: (row.knobs,) for name, row in DEVICES.items()},
    "thrusters": (OutputGuardKnobs, OutputAlone),
    "navigator": (NavigatorKnobs,),
    "estimator_health": (EstimatorHealthKnobs,),
    "pilot": (PilotKnobs,),
    "allocator": (AllocationKnobs, WrenchGuardKnobs, SupplyKnobs),
    "teleop": (TeleopKnobs,),
    "identifier": (Tuning,),
    "recorder": (BagLimits,),
    "safety_monitor": (SafetyMonitorKnobs,),
}
"""Dataclasses of knobs that each node declares as its parameters."""


def page() -> str:
    """Return the page."""
    nodes = (f"\n## {name}\n\n{_first_lines(kinds)}\n\n{knob_table(*kinds)}" for name, kinds in NODES.items())
    return head("Parameters", ABOUT) + "".join(nodes)


def _first_lines(kinds: tuple[type[Any], ...]) -> str:
    return " ".join((kind.__doc__ or "").partition("\n")[0] for kind in kinds)
