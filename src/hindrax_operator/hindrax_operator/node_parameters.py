"""The parameters that the nodes of a stack declare, and what of a user's is none of them.

ROS ignores a parameter that a node does not declare: whoever mistypes the name of a guard flies with the guard as it
was. So names and values are checked here before anything starts.
"""

import difflib
from collections.abc import Mapping

from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.network.link_monitor import SafetyMonitorKnobs
from hindrax_bringup.node_options import NodeOptions, ParameterOverrides
from hindrax_control.allocation.allocation_cycle import SupplyKnobs
from hindrax_control.allocation.allocator import AllocationKnobs
from hindrax_control.allocation.wrench_guard import WrenchGuardKnobs
from hindrax_control.navigation.estimator_health import EstimatorHealthKnobs
from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_control.teleop import TeleopKnobs
from hindrax_core.errors import UsageError
from hindrax_core.knobs import build, leaves, nested
from hindrax_core.messages.inputs import Inputs
from hindrax_core.sensor_table import SENSORS
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.nodes.thruster_settings import OutputAlone
from hindrax_drivers.output.output_guard import OutputGuardKnobs
from hindrax_ident.tuning import Tuning
from hindrax_ros.parameter_file import names_node
from hindrax_ros.parameters import renamed

NODES: Mapping[str, tuple[type[object], ...]] = {
    **{row.name: (driver_of(row.name).knobs,) for row in SENSORS},
    "thrusters": (OutputGuardKnobs, OutputAlone),
    "navigator": (NavigatorKnobs, Inputs),
    "estimator_health": (EstimatorHealthKnobs,),
    "pilot": (PilotKnobs,),
    "allocator": (AllocationKnobs, WrenchGuardKnobs, SupplyKnobs),
    "teleop": (TeleopKnobs,),
    "identifier": (Tuning,),
    "recorder": (BagLimits,),
    "safety_monitor": (SafetyMonitorKnobs,),
}
"""Dataclasses of knobs that each node declares as its parameters."""
TEXTS = ("vehicle", "use_sim_time", "start_type_description_service", "port", "clock", "frame_id", "frame_prefix")
"""Of every node beside its knobs."""
OF_ONE_NODE = {"recorder": ("bag", "notes", "truth"), "allocator": ("reference", "reference_frame")}
QUALITY_OF_SERVICE = "qos_overrides."
"""rclpy declares these for topics whose quality of service may be chosen."""


def check_parameters(tuning: ParameterOverrides, vehicle: Vehicle) -> None:
    """Refuse a parameter that its node does not declare, and a value that it would not take.

    What a file gives to every node (`/**`) is wrong only where no node knows it.

    Parameters
    ----------
    tuning
        Parameter file, single settings and namespace of the nodes.
    vehicle
        Whose sensors have nodes of their own.

    Raises
    ------
    UsageError
        Names node, parameter and the nearest that there is, or the range.
    """
    kinds = {**NODES, **{name: (driver_of(mount.device).knobs,) for name, mount in vehicle.sensors.items()}}
    known = {name for all_of in kinds.values() for kind in all_of for name in leaves(kind)} | {*TEXTS}
    blocks = NodeOptions("", tuning).parameters()
    for node, all_of in kinds.items():
        own = {name for kind in all_of for name in leaves(kind)}
        texts = (*TEXTS, *OF_ONE_NODE.get(node, ()))
        given: dict[str, object] = {}
        for pattern, block in blocks.items():
            if names_node(pattern, f"{tuning.namespace}/{node}"):
                given |= block
                wanted = known if pattern.endswith("*") else {*own, *texts}
                if name := next((one for one in block if one not in wanted and not _of_rclpy(one)), ""):
                    raise UsageError(_unknown(node, name, own))
        for kind in all_of:
            build(kind, nested({name: given[name] for name in leaves(kind) if name in given}), node)


def _of_rclpy(name: str) -> bool:
    return name.startswith(QUALITY_OF_SERVICE)


def _unknown(node: str, name: str, own: set[str]) -> str:
    new = renamed(name)
    near = [new] if new in own else difflib.get_close_matches(name, own, n=1)
    hint = f"the nearest is {near[0]}" if near else "wanted one of docs/reference/parameters.md"
    return f"parameter {node}.{name}: {node} has no such parameter; {hint}"
